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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from forceid.kalman.tuning.robust import runs
from forceid.motion import fit_rotation
from forceid.records import Array, Flags, Indices, all_finite
from forceid.rounding import SINGLE

TRIALS = 16  # gaps made to judge a bridge: its mean square is known to a third
LENGTH_RATIO = 1.5  # ratio of two lengths of gaps that are judged apart
NEIGHBORS = (0, 1, 3, 4, 6)  # that a frame is made of, and all of them: three are the fewest that turn
SIDES = (2, 4, 12, 40, 160)  # samples on either side that a bridge rests on, from the least to a long record
NEAREST = 64  # markers that neighbors are chosen from: the error of a frame falls by the root of their number
JUDGED = 8  # markers where all bridges are tried: what is best at none of them is rarely best elsewhere
AS_GOOD = 2.0  # times the least mean square, of bridges as good as the best: each is known to a third
REMEMBERED = 4096  # sets of weights, of some kB: an even clock has the same ones again and again
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
    best: dict[int, list[Bridge]] = {}  # of each length, at the markers where all bridges were tried
    by_few: set[tuple[int, int]] = set()  # at which only these were
    # short gaps first: what fills them is seen by its neighbors when theirs are filled; of these the markers
    # first that are judged by all bridges, evenly spread
    judges = {lost[i] for i in np.linspace(0, len(lost) - 1, JUDGED).astype(int)} if lost else set()
    every = sorted((n, k not in judges, k, first) for k in lost for first, n in runs(~seen[:, k] & some))
    for length, _, k, first in every:
        size, gap = int(np.round(np.log(length) / np.log(LENGTH_RATIO))), np.arange(first, first + length)
        others, moves = near[k]
        shown = Shown(time, x[:, k], seen[:, k], x[:, others], seen[:, others], moves)
        found = best.setdefault(size, [])
        if (k, size) not in judged and len(found) >= JUDGED:
            ranked = rank_bridges(shown, length, list(dict.fromkeys(found)))
            judged[k, size] = [one for one in ranked if one.missed < AS_GOOD * ranked[0].missed]
            by_few.add((k, size))
        filled = best_filling(judged.get((k, size), []), shown, gap)
        if filled is None and ((k, size) not in judged or (k, size) in by_few):
            judged[k, size] = rank_bridges(shown, length, list(bridges(len(moves))))
            found += [one.way for one in judged[k, size][:1] if (k, size) not in by_few]
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


class Shown(NamedTuple):
    """What a node and its neighbors show: time (time,), x (time, 3) and near (time, neighbor, 3), each with
    when it is seen; moves (neighbor,) m2: variance of their distance.
    """

    time: Array
    x: Array
    seen: Flags
    near: Array
    near_seen: Flags
    moves: Array


def best_filling(ranked: Sequence[Judged], shown: Shown, gap: Indices) -> tuple[Array, float] | None:
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


def fillings(shown: Shown, gap: Indices, ways: Sequence[Bridge]) -> Iterator[tuple[Bridge, Array, float]]:
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
            if count < way.count and not (way.count == near.shape[1] and count >= NEIGHBORS[2]):
                continue
            if degree not in weigh:
                weigh[degree] = weights(time[rest] - time[gap[0]], time[gap] - time[gap[0]], degree)
            if count not in carried:
                frame = near[frames[:, None], beside[:count]]
                origin, R = frame_of(frame, len(frames))
                y = np.einsum("tba,tb->ta", R[: len(rest)], x[rest] - origin[: len(rest)])
                loose = lever_of(frame[0], x[rest[0]]) * float(moves[beside[:count]].mean()) if count else 1.0
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


def rank_bridges(shown: Shown, length: int, ways: Sequence[Bridge]) -> list[Judged]:
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
            made[way].append((float(((filled - shown.x[gap]) ** 2).mean()), loose))
    means = [(np.mean(each, axis=0).tolist(), way) for way, each in made.items() if each]
    return sorted((Judged(missed, loose, way) for (missed, loose), way in means), key=lambda one: one.missed)


