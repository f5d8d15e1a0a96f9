"""Measurements that nothing else agrees with: found by their innovations, taken out, and named.

A wild sample spoils the innovations after it as well, so of each run of wild ones only the first is taken
out, in its worst channel, and the filter asked again. What stays wild however many are taken out is no
error of the measurement but a motion that the model does not follow: then nothing is taken out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from forceid.kalman.engines import engine as engine_called
from forceid.kalman.model import StateSpace, as_channels
from forceid.records import Array, Flags
from forceid.significance import OUTLIER, WILD

WILD_SHARE = 0.02  # part of a record that may be wild
BURST = 8  # samples: what is off for longer has moved, and within it one wild one makes others wild


Reason = Literal["isolated", "burst", "step", "swapped"]


@dataclass(frozen=True)
class Rejection:
    """One sample of one channel (or marker): how wild it is in standard deviations, and what it looks like.

    isolated: its neighbors agree with the rest; burst: one of a short run; step: the first of a run that does
    not end, which is kept, being motion or a channel that slipped; swapped: two markers that traded places.
    """

    sample: int
    channel: int
    sigma: float
    reason: Reason


def reject(model: StateSpace, z: Array, engine: str = "auto") -> tuple[Array, tuple[Rejection, ...]]:
    """Measurements z (time, channel) without their wild samples (NaN there), and what was taken out.

    Raises EstimationError where an innovation covariance is not positive definite.

    >>> z = np.random.default_rng(0).standard_normal(50)
    >>> z[20] = 30.0
    >>> still = StateSpace(np.eye(1), 0 * np.eye(1), np.eye(1), np.eye(1), np.zeros(1), np.eye(1))
    >>> cleaned, found = reject(still, z)
    >>> bool(np.isnan(cleaned[20, 0])), [(r.sample, r.reason) for r in found]
    (True, [(20, 'isolated')])
    """
    z, run = as_channels(z), engine_called(engine).filter
    innovation = run(model, z).innovation
    size = np.abs(innovation)

    def again(dropped: Flags) -> Array:
        return np.asarray(run(model, np.where(dropped, np.nan, z)).innovation)

    dropped, ended = drop_wild(innovation, again)
    if not ended:
        k = int(np.argmax((size > WILD).any(1)))
        return z, tuple(
            Rejection(k, int(c), float(size[k, c]), "step") for c in np.flatnonzero(size[k] > WILD)
        )
    found = []
    for c in range(z.shape[1]):
        for first, length in runs(dropped[:, c]):
            reason: Reason = "isolated" if length == 1 else "burst"
            for k in range(first, first + length):
                found.append(Rejection(k, c, float(np.nan_to_num(size[k, c])), reason))
    return np.where(dropped, np.nan, z), tuple(sorted(found, key=lambda r: (r.sample, r.channel)))


def drop_wild(
    innovation: Array, again: Callable[[Flags], Array], before: Flags | None = None
) -> tuple[Flags, bool]:
    """Samples (time, channel) to drop so that none is wild, and whether that came to an end.

    innovation (time, channel): whitened, of all samples; again(dropped): the same without some. It ends if
    few enough are dropped, and no run of them is longer than BURST; with those dropped `before`.
    """
    dropped = np.zeros(innovation.shape, bool) if before is None else before.copy()
    most = max(2, WILD_SHARE * len(innovation))
    while (size := np.abs(np.nan_to_num(innovation))).max(initial=0.0) > WILD:
        wild = np.flatnonzero((size > WILD).any(1))
        first = wild[np.diff(wild, prepend=-BURST - 1) > BURST]
        dropped[first, size[first].argmax(1)] = True
        longest = max((n for column in dropped.T for _, n in runs(column)), default=0)
        if dropped.any(1).sum() > most or longest > BURST:
            return dropped, False
        innovation = again(dropped)
    return dropped, True


def runs(flag: Flags) -> list[tuple[int, int]]:
    """Start and length of every run of true entries."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flag.astype(int), [0]])))
    return [(int(a), int(b - a)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def unswap(position: Array, among: Flags | None = None) -> tuple[Array, tuple[Rejection, ...]]:
    """Marker tracks (time, node, 3) with traded places undone, and the frames at which two markers traded.

    Each frame is predicted from the two before it. Two markers that are both far from where they should be,
    and near to where the other one should be, have traded places: they are traded back from there on, until
    they trade again. Gaps stay gaps; the prediction starts anew behind them. among (node, node): pairs that
    may have, all where it is not given.
    """
    x, found = position.copy(), []
    off = np.linalg.norm(x[2:] - 2 * x[1:-1] + x[:-2], axis=2)  # of frames 2 and on
    if x.shape[1] < 2 or not np.isfinite(off).any():
        return x, ()
    typical = max(float(np.nanmedian(off)), float(np.finfo(float).eps * np.nanmax(np.abs(x))))
    for k in np.flatnonzero((off > 3 * OUTLIER * typical).sum(1) >= 2) + 2:
        expected = 2 * x[k - 1] - x[k - 2]
        away = np.linalg.norm(x[k][None] - expected[:, None], axis=2)  # (expected, seen)
        for i, j in combinations(np.flatnonzero(np.diag(away) > 3 * OUTLIER * typical), 2):
            may = among is None or among[i, j]
            if may and max(away[i, j], away[j, i]) < OUTLIER * typical:
                x[k:, [i, j]] = x[k:, [j, i]]
                found += [Rejection(int(k), int(m), float(away[m, m] / typical), "swapped") for m in (i, j)]
    return x, tuple(found)
