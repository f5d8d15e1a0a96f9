"""Parts, what holds them together and the loads of their links as one linear model.

Sizes and rates of the loads, and of bending, enter a few blocks of it. A search that moves these writes these
blocks anew and keeps the rest. Source: principal equations 2.8, 4f, 4h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from forceid.estimation.joints.bending import Bending
from forceid.estimation.joints.link_loads import LinkLoad, load_steps
from forceid.estimation.joints.linked_flight import OWN, LinkedFlight, LinkedPart
from forceid.kalman.building.process import block_diagonal
from forceid.kalman.model import StateSpace
from forceid.records import Array, all_finite


@dataclass(frozen=True)
class LinkedModel:
    """All parts under their loads and constraints over a run of samples: model, what it measures, and rows
    (time, part * 6, state) that read the wrenches.

    step (step,) s; push, one of each load (step, state, axis, 2): what its second and first integrals do to
    the states of the parts, which come first; quiet (step, state, state): Q of these without the loads.
    Behind them stand constants, then the states of bending, then those of each load, `driven`.
    """

    model: StateSpace
    z: Array
    read: Array
    step: Array
    push: Sequence[Array]
    quiet: Array
    bent: slice
    driven: Sequence[slice]

    def under(self, loads: Sequence[LinkLoad], bending: Bending) -> StateSpace:
        """The model with other kernels of the loads, of the same orders, and other bending, written over the
        one before.
        """
        F, Q, P0, own = self.model.F, self.model.Q, self.model.P0, slice(0, self.quiet.shape[-1])
        Q[:, own, own] = self.quiet
        for load, by, driven in zip(loads, self.push, self.driven, strict=True):
            steps, shape = load_steps(load, self.step), (*by.shape[:2], -1)
            by_Y, by_H = by[..., :1], by[..., 1:]
            F[:, own, driven] = (by_Y * steps.Y[:, None] + by_H * steps.H[:, None]).reshape(shape)
            beside = by_Y * steps.beside[:, None, :, 0] + by_H * steps.beside[:, None, :, 1]
            Q[:, own, driven] = beside.reshape(shape)
            Q[:, driven, own] = Q[:, own, driven].mT
            noise = np.stack([(by * steps.noise[:, None, :, k]).sum(-1) for k in (0, 1)], -1)
            Q[:, own, own] += noise.reshape(shape) @ by.reshape(shape).mT
            size = steps.F.shape[-1]
            for axis, at in enumerate(range(driven.start, driven.stop, size)):
                one = slice(at, at + size)
                F[:, one, one], Q[:, one, one], P0[one, one] = (
                    steps.F[:, axis],
                    steps.Q[:, axis],
                    steps.P0[axis],
                )
        if self.bent.stop > self.bent.start:
            bends = bending.model(self.step)
            F[:, self.bent, self.bent], Q[:, self.bent, self.bent] = bends.F, bends.Q
            P0[self.bent, self.bent] = bends.P0
        return self.model


def linked_model(flight: LinkedFlight, bending: Bending, run: slice) -> LinkedModel:
    """The model over samples `run`."""
    clock, tied = np.diff(flight.parts[0].flight.time), flight.constraints
    step, count = slice(run.start, run.stop - 1), run.stop - run.start
    beside = [standing(tied.spread), bending.model(clock)]
    each = [cut(part.model, run) for part in flight.parts] + [cut(model, run) for model in beside]
    each_load = [load.rows.shape[1] for load in flight.loads]
    starts = np.cumsum([0, *(len(m.x0) for m in each), *each_load])
    parts, size = int(starts[len(flight.parts)]), int(starts[-1])
    blank = np.zeros((count - 1, *[sum(each_load)] * 2))
    F, Q = (block_diagonal(*(getattr(m, name) for m in each), blank) for name in "FQ")
    for k, at in enumerate(starts[: len(flight.parts)]):
        turning = slice(at + OWN - 3, at + OWN)
        lost = np.nan_to_num(flight.unplaced[step, k]) * clock[step] ** 2
        Q[:, turning, turning] += lost[:, None, None] * np.eye(3)
    read, push, driven = np.zeros((count, 6 * len(flight.parts), size)), list[Array](), list[slice]()
    for load, at, states in zip(flight.loads, starts[len(each) :], each_load, strict=False):
        driven.append(slice(int(at), int(at) + states))
        read[:, :, driven[-1]] = load.on_parts[run] @ load.rows
        push.append(pushed(flight.parts, load.on_parts[run], step))
    model, z = with_constraints(flight, bending, each, (F, Q), read, run)
    quiet, bent = Q[:, :parts, :parts].copy(), slice(int(starts[len(each) - 1]), int(starts[len(each)]))
    found = LinkedModel(model, z, read, clock[step], push, quiet, bent, driven)
    found.under(flight.loads, bending)
    return found


def pushed(parts: Sequence[LinkedPart], on: Array, step: slice) -> Array:
    """What second and first integral of a load do to the parts (step, state, axis, 2); on (time, part * 6,
    axis): what a unit of it does at the samples at the ends of the steps.
    """
    by = [
        [getattr(part, name)[step] @ half(on[:, 6 * k : 6 * k + 6]) for k, part in enumerate(parts)]
        for name in ("to_Y", "to_H")
    ]
    return np.stack([np.concatenate(each, 1) for each in by], 3)


def with_constraints(
    flight: LinkedFlight,
    bending: Bending,
    each: Sequence[StateSpace],
    steps: tuple[Array, Array],
    read: Array,
    run: slice,
) -> tuple[StateSpace, Array]:
    """The model of parts, constants, bending and loads in a row, and what it measures: markers, then rows
    that hold. steps: F and Q of all states; read (time, part * 6, state): the wrenches.
    """
    F, Q = steps
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
    used = all_finite(held) & np.isfinite(slack) & np.isfinite(gap)
    H[:, low:] = np.where(used[..., None], held, 0.0)
    R = block_diagonal(*(m.R for m in each), np.where(used, slack, 1.0)[:, :, None] * np.eye(gap.shape[1]))
    u = np.zeros((count - 1, size))
    for model, at in zip(each, starts, strict=False):
        if model.u is not None:
            u[:, at : at + len(model.x0)] = model.u
    known = int(starts[-1])
    x0 = np.concatenate([*(m.x0 for m in each), np.zeros(size - known)])
    P0 = block_diag(*(m.P0 for m in each), np.zeros((size - known, size - known)))
    z = np.concatenate([*(part.seen[run] for part in flight.parts), np.where(used, gap, np.nan)], 1)
    return StateSpace(F, Q, H, R, x0, P0, u), z


def half(a: Array) -> Array:
    """Values (time - 1, ...) halfway between samples (time, ...)."""
    return 0.5 * (a[1:] + a[:-1])


def standing(spread: Array) -> StateSpace:
    """Constants of standard deviations spread (constant,), which nothing measures by itself."""
    n = len(spread)
    return StateSpace(
        np.eye(n), np.zeros((n, n)), np.zeros((0, n)), np.zeros((0, 0)), np.zeros(n), np.diag(spread**2)
    )


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