def neighbors(position: Array, seen: Flags, k: int) -> tuple[Indices, Array]:
    """The other nodes that are seen beside node k, those that keep their distance to it best first.

    Also the variance (m2) of that, no less than rounding. Of many, the nearest in some frames that show them.
    """
    with_k, among = position[seen[:, k]], np.arange(position.shape[1])
    if len(among) > NEAREST + 1:
        some = with_k[np.linspace(0, len(with_k) - 1, TRIALS).astype(int)]
        apart = np.linalg.norm(some - some[:, [k]], axis=2)
        far = np.where(np.isfinite(apart), apart, 0.0).sum(0) / np.maximum(np.isfinite(apart).sum(0), 1)
        far[~np.isfinite(apart).any(0)] = np.inf
        among = np.sort(np.argsort(far, kind="stable")[: NEAREST + 1])
    distance = np.linalg.norm(with_k[:, among] - with_k[:, [k]], axis=2)
    often = (np.isfinite(distance).sum(0) >= 2) & (among != k)
    spread = np.full(len(often), np.inf)
    spread[often] = np.nanstd(distance[:, often], axis=0)
    order = np.argsort(spread, kind="stable")
    order = order[often[order]]
    size = float(np.nanmax(distance, initial=1e-9))
    return among[order], np.maximum(spread[order], np.finfo(float).eps * size) ** 2


def frame_of(x: Array, samples: int) -> tuple[Array, Array]:
    """Origin (time, 3) and rotation (time, 3, 3) of the frame that markers x (time, node, 3) make.

    None stand still in the world; one or two carry their mean along; three or more turn with their best fit
    to the first sample.
    """
    if x.shape[1] == 0:
        return np.zeros((samples, 3)), np.broadcast_to(np.eye(3), (samples, 3, 3))
    if x.shape[1] < NEIGHBORS[2]:
        return x.mean(1), np.broadcast_to(np.eye(3), (samples, 3, 3))
    shape = x[0] - x[0].mean(0)
    return fit_rotation(x, shape, np.ones(x.shape[1]))


def lever_of(frame: Array, x: Array) -> float:
    """Mean variance of a place x (3,) that turns with markers (node, 3), over that of their coordinates.

    One where they do not turn it.

    >>> square = np.array([[1.0, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]])
    >>> [round(lever_of(square, np.array([0.0, 0.0, z])), 3) for z in (0.0, 1.0)]
    [0.25, 0.417]
    """
    if len(frame) < NEIGHBORS[2]:
        return 1.0
    mean = frame.mean(0)
    own, d = frame - mean, x - mean
    spread = own.T @ own
    turns = np.trace(spread) * (1 + SINGLE) * np.eye(3) - spread
    return float(1 / len(frame) + np.trace(np.linalg.solve(turns, d @ d * np.eye(3) - np.outer(d, d))) / 3)


def weights(at: Array, to: Array, degree: int) -> Array:
    """Weights (to, at) that continue samples at some times to others, by a polynomial of least squares."""
    return weights_of(at.tobytes(), to.tobytes(), degree)


@lru_cache(REMEMBERED)
def weights_of(at_bytes: bytes, to_bytes: bytes, degree: int) -> Array:
    """`weights` of times by their bytes."""
    at, to = (np.frombuffer(each) for each in (at_bytes, to_bytes))
    middle, half = to.mean(), max(float(np.abs(at - to.mean()).max()), 1e-300)
    rows = np.vander((at - middle) / half, degree + 1)
    return np.asarray(np.vander((to - middle) / half, degree + 1) @ np.linalg.pinv(rows))


def straight(time: Array, known: Array, values: Array) -> Array:
    """Values (sample, ...) known at some times, straight between them."""
    flat = values.reshape(len(values), -1)
    at = np.stack([np.interp(time, known, c) for c in flat.T], 1)
    return np.asarray(at.reshape(len(time), *values.shape[1:]))
