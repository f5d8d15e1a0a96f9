"""Loads over every step of a clock: exact at a few steps of its range, and by a polynomial between."""

from __future__ import annotations

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from scipy.special import gammaln

from forceid.kalman.building.process import Diffusion, Process, discretize
from forceid.records import Array
from forceid.rounding import ITERATIONS

RANGES_IN_OCTAVE = 2  # ranges of steps: over one, noise that grows by h^16 keeps fourteen digits of its own


def discretize_steps(process: Diffusion, step: Array) -> tuple[Array, Array]:
    """Transition F and noise covariance Q (step, ..., state, state) of a process over steps (step,) s.

    process: A, Qc (..., state, state). As exact as `discretize`, for many steps at once: a clock with jitter
    has as many as frames. F and Q are entire functions of the step, so a polynomial through Chebyshev points
    of a short range has them to rounding. Source: Trefethen (2013), Approximation theory, 8.
    """
    lead = process.A.ndim - 2
    process = Process(process.A[None], process.Qc[None], process.P0, process.P0)

    def exactly(h: Array) -> tuple[Array, Array]:
        return discretize(process, h.reshape(-1, *[1] * lead))

    if len(step) <= ITERATIONS:
        return exactly(step)
    # a step of no length stands by itself
    part = np.where(step > 0, np.frexp(step**RANGES_IN_OCTAVE)[1], np.iinfo(np.int32).min)
    bounds = [(step[part == k].min(), step[part == k].max(), part == k) for k in np.unique(part)]
    fastest = float(np.abs(np.linalg.eigvals(process.A.real)).max(initial=0.0))
    powers = 2 * process.A.shape[-1]
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
