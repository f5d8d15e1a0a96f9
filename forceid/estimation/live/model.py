"""What a stretch of frames tells of all to come: shape, deformation, noise, and priors of the loads."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.body.deformation import products_of
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.methods.problem import Solution
from forceid.estimation.run import estimate_shown
from forceid.flight.priors.protocol import LoadPrior
from forceid.kalman import StateSpace, steady
from forceid.kalman.building.process import discretize
from forceid.motion import Products, ReadingCov
from forceid.records import Array, Body, Finding, Flags, Frame, Motion, Recording

INSIDE = 8  # parts of a stretch, of which the first and the last are left out of a mean: claims rise there
SLOW = {"slow-errors-allowed", "noise-hidden"}  # findings whose allowance holds for frames to come as well


@dataclass(frozen=True, eq=False)
class Swings:
    """The amplitudes of shapes (mode, node, 3) as states (q, q', load) of each, as their filter settles.

    F (state, state) over one step of the clock; each: states of a mode; P (state, state): covariance before a
    frame that shows all markers; lasting (mode,) m2: variance of q behind it, times the frames for which an
    error of a mode lasts.
    """

    shapes: Array
    each: int
    F: Array
    P: Array
    lasting: Array


@dataclass(frozen=True, eq=False)
class LiveModel:
    """A body in flight as frames to come are read with it.

    step s of the clock; shape (node, 3) m about the mass center, body axes; weight (node,) of the rotation
    fit; noise: of the readings of a frame, body axes; share (node,): of the mass that each node
    carries, None where the mean of the nodes is not the mass center; noise_var m2 of a coordinate; swings:
    None of a body that does not deform; mass kg; products: what amplitudes do to the inertia; inside (3,)
    kg m2/s; gravity (3,); force, moment: priors, no moment where markers show none; momentum (3,): angular
    momentum at the first frame, world axes; spread (6, 6): what claimed variances are times, allowance (6,):
    what is added to them; at_first (frame, 6): the same at the frames of the stretch itself; slow: factor on
    the variance of errors that follow each other; least kg m2: the smallest moment of inertia; findings of
    the stretch.
    """

    step: float
    shape: Array
    weight: Array
    seen: Flags
    noise: ReadingCov
    share: Array | None
    noise_var: float
    swings: Swings | None
    mass: float
    products: Products
    inside: Array
    gravity: Array
    force: LoadPrior
    moment: LoadPrior | None
    momentum: Array
    spread: Array
    allowance: Array
    at_first: Array
    slow: float
    least: float
    level: str
    tuned: dict[str, float]
    findings: tuple[Finding, ...]

    @property
    def turns(self) -> bool:
        """Whether a load keeps to axes of the body."""
        loads = self.force, self.moment
        return any(load is not None and load.body_axes is not None for load in loads)


def tuned_on(
    frames: list[Frame], body: Body, gravity: Array, noise_std: dict[str, float], settings: Settings
) -> LiveModel:
    """The model that the estimate of a stretch leaves. EstimationError where that shows no force."""
    time, position = np.array([f.time for f in frames]), np.array([f.position for f in frames])
    motion = Motion(time, position, gravity=gravity, noise_std=noise_std)
    found, solution = estimate_shown(Recording(body, motion), settings)
    if solution is None or "force" not in solution.priors or solution.kinematics.markers is None:
        why = "; ".join(found.verdict.reasons) or "the plain route alone stands, which has no prior"
        raise EstimationError(f"cannot be tuned on: {why}", f"the stretch up to {time[-1]:g} s")
    return model_of(solution, gravity, found.verdict.findings)


def model_of(solution: Solution, gravity: Array, findings: tuple[Finding, ...]) -> LiveModel:
    """The model that a solved stretch leaves."""
    kin, markers = solution.kinematics, solution.kinematics.markers
    assert markers is not None
    step = float(np.median(np.diff(kin.time)))
    swings = swings_of(solution, step)
    noise = markers.white if kin.beside is None else markers.white.beside(kin.beside)
    if swings is None and len(kin.shapes):  # shapes that are not followed are noise of every frame
        flat = kin.shapes.reshape(len(kin.shapes), -1)
        var = np.nanmean(kin.amplitude**2, 0)
        noise = noise.beside(flat.T * np.sqrt(markers.period * var))
    weight = kin.inertia.weight
    whole = kin.apart and markers.mean is not None
    n, T, state = len(kin.time) // INSIDE, len(kin.time), solution.state
    extra, J = np.zeros((T, 6)), solution.deformation.inertia
    if solution.smoothing is not None:
        extra = np.diagonal(solution.smoothing.allowance, axis1=1, axis2=2)
        extra = np.maximum(np.nan_to_num(extra), 0.0)
    lasts = bool(SLOW & {finding.code for finding in findings})
    turning = kin.attitude and kin.inertia.line is None and "moment" in solution.priors
    return LiveModel(
        step=step, shape=kin.shape, weight=markers.weight, seen=kin.seen, noise=noise,
        share=weight / weight.sum() if whole else None, noise_var=markers.noise_std**2, swings=swings,
        mass=kin.inertia.mass, products=products_of(kin) if swings is not None else still(kin),
        inside=np.atleast_2d(kin.inside)[-1], gravity=gravity, force=to_go_on(solution.priors["force"]),
        moment=to_go_on(solution.priors["moment"]) if turning else None,
        momentum=np.nan_to_num(state.H[0]),
        spread=np.eye(6) if (growth := solution.grown) is None else (growth.reshape(-1, 6, 6) ** 2).mean(0),
        allowance=extra[n : T - n].mean(0) * lasts, at_first=extra * (not lasts),
        least=float(np.linalg.eigvalsh(J)[:, 0].min()),
        slow=1.0 if kin.color is None else kin.color.slow, level=kin.model, tuned=solution.tuned,
        findings=findings,
    )  # fmt: skip


def still(kin: Kinematics) -> Products:
    """Products of the mean shape alone."""
    inertia = products_of(kin).inertia[:1, :1]
    return Products(inertia, np.zeros((1, 0, 3)))


def to_go_on(prior: LoadPrior) -> LoadPrior:
    """The prior of what is to come: that of the loudest piece, with lines that stand still in the world."""
    lines = tuple(line.onward for line in prior.lines if not line.turns)
    return replace(prior, tuned=replace(prior.tuned, pieces=None), lines=lines)


def swings_of(solution: Solution, step: float) -> Swings | None:
    """How the shapes of a stretch swing; None where there are none, or mass without markers swings beside."""
    kin, prior = solution.kinematics, solution.deformation.prior
    if prior is None or kin.frames is None or kin.hidden is not None:
        return None
    m, each = len(prior.std), prior.states
    F, Q = (block_diag(*a) for a in discretize(prior.process, np.full(m, step)))
    rows = kin.frames.rows[np.argmax((kin.frames.rows**2).sum((1, 2)))]
    read = np.zeros((len(rows), m * each))
    read[:, ::each] = rows
    one, start = np.eye(len(rows)), block_diag(*prior.process.P0)
    rest = steady(StateSpace(F, Q, read, one, np.zeros(m * each), start))
    often = np.clip(2 * np.pi / (prior.frequency * step), 1.0, len(kin.time))
    return Swings(kin.shapes, each, F, rest.predicted, often * np.diagonal(rest.filtered)[::each])
