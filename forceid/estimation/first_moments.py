"""First moments of force of a flight at the affine level, which agree with its moment.

What acts inside a body drives its stretch, but no moment: the angular momentum shows the moment better than
the columns of F E do. So the first moments take the moment of the flight as theirs, and with it all that is
correlated with it. Source: pseudo-rigid bodies, section 1.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from forceid.config import Settings
from forceid.errors import ForceIdError
from forceid.estimation.affine.loads import MOMENT, AffineLoads, affine_loads
from forceid.estimation.body.cleaning import cleaned, without_frames
from forceid.estimation.body.material import solid_of
from forceid.estimation.methods.solution import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.flight.smoother import FlightState
from forceid.pseudorigid import circulation, polar, polar_rates
from forceid.records import Array, Finding, Recording

UNCLEAR = 0.2  # of F, in a frame


def observed_first_moments(
    recording: Recording, settings: Settings, solution: Solution
) -> tuple[AffineLoads | None, tuple[Finding, ...]]:
    """First moments of a flight smoothed at the affine level, or None and, where some were due, why not."""
    if solution.kinematics.model != "affine" or solution.smoothing is None:
        return None, ()
    try:
        loads = flight_first_moments(recording, settings, solution)
        return loads, (*loads.findings, *unclear_map(recording, solution, loads))
    except ForceIdError as e:
        return None, (note("no-first-moments", error=str(e)),)


def flight_first_moments(recording: Recording, settings: Settings, solution: Solution) -> AffineLoads:
    """First moments on the frames, and with the noise, that the flight was solved with.

    Raises DataError where the markers fix none of them, EstimationError for too short a record. Source:
    pseudo-rigid bodies, section 1.
    """
    kin, state = solution.kinematics, solution.state
    motion = without_frames(
        cleaned(recording.body, recording.motion)[0], np.asarray(np.isnan(kin.pose.center).any(1))
    )
    motion = replace(motion, noise_std=motion.noise_std | {"position": kin.noise["position"]})
    own = settings.model_copy(update={"noise_std": {}})
    loads = affine_loads(replace(recording, motion=motion), own, solid_of(recording.body))
    if loads.applied_first_moment is not None:  # told from the stress, they show the moment better
        return loads
    return with_moment(loads, state.moment, state.wrench_cov[:, 3:, 3:])


def given_stress(state: FlightState, loads: AffineLoads | None, known: Array) -> FlightState:
    """The state of a flight with the moment of first moments that stress tells apart, if there are any.

    known (time, 3) or (3,): of what the state is beside.
    """
    if loads is None or loads.applied_first_moment is None:
        return state
    cov = state.wrench_cov.copy()
    cov[:, 3:], cov[:, :, 3:] = 0.0, 0.0
    cov[:, 3:, 3:] = loads.moment_cov
    return replace(state, moment=loads.moment - known, wrench_cov=cov)


def polar_motion(loads: AffineLoads, inertia: Array) -> dict[str, Any]:
    """F with covariance and rate, its polar rotation (time, 3, 3) and the spin of that, circulation, by name.

    inertia (3, 3) kg m2, reference axes. Nothing where F is open in part.
    """
    if not (np.isfinite(loads.F).all() and (np.linalg.det(loads.F) > 0).all()):
        return {}
    rotation, (omega, *_) = polar(loads.F)[0], polar_rates(loads.F, loads.dF)
    E = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return {
        "rotation": rotation, "F": loads.F, "F_cov": loads.F_cov, "F_rate": loads.dF,
        "spin": (rotation @ omega[..., None])[..., 0], "circulation": circulation(loads.F, loads.dF, E),
    }  # fmt: skip


def unclear_map(recording: Recording, solution: Solution, loads: AffineLoads) -> tuple[Finding, ...]:
    """What to say where the markers of a frame hardly show F, so that nothing stands out of their noise."""
    x, noise = recording.body.position, solution.kinematics.noise["position"]
    assert x is not None
    observed = 3 if loads.span is None else loads.span.shape[1]  # directions in which F is looked at
    off = noise / float(np.linalg.svd(x - x.mean(0), compute_uv=False)[observed - 1])
    if off < UNCLEAR:
        return ()
    return (note("stretch-in-noise", stretch=off, noise_m=noise),)


def with_moment(loads: AffineLoads, moment: Array, cov: Array) -> AffineLoads:
    """Loads whose moment is `moment` (time, 3) N m, of covariance `cov` (time, 3, 3), known from elsewhere.

    The moment gets that distribution, the rest keeps its own given the moment. First moments of which some
    are open are left alone, as is a moment that is not known. Source: pseudo-rigid bodies, section 1.
    """
    C = loads.first_moment_cov
    known = np.isfinite(C).all((1, 2)) & np.isfinite(cov).all((1, 2)) & np.isfinite(moment).all(1)
    if not known.any():
        return loads
    own = MOMENT @ C[known] @ MOMENT.T
    gain = np.linalg.solve(own, MOMENT @ C[known]).mT
    first, first_cov = loads.first_moment.copy(), C.copy()
    change = np.einsum("tij,tj->ti", gain, moment[known] - loads.moment[known])
    first[known] += change.reshape(-1, 3, 3)
    first_cov[known] += gain @ (cov[known] - own) @ gain.mT
    return replace(loads, first_moment=first, first_moment_cov=first_cov)
