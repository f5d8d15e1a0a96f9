"""Markers that are lost for some samples, bridged by their own smooth motion relative to their neighbors.

A lost marker moves on beside its neighbors: on the rigid body those spanned by three or more of them make, or
with their mean where that is all there is, or by itself. Its position in such a frame is continued by
polynomials of time from the samples on both sides. Which frame, how many samples and which degree is no
choice of ours: gaps of the same length are made where the marker is seen, and the bridge that fills those
best is taken. What it missed there is the error that it is claimed with, and more where a frame of other
markers tells the place less well. Where many markers are lost, all bridges are tried at some of them, and at
the others those that were best there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

import numpy as np

from forceid.estimation.body.tracks.neighbor_frames import TO_TURN, frame_of, lever_of, neighbors, weights
from forceid.kalman.tuning.robust import runs
from forceid.records import Array, Flags, Indices, all_finite
from forceid.rounding import SINGLE

TRIALS = 16  # gaps made to judge a bridge: its mean square is known to a third
LENGTH_RATIO = 1.5  # ratio of two lengths of gaps that are judged apart
NEIGHBORS = (0, 1, 3, 4, 6)  # that a frame is made of, and all of them: three are the fewest that turn
SIDES = (2, 4, 12, 40, 160)  # samples on either side that a bridge rests on, from the least to a long record
JUDGED = 8  # markers where all bridges are tried: what is best at none of them is rarely best elsewhere
AS_GOOD = 2.0  # times the least mean square, of bridges as good as the best: each is known to a third
FIRST_FEW = 2  # bridges tried at first elsewhere: two orders of a continuation are often as good
DEGREES = (0, 1, 3)  # of its polynomial: held, with the slopes at both ends, with the curvatures


@dataclass(frozen=True)
class Bridged:
    """position (time, node, 3) m with lost readings filled, and error_var (time, node) m2 of those filled.

    error_var: of one coordinate, zero where the marker was seen, NaN where nothing bridges it. Errors of a
    gap follow each other: as noise of one sample they count as often as the gap has samples.
    """

    position: Array
    error_var: Array


def bridged(time: Array, position: Array, nodes: Flags) -> Bridged:
    """Tracks position (time, node, 3) m, NaN = not seen, with the gaps of `nodes` (node,) filled.

    time (time,) s. A sample in which none of these nodes is seen stays empty. The other nodes help.
    """
    seen: Flags = all_finite(position)
    x, var = position.copy(), np.where(seen, 0.0, np.nan)
    some = seen[:, nodes].any(1)
    lost = np.flatnonzero(nodes & seen.any(0) & ~seen[some].all(0)).tolist()
    near = {k: neighbors(position, seen, k) for k in lost}
    step = np.diff(time)
    if np.ptp(step) < SINGLE * np.median(step):  # weights know a time by its place among the others alone
        time = np.arange(len(time), dtype=float)
    judged: dict[tuple[int, int], list[Judged]] = {}
    best: dict[int, list[Judged]] = {}  # of each length, at the markers where all bridges were tried
    by_few: set[tuple[int, int]] = set()  # at which only these were
    # short gaps first: what fills them is seen by its neighbors when theirs are filled; of these the markers
    # first that are judged by all bridges, evenly spread
    judges = {lost[i] for i in np.linspace(0, len(lost) - 1, JUDGED).astype(int)} if lost else set()
    every = sorted((n, k not in judges, k, first) for k in lost for first, n in runs(~seen[:, k] & some))
    for (length, _, k), gaps in groupby(every, lambda one: one[:3]):
        size, (others, moves) = int(np.round(np.log(length) / np.log(LENGTH_RATIO))), near[k]
        beside, found = (x[:, others], seen[:, others], moves), best.setdefault(size, [])
        for first in (one[3] for one in gaps):
            shown, gap = WithNeighbors(time, x[:, k], seen[:, k], *beside), np.arange(first, first + length)
            if (k, size) not in judged and len(found) >= JUDGED:
                ranked = rank_by_few(shown, length, found)
                judged[k, size] = [one for one in ranked if one.missed < AS_GOOD * ranked[0].missed]
                by_few.add((k, size))
            filled = best_filling(judged.get((k, size), []), shown, gap)
            if filled is None and ((k, size) not in judged or (k, size) in by_few):
                judged[k, size] = rank_bridges(shown, length, list(bridges(len(moves))))
                found += [] if (k, size) in by_few else judged[k, size][:1]
                by_few.discard((k, size))
                filled = best_filling(judged[k, size], shown, gap)
            if filled is not None:
                (x[gap, k], var[gap, k]), seen[gap, k] = filled, True
    return Bridged(x, var)


@dataclass(frozen=True)
class Bridge:
    """One way to fill a gap: the number of neighbors of its frame, samples on either side, the degree."""

    count: int
    side: int
    degree: int


class Judged(NamedTuple):
    """A bridge where gaps were made: the mean square (m2) that it missed, and how loose its frames were."""

    missed: float
    loose: float
    way: Bridge


class WithNeighbors(NamedTuple):
    """What a node and its neighbors show: time (time,), x (time, 3) and near (time, neighbor, 3), each with
    when it is seen; moves (neighbor,) m2: variance of their distance.
    """

    time: Array
    x: Array
    seen: Flags
    near: Array
    near_seen: Flags
    moves: Array


def best_filling(ranked: Sequence[Judged], shown: WithNeighbors, gap: Indices) -> tuple[Array, float] | None:
    """Positions (gap, 3) in a gap by the best bridge that has something to rest on; its mean square error.

    That grows where a frame is looser than where the bridge was judged.
    """
    best: tuple[Array, float] | None = None
    for one in ranked:
        if best is not None and best[1] <= one.missed:
            break
        for _, filled, loose in fillings(shown, gap, [one.way]):
            error = one.missed * max(loose / one.loose, 1.0)
            best = (filled, error) if best is None or error < best[1] else best
    return best


def fillings(
    shown: WithNeighbors, gap: Indices, ways: Sequence[Bridge]
) -> Iterator[tuple[Bridge, Array, float]]:
    """Positions (gap, 3) of a node in a gap by each of some bridges that has something to rest on.

    Also how loose its frame is, m2: its lever times how its markers move.
    """
    time, x, seen, near, near_seen, moves = shown
    own = np.flatnonzero(seen)
    own = own[(own < gap[0]) | (own > gap[-1])]
    at = np.searchsorted(own, gap[0])
    # what bridges share is found once: samples and weights those of a side, frames those of a count as well
    for side in sorted({way.side for way in ways}):
        before, after = own[max(0, at - side) : at], own[at : at + side]
        rest = np.concatenate([before, after])
        frames = np.concatenate([rest, gap])
        beside = np.flatnonzero(near_seen[frames].all(0))
        carried: dict[int, tuple[Array, Array, Array, float]] = {}
        weigh: dict[int, Array] = {}
        for way in (w for w in ways if w.side == side):
            degree = way.degree if len(before) and len(after) else 0
            if len(rest) < max(2, degree + 1) and not (degree == 0 and len(rest)):
                continue
            count = min(way.count, len(beside))
            if count < way.count and not (way.count == near.shape[1] and count >= TO_TURN):
                continue
            if degree not in weigh:
                weigh[degree] = weights(time[rest] - time[gap[0]], time[gap] - time[gap[0]], degree)
            if count not in carried:
                frame = near[frames[:, None], beside[:count]]
                origin, R = frame_of(frame, len(frames))
                y = np.einsum("tba,tb->ta", R[: len(rest)], x[rest] - origin[: len(rest)])
                moved = float(moves[beside[:count]].sum()) / count if count else 1.0
                loose = lever_of(frame[0], x[rest[0]]) * moved
                carried[count] = origin[len(rest) :], R[len(rest) :], y, loose
            origin, R, y, loose = carried[count]
            yield way, np.asarray(origin + np.einsum("tab,tb->ta", R, weigh[degree] @ y)), loose


def bridges(neighbors: int) -> Iterator[Bridge]:
    """All ways to fill a gap beside a number of neighbors."""
    for count in sorted({*(n for n in NEIGHBORS if n < neighbors), neighbors}):
        for side in SIDES:
            for degree in DEGREES:
                if 2 * side > degree:
                    yield Bridge(count, side, degree)


def rank_bridges(shown: WithNeighbors, length: int, ways: Sequence[Bridge]) -> list[Judged]:
    """Some ways to bridge gaps of a length of a node, best first."""
    seen, whole = shown.seen, np.flatnonzero(shown.seen)
    count = np.concatenate([[0], np.cumsum(seen)])
    starts = np.flatnonzero(count[length:] - count[:-length] == length)
    if not len(starts):  # it is never seen for so long: gaps that hide what is seen of it
        starts = whole
    starts = starts[np.unique(np.linspace(0, len(starts) - 1, TRIALS).astype(int))]
    made: dict[Bridge, list[tuple[float, float]]] = {way: [] for way in ways}
    for a in starts:
        gap = np.arange(a, min(a + length, len(seen)))
        gap = gap[seen[gap]]
        for way, filled, loose in fillings(shown, gap, list(made)):
            off = filled - shown.x[gap]
            made[way].append((float(np.vdot(off, off)) / off.size, loose))
    means = [(np.mean(each, axis=0).tolist(), way) for way, each in made.items() if each]
    return sorted((Judged(missed, loose, way) for (missed, loose), way in means), key=lambda one: one.missed)


def rank_by_few(shown: WithNeighbors, length: int, best: Sequence[Judged]) -> list[Judged]:
    """The bridges that were best at other nodes, best first: those that were so most often, and all of them
    at a node that these miss by more than usual, as at one which swings.
    """
    often = [way for way, _ in Counter(one.way for one in best).most_common()]
    ranked = rank_bridges(shown, length, often[:FIRST_FEW])
    usual = float(np.median([one.missed for one in best]))
    if ranked and ranked[0].missed < AS_GOOD * usual:
        return ranked
    return sorted([*ranked, *rank_bridges(shown, length, often[FIRST_FEW:])], key=lambda one: one.missed)


def straight(time: Array, known: Array, values: Array) -> Array:
    """Values (sample, ...) known at some times, straight between them."""
    flat = values.reshape(len(values), -1)
    at = np.stack([np.interp(time, known, c) for c in flat.T], 1)
    return np.asarray(at.reshape(len(time), *values.shape[1:]))
