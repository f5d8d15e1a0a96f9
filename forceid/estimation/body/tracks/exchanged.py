"""Markers that a camera has taken for each other: put back by their distances from the markers beside them.

Distances do not feel how a body flies and turns. A marker that is taken for another one is as far from all
others as that one is as a rule. So markers may trade places that are as near as a few times their noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from forceid.estimation.body.tracks.spikes import DROPS, FAR, FEWEST, NORMAL, PARTNERS, median
from forceid.kalman.tuning.robust import Rejection, runs, unswap
from forceid.records import Array, Flags, Indices, all_finite
from forceid.rounding import SOLVED
from forceid.significance import SIGMAS

ALL_OF_PLACE = 6.0  # distances that tell a place whole: each a third of it, by the noise of two markers
SUSPECTS = 4  # markers of a frame that are farthest off: two pairs may have traded at once
SUSPECT = 2.0  # rms deviation of distances that may be of a trade: by markers seven times their noise apart
LOOKED_AT = 64  # markers at most whose pairs are looked at: more take long, and lie too near to each other


def put_back(position: Array, told: Array | None = None) -> tuple[Array, tuple[Rejection, ...]]:
    """Marker tracks (time, node, 3) with exchanged ones put back, and where they traded, two a frame.

    Two markers have traded places in frames in which their distances belong to the other one, and not to
    them, and which begin or end with a jump from the one to the other. Markers that lie alike to all others
    are told apart by how they move, as are those of fewer than four, or more than LOOKED_AT. told (node, 3):
    where they are on the body: a pair that has traded for most of a record is where that says.

    >>> at = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3], [0.1, 0.1, 0.1]])
    >>> x = at + 1e-4 * np.random.default_rng(0).standard_normal((50, 5, 3))
    >>> x[20:25, [1, 4]] = x[20:25, [4, 1]]
    >>> back, found = put_back(x)
    >>> sorted({(one.sample, one.channel) for one in found})
    [(20, 1), (20, 4), (25, 1), (25, 4)]
    """
    shown = np.flatnonzero(all_finite(position).any(0))
    if not FEWEST <= len(shown) <= LOOKED_AT:
        return unswap(position)
    anchors = shown[np.unique(np.linspace(0, len(shown) - 1, PARTNERS).astype(int))]
    apart = measured_from(position, anchors)
    usual, steps = median(apart[None])[0], median(np.abs(np.diff(apart, axis=0))[None])[0]
    scale, least = median(np.abs(apart - usual)[None])[0], SOLVED * np.nan_to_num(apart).max()
    rule = UsualDistances(anchors, usual, np.maximum(NORMAL * scale, least))
    beside = replace(rule, scale=np.maximum(NORMAL * steps, least))
    x, traded, left = position.copy(), dict[tuple[int, int], Flags](), np.arange(len(position))
    now = apart
    for _ in range(DROPS):  # the likeliest pair of each frame first
        found = rule.likeliest(now[left])
        for pair in map(tuple, np.unique(found[found[:, 0] >= 0], axis=0).tolist()):
            at = np.isin(np.arange(len(x)), left[(found == pair).all(1)])
            at = beside.jumping(now, rule.around(now, at, pair), pair)
            exchange(x, at, pair)
            traded[pair] = traded.get(pair, np.zeros(len(x), bool)) ^ at
        left = left[found[:, 0] >= 0]
        if not len(left):
            break
        now = measured_from(x, anchors)
    for pair, at in traded.items():
        if told is not None and rule.belongs_otherwise(told, pair):
            exchange(x, np.ones(len(x), bool), pair)
            traded[pair] = ~at
    named = [
        Rejection(k, m, rule.sigma(apart[first], pair), "swapped")
        for pair, at in traded.items()
        for first, length in runs(at)
        for k in (first, first + length)
        for m in pair
        if k < len(x)
    ]
    x, more = unswap(x, rule.alike(shown))
    return x, tuple(sorted((*named, *more), key=lambda one: (one.sample, one.channel)))


def exchange(x: Array, frames: Flags, pair: tuple[int, int]) -> None:
    """Two markers of tracks (time, node, 3) for each other, in place."""
    i, j = pair
    x[frames, i], x[frames, j] = x[frames, j], x[frames, i].copy()


def measured_from(position: Array, anchors: Indices) -> Array:
    """Distances (time, node, anchor) of markers from anchors, NaN from itself and where one is unseen."""
    found = np.zeros((*position.shape[:2], len(anchors)))
    for axis in range(3):  # one at a time: a third of the memory
        found += (position[:, :, None, axis] - position[:, None, anchors, axis]) ** 2
    found = np.sqrt(found, out=found)
    found[:, anchors, range(len(anchors))] = np.nan
    return np.asarray(found)


@dataclass(frozen=True)
class UsualDistances:
    """What distances (node, anchor) m from anchors (anchor,) are as a rule, and deviate by."""

    anchors: Indices
    usual: Array
    scale: Array

    def off(self, apart: Array, pair: Indices, own: Indices) -> Array:
        """Squared deviations of distances apart (..., 2, anchor) of a pair, from those of the markers `own`.

        A wild one counts as FAR. NaN from anchors of the pair, and where one is unseen.
        """
        square = np.minimum(((apart - self.usual[own]) / self.scale[own]) ** 2, FAR**2)
        square[np.isnan(apart)] = np.nan
        itself = (self.anchors == pair[..., None]).any(-2, keepdims=True)
        return np.where(itself, np.nan, square)

    def gained(self, apart: Array, pair: Indices) -> tuple[Array, Array]:
        """Twice the log-likelihood (...,) that distances gain by a trade, and the middle square after it."""
        numbers = (*apart.shape[:-2], 2 * len(self.anchors))
        stay, trade = (self.off(apart, pair, own).reshape(numbers) for own in (pair, pair[..., ::-1]))
        count = np.isfinite(stay).sum(-1)
        gained = np.nansum(stay - trade, -1) * np.minimum(1.0, 2 * ALL_OF_PLACE / np.maximum(count, 1))
        middle = median(trade.reshape(-1, numbers[-1])).reshape(count.shape)
        return gained, np.where(count > 0, middle, np.inf)

    def likeliest(self, apart: Array) -> Indices:
        """The pair (time, 2) that most likely traded places in each frame, -1 where none did.

        apart (time, node, anchor) m.
        """
        best, found = np.zeros(len(apart)), np.full((len(apart), 2), -1)
        off = np.minimum(((apart - self.usual) / self.scale) ** 2, FAR**2)
        off = np.nansum(off, 2) / np.maximum(np.isfinite(apart).sum(2), 1)
        several = np.flatnonzero((off > SUSPECT**2).sum(1) >= 2)
        suspects = np.argsort(-off[several], 1, kind="stable")[:, :SUSPECTS]
        for two in combinations(range(suspects.shape[1]), 2):
            pair = np.sort(suspects[:, two], 1)
            gained, middle = self.gained(apart[several[:, None], pair], pair)
            better = (gained > np.maximum(best[several], FAR**2)) & (middle < SIGMAS**2)
            best[several[better]], found[several[better]] = gained[better], pair[better]
        return found

    def around(self, apart: Array, frames: Flags, pair: tuple[int, int]) -> Flags:
        """Frames (time,) of a trade, and those beside them in which it is likelier than not."""
        may = frames | (self.gained(apart[:, list(pair)], np.array(pair))[0] > 0)
        run = np.cumsum(np.diff(may, prepend=False))
        return np.isin(run, run[frames])

    def jumping(self, apart: Array, frames: Flags, pair: tuple[int, int]) -> Flags:
        """Of frames (time,), those in runs that begin or end with a jump of distances."""
        out, both = frames.copy(), list(pair)
        seen = np.flatnonzero(np.isfinite(apart[:, both]).any(axis=2).sum(axis=1) == len(both))
        for first, length in runs(frames):
            ends = [(first, seen[seen < first][-1:]), (first + length - 1, seen[seen >= first + length][:1])]
            jumps = [
                replace(self, usual=apart[other[0]]).gained(apart[k, both], np.array(pair))[0] > FAR**2
                for k, other in ends
                if len(other)
            ]
            out[first : first + length] = any(jumps)
        return out

    def alike(self, shown: Indices) -> Flags:
        """Pairs (node, node) of the markers shown that no distance tells apart."""
        pair = np.stack(np.meshgrid(shown, shown, indexing="ij"), -1)
        found = np.zeros((len(self.usual), len(self.usual)), bool)
        found[np.ix_(shown, shown)] = self.gained(self.usual[pair[..., ::-1]], pair)[0] <= FAR**2
        return found

    def belongs_otherwise(self, told: Array, pair: tuple[int, int]) -> bool:
        """Whether places told (node, 3) belong to a pair the other way round."""
        apart = measured_from(told[None], self.anchors)[0]
        return bool(self.gained(apart[list(pair)], np.array(pair))[0] > FAR**2)

    def sigma(self, apart: Array, pair: tuple[int, int]) -> float:
        """Root mean square deviation of the distances (node, anchor) of a pair."""
        return float(np.sqrt(np.nanmean(self.off(apart[list(pair)], np.array(pair), np.array(pair)))))
