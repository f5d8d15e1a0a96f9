"""The flights of the parts of a body smoothed together, under the loads that the joints pass between them.

Each part by itself claims an error that is half noise and half load smoothed away. The noise of two parts is
independent, the load between them is one and the same: averaged as if independent, their wrenches claim too
little. So the poses and momenta of all parts stand side by side with the loads of the links, each of which
moves all parts that it acts on, and rows hold what the joints keep of the poses, beside what bending moves
them by. Source: principal equations 2.8, 4f, 4h.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from forceid.errors import EstimationError
from forceid.estimation.joints.bending import Bending
from forceid.estimation.joints.constraints import Constraints
from forceid.estimation.joints.link_loads import LinkLoad, load_steps
from forceid.estimation.loads.ascent import bfgs_maximum
from forceid.estimation.methods.problem import Solution
from forceid.flight.channels import FLIGHT_SAMPLES, middle
from forceid.flight.model import (
    Flight,
    Reference,
    added_moment,
    flexed,
    linear_flight,
    translation,
    turn_step,
)
from forceid.kalman.building.line_search import ROOM
from forceid.kalman.building.process import block_diagonal
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array

BEGINNING = 8  # samples that tell where parts begin
SIZE_OF_BENDING = 4  # among the numbers that are tuned: level and rate of forces, of moments, of bending
DOUBLED = 8  # times at most: joints of parts that bend by so much more hold next to nothing
ABOUT = 0.1  # of a logarithm: to which a standard error is found
OWN = 12  # states of a part without its loads: mass center, momentum, rotation error, angular momentum


@dataclass(frozen=True)
class LinkedPart:
    """A part along the flight it was smoothed to by itself, without its loads: the states of the mass center,
    its momentum, the rotation error and the angular momentum first, those of modes and of errors behind.

    seen (time, channel): what the model measures; to_Y, to_H (step, state, 6): what the second and the first
    integral of a wrench about the center over a step does to the states.
    """

    flight: Flight
    reference: Reference
    model: StateSpace
    seen: Array
    to_Y: Array
    to_H: Array


@dataclass(frozen=True)
class LinkedFlight:
    """Parts, the loads of their links, and what holds the parts together.

    unplaced (time, part): variance of the moment about a center as the place of a load is not known, N2 m2.
    """

    parts: Sequence[LinkedPart]
    loads: Sequence[LinkLoad]
    constraints: Constraints
    unplaced: Array

    def moved(self, by: Array) -> LinkedFlight:
        """The same with its loads moved, for a search."""
        return replace(self, loads=[load.moved(by) for load in self.loads])


def linked_parts(solutions: list[Solution | None]) -> list[LinkedPart]:
    """Solved parts, ready to be smoothed together; none where one of them was not smoothed."""
    found = [None if solution is None else linked_part(solution) for solution in solutions]
    kept = [part for part in found if part is not None]
    return kept if len(kept) == len(solutions) else []


def linked_part(solution: Solution) -> LinkedPart | None:
    """A part that was smoothed; None for one that was not, or has no moment."""
    smoothing, reference = solution.smoothing, solution.state.reference
    if smoothing is None or reference is None or "moment" not in smoothing.priors:
        return None
    own = smoothing.flight
    flight, step = flexed(own, reference), np.diff(own.time)
    force = replace(smoothing.priors["force"].plain(), axes=np.eye(3))
    center = first_states(translation(flight, force))
    F = reference.moment.chain(step, reference.rotation, own.time[0])[0]
    turn = turn_step(flight, reference, *added_moment(reference.moment, F, reference.chain))
    G, u = np.zeros((len(step), 6, 6)), np.zeros((len(step), 6))
    G[:, :3, :3], G[:, :3, 3:], G[:, 3:, 3:] = turn.d_theta, turn.by_H, np.eye(3)
    u[:, :3] = turn.offset
    P0 = np.diag(np.repeat([1.0, reference.moment.start.first], 3))  # rad2: as good as unknown
    turning = StateSpace(G, np.zeros_like(G), np.eye(3, 6), flight.pose_cov[:, 3:, 3:], np.zeros(6), P0, u)
    prior = smoothing.priors["moment"]
    model, seen = linear_flight(own, force, prior, reference, (center, turning))
    to_Y, to_H = (np.zeros((len(step), len(model.x0), 6)) for _ in range(2))
    to_Y[:, :3, :3], to_H[:, 3:6, :3] = np.eye(3) / flight.mass, np.eye(3)
    to_Y[:, 6:9, 3:], to_H[:, 6:9, 3:], to_H[:, 9:12, 3:] = turn.by_Y, turn.by_more, np.eye(3)
    return LinkedPart(flight, reference, model, seen, to_Y, to_H)


def first_states(model: StateSpace, count: int = 6) -> StateSpace:
    """A model whose first states the others only push, without these."""
    own = slice(0, count)
    F, u = model.F[..., own, own], model.u
    assert u is not None
    return StateSpace(
        F, np.zeros(F.shape), model.H[..., own], model.R, model.x0[own], model.P0[own, own], u[:, own]
    )


def tuned_linked(
    flight: LinkedFlight, engine: Engine, near: Array
) -> tuple[LinkedFlight, Bending, float, Array]:
    """The loads and the bending of the joints under which all parts and their constraints are likeliest; how
    likely.

    The sizes and the rates of all forces move together, those of all moments, and those of all bending. How
    likely: the markers, given the constraints, and where the parts begin; that these hold is likelier the
    smaller the loads, and tells nothing of them. Bending is taken as large as the markers let it be by a
    standard error: what is believed too still holds the joints, and all that they pass, too well. near (6,):
    from where the search begins, as logarithms; last, where it ended.
    """
    start, tied = bending_of(flight), flight.constraints.gap.shape[1]
    run = middle(len(flight.constraints.gap), FLIGHT_SAMPLES)

    def likely(by: Array) -> float:
        model, z, _ = linked_model(flight.moved(by), start.moved(by[4:]), run)
        begun = z.copy()
        begun[BEGINNING:, : z.shape[1] - tied] = np.nan
        try:
            return float(engine.log_likelihood(model, z)) - float(engine.log_likelihood(model, begun))
        except EstimationError:  # numbers so far off that a covariance loses its sign
            return -np.inf

    bends = bool(start.std.any())
    free = np.array([0, 1] + [2, 3] * any(not load.force for load in flight.loads) + [4, 5] * bends)
    spread = np.eye(6)[free]
    best = bfgs_maximum(lambda by: likely(by @ spread), near[free]) @ spread
    highest = likely(best)
    bending = start.moved(as_far(likely, best, highest)[4:]) if bends else start
    return flight.moved(best), bending, highest, best


def bending_of(flight: LinkedFlight) -> Bending:
    """Bending as fast as the forces in the links, before its size and rate are tuned."""
    kernels = [load.kernel for load in flight.loads if load.force]
    rate = np.exp(np.mean([np.log(k.rate[k.std.argmax()]) for k in kernels]))
    return Bending(flight.constraints.bends, float(rate))


def as_far(likely: Callable[[Array], float], best: Array, highest: float) -> Array:
    """The maximum at `best` (6,) with bending so large that it is half a unit less likely: a standard error.

    Where no bending is likelier than any, that is as far as noise hides it.
    """

    def lower(by: float) -> float:
        return likely(best + by * np.eye(6)[SIZE_OF_BENDING]) - highest + 0.5

    far = next((by for by in np.log(2.0) * np.arange(1, DOUBLED) if lower(by) < 0), None)
    by = np.log(2.0) * DOUBLED if far is None else brentq(lower, far - np.log(2.0), far, xtol=ABOUT)
    return np.asarray(best + by * np.eye(6)[SIZE_OF_BENDING])


def smooth_linked(flight: LinkedFlight, bending: Bending, engine: Engine) -> tuple[Array, Array]:
    """Wrenches (time, part, 6) about the mass centers, and their covariance (time, part * 6, part * 6)."""
    time, size = len(flight.constraints.gap), 6 * len(flight.parts)
    wrench, cov = np.empty((time, size)), np.empty((time, size, size))
    states = linked_model(flight, bending, slice(0, 2))[2].shape[-1]
    for run, kept in overlapping_windows(time, max(FLIGHT_SAMPLES, ROOM // 5 // states**2)):
        model, z, read = linked_model(flight, bending, run)
        path = engine.smooth(model, z)
        inner = slice(kept.start - run.start, kept.stop - run.start)
        read = read[inner]
        wrench[kept] = np.einsum("tws,ts->tw", read, path.x[inner])
        cov[kept] = read @ path.P[inner] @ read.mT
    return wrench.reshape(time, len(flight.parts), 6), cov


def linked_model(flight: LinkedFlight, bending: Bending, run: slice) -> tuple[StateSpace, Array, Array]:
    """All parts under their loads and constraints over samples `run`: model, what it measures, and rows
    (time, part * 6, state) that read the wrenches.
    """
    clock, tied = flight.parts[0].flight.time, flight.constraints
    step, count = slice(run.start, run.stop - 1), run.stop - run.start
    beside = [standing(tied.spread), bending.model(np.diff(clock))]
    each = [cut(part.model, run) for part in flight.parts] + [cut(model, run) for model in beside]
    loads = load_steps(flight.loads, np.diff(clock)[step])
    on = np.concatenate([load.on_parts[run] for load in flight.loads], 2)
    parts = sum(len(part.model.x0) for part in flight.parts)
    F = block_diagonal(*(m.F for m in each), loads.F)
    Q = block_diagonal(*(m.Q for m in each), loads.Q)
    own, driven = slice(0, parts), slice(F.shape[-1] - loads.F.shape[-1], F.shape[-1])
    by_Y, by_H = (
        np.concatenate(
            [
                getattr(part, name)[step] @ half(on[:, 6 * k : 6 * k + 6])
                for k, part in enumerate(flight.parts)
            ],
            1,
        )
        for name in ("to_Y", "to_H")
    )
    by = np.stack([by_Y, by_H], 3)  # step, state, axis, integral
    wide = np.einsum("tnai,tiak->tnak", by, np.stack([loads.Y, loads.H], 1)).reshape(count - 1, parts, -1)
    noise = np.einsum("tnai,taij->tnaj", by, loads.noise)
    F[:, own, driven] = wide
    Q[:, own, own] += np.einsum("tnai,tmai->tnm", noise, by)
    Q[:, own, driven] = np.einsum("tnai,taik->tnak", by, loads.beside).reshape(count - 1, parts, -1)
    Q[:, driven, own] = Q[:, own, driven].swapaxes(1, 2)
    at = 0
    for k, part in enumerate(flight.parts):
        turning = slice(at + OWN - 3, at + OWN)
        lost = np.nan_to_num(flight.unplaced[step, k]) * np.diff(clock)[step] ** 2
        Q[:, turning, turning] += lost[:, None, None] * np.eye(3)
        at += len(part.model.x0)
    read = np.zeros((count, on.shape[1], F.shape[-1]))
    read[:, :, driven] = on @ loads.rows
    model, z = with_constraints(flight, bending, each, (F, Q, loads.P0), read, run)
    return model, z, read


def with_constraints(
    flight: LinkedFlight,
    bending: Bending,
    each: Sequence[StateSpace],
    loads: tuple[Array, Array, Array],
    read: Array,
    run: slice,
) -> tuple[StateSpace, Array]:
    """The model of parts, constants, bending and loads in a row, and what it measures: markers, then rows
    that hold. loads: F and Q of all states, P0 of the loads; read (time, part * 6, state): the wrenches.
    """
    F, Q, P0 = loads
    tied, size, count = flight.constraints, F.shape[-1], run.stop - run.start
    starts = np.cumsum([0, *(len(m.x0) for m in each)])
    channels = [m.H.shape[-2] for m in each]
    H = np.zeros((count, sum(channels) + tied.gap.shape[1], size))
    moved_by, low = np.zeros((9 * len(flight.parts), size)), 0
    for k, (model, at) in enumerate(zip(each, starts, strict=False)):
        H[:, low : low + channels[k], at : at + len(model.x0)] = model.H
        low += channels[k]
        if k < len(flight.parts):
            for rows, states in ((0, 0), (3, 6), (6, 9)):  # center, rotation error, angular momentum
                moved_by[9 * k + rows : 9 * k + rows + 3, at + states : at + states + 3] = np.eye(3)
    constants, bent = (slice(starts[-3 + i], starts[-2 + i]) for i in (0, 1))
    held = tied.on_wrench[run] @ read + tied.on_motion[run] @ moved_by
    held[..., constants] += tied.offset[run]
    held[..., bent] += bending.rows
    slack, gap = tied.slack[run], tied.gap[run]
    used = np.isfinite(held).all(2) & np.isfinite(slack) & np.isfinite(gap)
    H[:, low:] = np.where(used[..., None], held, 0.0)
    R = block_diagonal(*(m.R for m in each), np.where(used, slack, 1.0)[:, :, None] * np.eye(gap.shape[1]))
    u = np.zeros((count - 1, size))
    for model, at in zip(each, starts, strict=False):
        if model.u is not None:
            u[:, at : at + len(model.x0)] = model.u
    x0 = np.concatenate([*(m.x0 for m in each), np.zeros(len(P0))])
    whole = StateSpace(F, Q, H, R, x0, block_diag(*(m.P0 for m in each), P0), u)
    z = np.concatenate([*(part.seen[run] for part in flight.parts), np.where(used, gap, np.nan)], 1)
    return whole, z


def half(a: Array) -> Array:
    """Values (time - 1, ...) halfway between samples (time, ...)."""
    return 0.5 * (a[1:] + a[:-1])


def standing(spread: Array) -> StateSpace:
    """Constants of standard deviations spread (constant,), which nothing measures by itself."""
    n = len(spread)
    return StateSpace(
        np.eye(n), np.zeros((n, n)), np.zeros((0, n)), np.zeros((0, 0)), np.zeros(n), np.diag(spread**2)
    )


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


def cut(model: StateSpace, run: slice) -> StateSpace:
    """A model over the samples of `run` alone."""
    step, u = slice(run.start, run.stop - 1), model.u
    return replace(
        model, F=during(model.F, step, 3), Q=during(model.Q, step, 3), H=during(model.H, run, 3),
        R=during(model.R, run, 3), u=None if u is None else during(u, step, 2),
    )  # fmt: skip


def during(a: Array, run: slice, axes: int) -> Array:
    """What holds over `run` of an array that may have an axis of time before its last axes."""
    return a[run] if a.ndim == axes and len(a) > 1 else a
