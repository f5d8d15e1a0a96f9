"""Who finds force and first moments from markers: forceid, and least squares differentiated twice."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from evidence.judged import band_of, over_claim, rms, samples_a_second
from evidence.subject import Answer, at_once
from evidence.subjects.affine.problem import AffineProblem
from forceid.config import load_settings
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.run import estimate_recording
from forceid.files.validate import check_recording
from forceid.records import Array, Recording

WINDOW, ORDER = 21, 4  # frames, of a polynomial


def estimated_flight(problem: AffineProblem) -> Answer:
    """`estimate_recording` with the affine model, as `forceid estimate --model affine` has it."""
    check_recording(problem.given)
    found = estimate_recording(problem.given, load_settings(model="affine"))
    said = found.verdict
    if found.first_moment is None or found.first_moment_cov is None or said.level == "refused":
        return Answer((found.force, found.force), None, "refused", said.reasons)
    moment_var = np.diagonal(found.first_moment_cov, axis1=1, axis2=2)
    first = found.first_moment.reshape(-1, 9)
    answer = judged_flight(
        problem, found.force, first, found.force_std**2, moment_var, said.level, said.reasons
    )
    rate, everywhere = samples_a_second(found.time), np.full(9, np.inf)  # no band of its own
    over = (
        over_claim(found.force - problem.motion, found.force_std, band_of(found)[:3], rate),
        over_claim(first - problem.rate, np.sqrt(moment_var).reshape(-1, 9), everywhere, rate),
    )
    return replace(answer, over=over, codes=tuple(f.code for f in said.findings if f.level != "ok"))


def judged_flight(
    problem: AffineProblem,
    force: Array,
    moment: Array,
    force_var: Array,
    moment_var: Array,
    verdict: str = "ok",
    reasons: tuple[str, ...] = (),
) -> Answer:
    """Errors N and N m and claims, rms a component over the central three quarters."""
    off = rms(force - problem.motion), rms(moment - problem.rate)
    claimed = rms(np.sqrt(force_var)), rms(np.sqrt(moment_var))
    return Answer((force, moment), claimed, verdict, reasons, off)


def differentiated(window: int, problem: AffineProblem) -> Answer:
    """Least squares of every frame, then second differences, or a polynomial along `window` frames.

    Claims the noise of the markers that goes through, and nothing of what the window cuts off.
    """
    recording: Recording = problem.given
    body, motion = recording.body, recording.motion
    x, X, time = motion.position, body.position, motion.time
    assert x is not None
    assert X is not None
    known, mass = inertia_of(body), inertia_of(body).mass
    E = 0.5 * np.trace(known.tensor) * np.eye(3) - known.tensor
    design = np.hstack([np.ones((len(X), 1)), X - known.center])
    gain = np.linalg.pinv(design)
    found = np.einsum("kn,tna->tak", gain, x)
    step = float(np.median(np.diff(time)))
    if window > len(time):
        raise np.linalg.LinAlgError("window longer than the record")
    if window:
        smooth, second = (savgol_filter(found, window, ORDER, order, step, axis=0) for order in (0, 2))
        weight = float((savgol_coeffs(window, ORDER, 2, step) ** 2).sum())
    else:
        smooth, second = found, np.gradient(np.gradient(found, step, axis=0), step, axis=0)
        weight = 6 / 16 / step**4
    gravity = np.zeros(3) if motion.gravity is None else motion.gravity
    force = mass * (second[..., 0] - gravity)
    F, ddF = smooth[..., 1:], second[..., 1:]
    cov = motion.noise_std["position"] ** 2 * weight * gain @ gain.T
    A = E @ F.swapaxes(1, 2)
    along = np.einsum("tkb,kl,tlb->tb", A, cov[1:, 1:], A)  # alike for the three rows
    force_var = np.full(force.shape, mass**2 * cov[0, 0])
    return judged_flight(problem, force, (ddF @ A).reshape(-1, 9), force_var, np.tile(along, (1, 3)))


LOADS = (
    at_once("estimate, affine", estimated_flight),
    at_once("least squares, Savitzky-Golay", partial(differentiated, WINDOW), kind="peer"),
    at_once("least squares, differenced", partial(differentiated, 0), kind="peer"),
)
