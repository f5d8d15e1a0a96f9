"""The flights of the parts of a body smoothed together, under what the joints cannot pass.

Each part by itself claims an error that is half noise and half load smoothed away. The noise of two parts is
independent, the load between them is one and the same: averaged as if independent, their wrenches claim too
little. So the linear models of all parts stand side by side, with rows that hold the balances which no joint
wrench can upset (whole body free, hinge without moment about its axis) at every sample, and what the joints
keep of the poses, beside what bending moves them by. Source: principal equations 2.8, 4f, 4h.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from forceid.errors import EstimationError
from forceid.estimation.joints.bending import Bending
from forceid.estimation.joints.constraints import Constraints
from forceid.estimation.loads.ascent import bfgs_maximum
from forceid.estimation.loads.channels import force_channel, moment_channel, tune_channel
from forceid.estimation.loads.rough_look import RESOLVED
from forceid.estimation.methods.problem import Smoothing, Solution
from forceid.flight.channels import FLIGHT_SAMPLES, middle
from forceid.flight.model import Reference, linear_flight
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import smooth_flight
from forceid.flight.tuning import ORDERS
from forceid.kalman.building.line_search import ROOM
from forceid.kalman.building.process import block_diagonal
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array

BEGINNING = 8  # samples that tell where parts begin
COMPARED_AT = 3.0  # times its rate, where they are compared
SIZE_OF_BENDING = 4  # among the numbers that are tuned: level and rate of forces, of moments, of bending
DOUBLED = 8  # times at most: joints of parts that bend by so much more hold next to nothing
ABOUT = 0.1  # of a logarithm: to which a standard error is found


Priors = list[dict[str, LoadPrior]]  # of force and moment, of every part


@dataclass(frozen=True)
class LinkedPart:
    """A part as it was smoothed by itself: what that rests on, and the reference it was linearized about."""

    smoothing: Smoothing
    reference: Reference


def linked_parts(solutions: list[Solution | None], highest: int, engine: Engine) -> list[LinkedPart]:
    """Solved parts, ready to be smoothed together; none where one of them was not smoothed.

    Of several priors of one load the one that claims most prevails: one of an order above `highest` is tuned
    again without it.
    """
    found = [None if solution is None else linked_part(solution, highest, engine) for solution in solutions]
    kept = [part for part in found if part is not None]
    return kept if len(kept) == len(solutions) else []


def linked_part(solution: Solution, highest: int, engine: Engine) -> LinkedPart | None:
    """A part that was smoothed, under priors of modest order; None for one that was not, or has no moment."""
    smoothing, reference = solution.smoothing, solution.state.reference
    if smoothing is None or reference is None or "moment" not in smoothing.priors:
        return None
    kin, priors = solution.kinematics, dict(smoothing.priors)
    for name, prior in smoothing.priors.items():
        if prior.kernel.order > highest:
            force = name == "force"
            channel = (
                force_channel(kin, smoothing.flight.gravity)
                if force
                else moment_channel(kin, solution.deformation)
            )
            orders = tuple(order for order in ORDERS if order <= highest)
            priors[name] = tune_channel(channel, (1.0, 1.0), prior.lines, orders, engine)
    if any(priors[name] is not smoothing.priors[name] for name in priors):
        state = smooth_flight(smoothing.flight, priors["force"], priors["moment"], engine)
        if state.reference is None:
            return None
        smoothing, reference = replace(smoothing, priors=priors), state.reference
    return LinkedPart(smoothing, reference)


def tuned_linked(
    parts: list[LinkedPart], constraints: Constraints, widening: float, engine: Engine, near: Array
) -> tuple[Priors, Bending, float, Array]:
    """Priors of every part, and bending of the joints, under which all parts and their constraints are
    likeliest; how likely.

    widening: factor on the variance of the priors, each of which was found as if its part flew alone: a load
    that several parts show is counted as often, and is to keep its size. From there the sizes and the rates
    of all forces move together, those of all moments, and those of all bending. How likely: the markers,
    given the constraints, and where the parts begin; that these hold is likelier the smaller the loads, and
    tells nothing of them. Bending is taken as large as the markers let it be by a standard error: what is
    believed too still holds the joints, and all that they pass, too well. near (6,): from where the search
    begins, as logarithms; last, where it ended.
    """
    each = [{name: widened_prior(p, widening) for name, p in part.smoothing.priors.items()} for part in parts]
    start, time = bending_of(parts, constraints), len(constraints.gap)
    run = middle(time, FLIGHT_SAMPLES)

    def likely(by: Array) -> float:
        model, z, _ = linked_model(parts, both_moved(each, by), start.moved(by[4:]), constraints, run)
        begun = z.copy()
        begun[BEGINNING:, : -constraints.gap.shape[1]] = np.nan
        try:
            return float(engine.log_likelihood(model, z)) - float(engine.log_likelihood(model, begun))
        except EstimationError:  # numbers so far off that a covariance loses its sign
            return -np.inf

    bends = bool(start.std.any())
    free = 6 if bends else SIZE_OF_BENDING
    best = np.pad(bfgs_maximum(lambda by: likely(np.pad(by, (0, 6 - free))), near[:free]), (0, 6 - free))
    highest = likely(best)
    bending = start.moved(as_far(likely, best, highest)[4:]) if bends else start
    return both_moved(each, best), bending, highest, best


def bending_of(parts: list[LinkedPart], constraints: Constraints) -> Bending:
    """Bending as fast as the forces on the parts, before its size and rate are tuned."""
    kernels = [part.smoothing.priors["force"].kernel for part in parts]
    rate = np.exp(np.mean([np.log(k.rate[k.std.argmax()]) for k in kernels]))
    return Bending(constraints.bends, float(rate))


def as_far(likely: Callable[[Array], float], best: Array, highest: float) -> Array:
    """The maximum at `best` (6,) with bending so large that it is half a unit less likely: a standard error.

    Where no bending is likelier than any, that is as far as noise hides it.
    """

    def lower(by: float) -> float:
        return likely(best + by * np.eye(6)[SIZE_OF_BENDING]) - highest + 0.5

    far = next((by for by in np.log(2.0) * np.arange(1, DOUBLED) if lower(by) < 0), None)
    by = np.log(2.0) * DOUBLED if far is None else brentq(lower, far - np.log(2.0), far, xtol=ABOUT)
    return np.asarray(best + by * np.eye(6)[SIZE_OF_BENDING])


def smooth_linked(
    parts: list[LinkedPart], priors: Priors, bending: Bending, constraints: Constraints, engine: Engine
) -> tuple[Array, Array]:
    """Wrenches (time, part, 6) about the mass centers, and their covariance (time, part * 6, part * 6)."""
    time = len(constraints.gap)
    size = 6 * len(parts)
    wrench, cov = np.empty((time, size)), np.empty((time, size, size))
    states = linked_model(parts, priors, bending, constraints, slice(0, 2))[2].shape[1]
    for run, kept in overlapping_windows(time, max(FLIGHT_SAMPLES, ROOM // 5 // states**2)):
        model, z, read = linked_model(parts, priors, bending, constraints, run)
        path = engine.smooth(model, z)
        inner = slice(kept.start - run.start, kept.stop - run.start)
        wrench[kept] = path.x[inner] @ read.T
        cov[kept] = read @ path.P[inner] @ read.T
    return wrench.reshape(time, len(parts), 6), cov


def both_moved(priors: Priors, by: Array) -> Priors:
    """The priors of all parts, of forces moved by by[:2] and of moments by by[2:]."""
    return [{"force": p["force"].moved(by[:2]), "moment": p["moment"].moved(by[2:])} for p in priors]


def linked_model(
    parts: list[LinkedPart], priors: Priors, bending: Bending, constraints: Constraints, run: slice
) -> tuple[StateSpace, Array, Array]:
    """All parts under their constraints over samples `run`: model, what it measures, and rows (part * 6,
    state) that read the wrenches.
    """
    models: list[StateSpace] = []
    seen, wrenches, motions = list[Array](), list[Array](), list[Array]()
    for part, prior in zip(parts, priors, strict=True):
        force, moment = prior["force"], prior["moment"]
        model, z = linear_flight(part.smoothing.flight, force, moment, part.reference)
        n, end = force.states, moment.states
        wrench, moving = np.zeros((6, len(model.x0))), np.zeros((9, len(model.x0)))
        wrench[:3, :n], wrench[3:, n : n + end] = force.rows, moment.rows
        moving[:3, :3], moving[3:6, n : n + 3], moving[6:, n + 3 : n + 6] = force.axes, np.eye(3), moment.axes
        models.append(model)
        seen.append(z[run])
        wrenches.append(wrench)
        motions.append(moving)
    clock = parts[0].smoothing.flight.time
    models += [standing(constraints.spread), bending.model(np.diff(clock))]
    read, moved_by, bent = block_diag(*wrenches), block_diag(*motions), bending.rows
    tied = np.concatenate(
        [
            constraints.on_wrench[run] @ read + constraints.on_motion[run] @ moved_by,
            constraints.offset[run],
            np.broadcast_to(bent, (run.stop - run.start, *bent.shape)),
        ],
        2,
    )
    slack, gap = constraints.slack[run], constraints.gap[run]
    used = np.isfinite(tied).all(2) & np.isfinite(slack) & np.isfinite(gap)
    tied, slack = np.where(used[..., None], tied, 0.0), np.where(used, slack, 1.0)
    model = side_by_side(models, tied, slack, run)
    return (
        model,
        np.concatenate([*seen, np.where(used, gap, np.nan)], 1),
        np.pad(read, ((0, 0), (0, len(constraints.spread) + bent.shape[1]))),
    )


def standing(spread: Array) -> StateSpace:
    """Constants of standard deviations spread (constant,), which nothing measures by itself."""
    n = len(spread)
    return StateSpace(
        np.eye(n), np.zeros((n, n)), np.zeros((0, n)), np.zeros((0, 0)), np.zeros(n), np.diag(spread**2)
    )


def widened_prior(prior: LoadPrior, factor: float) -> LoadPrior:
    """The prior of a load with `factor` times its variance, and no axis all but still beside the strongest.

    That an axis holds next to no load a part by itself tells badly, and of several parts the one that claims
    it most would prevail.
    """
    root, kernel = float(np.sqrt(factor)), prior.kernel
    strong = int(kernel.std.argmax())
    fast = COMPARED_AT * kernel.rate[strong]  # where a record still tells them, and a prior begins to
    level = kernel.density(fast * np.ones(1))
    weak = (level < RESOLVED**2 * level[strong]) & (kernel.rate < fast)
    even = kernel.of(np.where(weak, strong, np.arange(3))).scaled(np.where(weak, RESOLVED, 1.0)).scaled(root)
    lines = tuple(replace(line, std=root * line.std) for line in prior.lines)
    return replace(prior.with_kernel(even), lines=lines)


def overlapping_windows(time: int, longest: int) -> Iterator[tuple[slice, slice]]:
    """Stretches of a record to smooth by themselves, and the part of each that is kept.

    >>> [(run.start, run.stop, kept.start, kept.stop) for run, kept in overlapping_windows(500, 300)]
    [(0, 300, 0, 225), (150, 450, 225, 375), (300, 500, 375, 500)]
    """
    if time <= longest:
        yield slice(0, time), slice(0, time)
        return
    start, kept, margin = 0, 0, longest // 4
    while kept < time:
        stop = min(start + longest, time)
        until = stop if stop == time else stop - margin
        yield slice(start, stop), slice(kept, until)
        start, kept = until - margin, until


def side_by_side(models: list[StateSpace], rows: Array, slack: Array, run: slice) -> StateSpace:
    """The models of the parts as one over the samples of `run`, with rows (time, row, state) of balances."""
    step, count = slice(run.start, run.stop - 1), run.stop - run.start
    spans = {"F": step, "Q": step, "R": run}
    F, Q, R = ([during(getattr(m, name), when, 3) for m in models] for name, when in spans.items())
    x0, P0 = np.concatenate([m.x0 for m in models]), block_diag(*[m.P0 for m in models])
    u, C = np.zeros((count - 1, len(x0))), sum(m.H.shape[-2] for m in models)
    H = np.zeros((count, C + rows.shape[1], len(x0)))
    at = low = 0
    for model in models:
        c, n = model.H.shape[-2:]
        H[:, low : low + c, at : at + n] = during(model.H, run, 3)
        if model.u is not None:
            u[:, at : at + n] = during(model.u, step, 2)
        at, low = at + n, low + c
    H[:, C:] = rows
    R.append(slack[:, :, None] * np.eye(rows.shape[1]))
    return StateSpace(block_diagonal(*F), block_diagonal(*Q), H, block_diagonal(*R), x0, P0, u)


def during(a: Array, run: slice, axes: int) -> Array:
    """What holds over `run` of an array that may have an axis of time before its last axes."""
    return a[run] if a.ndim == axes and len(a) > 1 else a
