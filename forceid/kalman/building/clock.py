"""Loads over every step of a clock: exact at a few steps of its range, and by a polynomial between."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from scipy.special import gammaln

from forceid.kalman.building.process import Diffusion, Process, discretize
from forceid.records import Array, Flags, Indices
from forceid.rounding import ITERATIONS

ONE_LOAD = 9  # states of the chain of the smoothest load, alone: in more there are lines, or colored errors
RANGES_IN_OCTAVE = 2  # ranges of steps: over one, noise that grows by h^16 keeps fourteen digits of its own


def discretize_steps(process: Diffusion, step: Array) -> tuple[Array, Array]:
    """Transition F and noise covariance Q (step, ..., state, state) of a process over steps (step,) s.

    process: A, Qc (..., state, state). As exact as `discretize`, for many steps at once: a clock with jitter
    has as many as frames. What drives the same integrals by itself, as a load and each of its lines do, goes
    by itself, and models that have it alike share it.
    """
    A, Qc = np.broadcast_arrays(process.A, process.Qc)
    if A.shape[-1] <= ONE_LOAD and len(step) <= ITERATIONS:
        return over_a_clock(A, Qc, step)
    parts = driven_apart(A, Qc)
    if len(parts) < 2:
        return each_kind_once(A, Qc, step)
    F, Q = (np.zeros((len(step), *A.shape), a.dtype) for a in (A, Qc))
    for own in parts:
        among = (..., own[:, None], own)
        F_own, Q_own = each_kind_once(A[among], Qc[among], step)
        for (at, rows), (to, columns) in product(in_a_row(own), repeat=2):
            F[..., at, to] = F_own[..., rows, columns]
            if Q_own[..., rows, columns].any():
                Q[..., at, to] += Q_own[..., rows, columns]
    return F, Q


def in_a_row(own: Indices) -> list[tuple[slice, slice]]:
    """Runs of states in a row among those of a part (state,): where they are in all, and in the part."""
    cut = np.flatnonzero(np.diff(own) > 1) + 1
    return [(slice(own[a], own[b - 1] + 1), slice(a, b)) for a, b in pairwise([0, *cut.tolist(), len(own)])]


def driven_apart(A: Array, Qc: Array) -> list[Indices]:
    """States of each part of x' = A x + w that nothing else moves, with all that it moves.

    Constants go along with the first. One part where noise reaches across parts, or what several move.
    """
    n, lead = A.shape[-1], tuple(range(A.ndim - 2))
    moving: Flags = np.any(A != 0, lead)
    shaken: Flags = np.any(Qc != 0, lead)
    moved = moving | np.eye(n, dtype=bool)  # i by j
    for _ in range(n.bit_length()):
        moved = moved.astype(float) @ moved > 0
    first = [
        j for j in range(n) if (moved[:, j] >= moved[j]).all() and not (moved[j, :j] & moved[:j, j]).any()
    ]
    still: Flags = ~np.any((moving | shaken)[first], axis=1)
    if still.all():
        return [np.arange(n)]
    by = moved[:, first][:, ~still]
    by[:, :1] |= np.any(moved[:, first][:, still], axis=1, keepdims=True)
    mover, several = by.argmax(1), by.sum(1) > 1
    if shaken[several].any() or (shaken & (mover[:, None] != mover)).any():
        return [np.arange(n)]
    return [np.flatnonzero(own) for own in by.T]


def each_kind_once(A: Array, Qc: Array, step: Array) -> tuple[Array, Array]:
    """The same, with models (..., state, state) that differ by the power of their noise alone as one."""
    lead, n = A.shape[:-2], A.shape[-1]
    power = np.abs(Qc).max((-2, -1), keepdims=True, initial=0.0)
    unit = Qc / np.where(power > 0, power, 1.0)
    both = np.concatenate([A, unit], -2).reshape(-1, 2 * n * n) + 0.0  # of one zero, without its sign
    place: dict[bytes, int] = {}
    kind = [place.setdefault(row.tobytes(), len(place)) for row in both]
    first = np.unique(kind, return_index=True)[1]
    found = over_a_clock(A.reshape(-1, n, n)[first], unit.reshape(-1, n, n)[first], step)
    F, Q = (a[:, kind].reshape(-1, *lead, n, n) for a in found)
    return F, Q * power


def over_a_clock(A: Array, Qc: Array, step: Array) -> tuple[Array, Array]:
    """F and Q of x' = A x + w over steps (step,) s, of many by polynomials.

    F and Q are entire functions of the step, so a polynomial through Chebyshev points of a short range has
    them to rounding. Source: Trefethen (2013), Approximation theory, 8.
    """
    lead = max(A.ndim, Qc.ndim) - 2

    def exactly(h: Array) -> tuple[Array, Array]:
        return discretize(Process(A[None], Qc[None], A, A), h.reshape(-1, *[1] * lead))

    if len(step) <= ITERATIONS:
        return exactly(step)
    # a step of no length stands by itself
    part = np.where(step > 0, np.frexp(step**RANGES_IN_OCTAVE)[1], np.iinfo(np.int32).min)
    bounds = [(step[part == k].min(), step[part == k].max(), part == k) for k in np.unique(part)]
    fastest = float(np.abs(np.linalg.eigvals(A.real)).max(initial=0.0))
    powers = 2 * A.shape[-1]
    nodes, shares = [], []
    for low, high, own in bounds:
        middle, half = 0.5 * (high + low), 0.5 * (high - low)
        most = int(own.sum())
        count = points_for(half * (fastest + powers / middle), most) if half > 0 else 1
        if count >= most:
            nodes.append(step[own])
            shares.append((own, np.eye(most)))
            continue
        at = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        through = chebvander(at, count - 1).T * 2 / count
        through[0] /= 2
        nodes.append(middle + half * at)
        off = (step[own] - middle) / half if half > 0 else 0.0 * step[own]  # steps may all be alike
        shares.append((own, chebvander(off, count - 1) @ through))
    found = exactly(np.concatenate(nodes))
    F, Q = (np.empty((len(step), *a.shape[1:]), a.dtype) for a in found)
    ends = np.cumsum([len(h) for h in nodes])
    for (own, share), end in zip(shares, ends, strict=True):
        first = end - share.shape[1]
        for whole, a in ((F, found[0]), (Q, found[1])):
            whole[own] = np.tensordot(share, a[first:end], 1)
    return F, Q


def points_for(bend: float, most: int) -> int:
    """Chebyshev points that exp(bend x), |x| <= 1, takes to rounding, `most` if it takes so many."""
    if bend == 0:
        return 1
    count = np.arange(1, most)
    left = np.log(2) + count * np.log(bend / 2) - gammaln(count + 1)
    enough = left <= np.log(np.finfo(float).eps) - bend
    return int(count[enough][0]) if enough.any() else most
