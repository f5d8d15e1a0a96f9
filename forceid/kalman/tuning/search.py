"""Maximum of many problems at once: a grid, then Newton's steps by differences, many points to a pass."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations, product

import numpy as np
from numpy.typing import ArrayLike

from forceid.records import Array, Flags

FINER_GRIDS = 2  # grids after the first, each half as wide
NEWTON_ROUNDS, FINE = 12, 1 / 200  # Newton's steps at most, and their differences as part of the box
ENOUGH = 0.01  # gain in log-likelihood that a further step must promise
TRUST, TRUST_AT_MOST = 0.1, 0.5  # of the box: how far the first step may go, and any
OUTDONE, FARTHER_AT_MOST = 1.2, 4.0  # of its promise, that a step gained; and how far it is then taken again
WORST = -np.sqrt(np.finfo(float).max)  # of a value: what stands for minus infinity in a sum
FLATTEST = 1e-4  # curvature of a ridge over that of its coordinates: what differences still show


def maximize(
    objective: Callable[[Array, Array], Array],
    lower: Array,
    upper: Array,
    shared: tuple[ArrayLike, ArrayLike],
    start: tuple[Array, ArrayLike] | None = None,
    same: Flags | None = None,
) -> tuple[Array, Array, Array]:
    """Maximum of a sum over problems on a box: each has its own point, and one number that some may share.

    lower, upper (problem, dim); shared: bounds of the number, alike or (problem,); same (problem, problem):
    which problems share theirs, all if not given. objective(points (level, problem, point, dim), levels
    (level, problem)) -> (level, problem, point). A grid, so as many starts as it has points, unless start
    (points and numbers) is given; then Newton's steps, derivatives by differences: many points cost about as
    much as one. Returns points, numbers (problem,) and values (problem,).
    """
    least, most = (np.broadcast_to(edge, len(lower)) for edge in shared)
    if not (most > least).any():
        same = np.eye(len(lower), dtype=bool)
    elif same is None:
        same = np.ones((len(lower), len(lower)), bool)
    at, level = coarse(objective, lower, upper, (least, most), same) if start is None else start
    level = same @ np.broadcast_to(level, len(lower)) / same.sum(1)  # of those that share it
    return climb(objective, lower, upper, (least, most), at, level, same)


def coarse(
    objective: Callable[[Array, Array], Array],
    lower: Array,
    upper: Array,
    shared: tuple[Array, Array],
    same: Flags,
) -> tuple[Array, Array]:
    """The best point of a grid over the box, and of a few finer ones about it."""
    dims, free, each = lower.shape[-1], (shared[1] > shared[0]).any(), np.arange(len(lower))
    at, step = 0.5 * (lower + upper), (upper - lower) / 6
    level, level_step = 0.5 * (shared[0] + shared[1]), (shared[1] - shared[0]) / 6
    best = np.full(len(lower), -np.inf)
    for turn in range(FINER_GRIDS + 1):
        spread = np.arange(-1.0, 2.0) if turn else np.arange(-3.0, 4.0)
        offset = np.array(list(product(spread, repeat=dims)))
        levels = np.clip(level + spread[:, None] * level_step, *shared) if free else level[None]
        points = np.clip(at[:, None] + offset * step[:, None], lower[:, None], upper[:, None])
        points = np.broadcast_to(points, (len(levels), *points.shape))
        value = np.nan_to_num(objective(points, levels), nan=-np.inf)
        total = value.max(2) @ same
        which = total.argmax(0)
        found = points[which, each, value[which, each].argmax(1)]
        better = total[which, each] > best
        best = np.where(better, total[which, each], best)
        level, at = np.where(better, levels[which, each], level), np.where(better[:, None], found, at)
        step, level_step = step / 2, level_step / 2
    return at, level


def climb(
    objective: Callable[[Array, Array], Array],
    lower: Array,
    upper: Array,
    shared: tuple[Array, Array],
    at: Array,
    level: Array,
    same: Flags,
) -> tuple[Array, Array, Array]:
    """Newton's steps from a point, each trusted as far as the last one kept its promise."""
    low, width, x = joined(lower, upper, shared, at, level)
    reach, best, best_x = np.full(len(x), TRUST), np.full(len(x), -np.inf), x
    slope, bend = np.zeros(x.shape), np.zeros((*x.shape, x.shape[1]))
    promise, times = np.full(len(x), np.inf), np.ones(len(x))
    for _ in range(NEWTON_ROUNDS):
        here, new_slope, new_bend = around(objective, x, width)
        # problems that share a number stand and fall together
        gain = same @ (np.maximum(here, WORST) - np.maximum(best, WORST))
        better = (gain > 0) | np.isinf(best).any()
        slope[better], bend[better] = new_slope[better], new_bend[better]
        best_x, best = np.where(better[:, None], x, best_x), np.where(better, here, best)
        # a ridge that goes on as it is keeps more than was promised: then farther at once
        onward = better & (gain > OUTDONE * promise)
        reach = np.where(better, np.minimum(2 * reach, TRUST_AT_MOST), np.where(times > 1, 1.0, 0.2) * reach)
        times = np.where(onward, np.minimum(2 * times, FARTHER_AT_MOST), 1.0)
        step, promise = newton(slope, bend, FINE * width, best_x, low, width, reach, same)
        if promise.max() < ENOUGH:
            break
        x = np.clip(best_x + times[:, None] * step, low, low + width)
    return best_x[:, :-1], best_x[:, -1], best


def promise_apart(
    objective: Callable[[Array, Array], Array],
    lower: Array,
    upper: Array,
    shared: tuple[ArrayLike, ArrayLike],
    at: Array,
    level: Array,
) -> float:
    """Gain in value that Newton's step promises at a point, as of `maximize`, if none shares a number."""
    low, width, x = joined(lower, upper, shared, at, level)
    _, slope, bend = around(objective, x, width)
    far, none = np.full(len(x), np.inf), np.eye(len(x), dtype=bool)
    return float(newton(slope, bend, FINE * width, x, low, width, far, none)[1].sum())


def joined(
    lower: Array, upper: Array, shared: tuple[ArrayLike, ArrayLike], at: Array, level: Array
) -> tuple[Array, Array, Array]:
    """Lower edge, width and a point (problem, dim + 1) of a box, its number last."""
    low, high = (
        np.concatenate([edge, np.broadcast_to(np.reshape(number, (-1, 1)), (len(edge), 1))], 1)
        for edge, number in ((lower, shared[0]), (upper, shared[1]))
    )
    return low, high - low, np.concatenate([at, level[:, None]], 1)


def around(objective: Callable[[Array, Array], Array], x: Array, width: Array) -> tuple[Array, Array, Array]:
    """Value (problem,), slope and bend, in steps of a fine part of the width, at points and numbers x."""
    grid = cross_of(np.asarray((width > 0).any(0)))
    points = x + grid[:, None] * FINE * width
    value = np.nan_to_num(objective(points[:, :, None, :-1], points[..., -1])[..., 0].T, nan=-np.inf)
    return value[:, 0], *parabola(grid, value)


def cross_of(moves: Flags) -> Array:
    """Steps (point, dim) that tell slope and bend along coordinates that move: none, each, by twos."""
    each = np.eye(len(moves))[moves]
    both = np.reshape([a + b for a, b in combinations(each, 2)], (-1, len(moves)))
    return np.concatenate([np.zeros((1, len(moves))), each, -each, both, -both])


def parabola(grid: Array, value: Array) -> tuple[Array, Array]:
    """Slope and bend at the first of the values (problem, point) at steps (point, dim) of a `cross_of`.

    Zero where a value is not finite, and along what does not move.
    """
    moves, dims = np.flatnonzero(grid.any(0)), grid.shape[1]
    known = np.isfinite(value).all(axis=1, keepdims=True)
    off = np.where(known, value - np.where(known, value[:, :1], 0.0), 0.0)[:, 1:]
    ahead, behind, both = np.split(off, len(moves) * np.array([1, 2]), axis=1)
    pairs = np.add(*np.split(both, 2, axis=1)) / 2
    slope, bend = np.zeros((len(value), dims)), np.zeros((len(value), dims, dims))
    slope[:, moves], bend[:, moves, moves] = (ahead - behind) / 2, ahead + behind
    for (a, b), value_ab in zip(combinations(range(len(moves)), 2), pairs.T, strict=True):
        mixed = value_ab - 0.5 * (ahead + behind)[:, [a, b]].sum(1)
        bend[:, moves[a], moves[b]] = bend[:, moves[b], moves[a]] = mixed
    return slope, bend


def newton(
    slope: Array, bend: Array, h: Array, x: Array, low: Array, width: Array, reach: Array, same: Flags
) -> tuple[Array, Array]:
    """Step (problem, dim) uphill within reach and box, and the gain (problem,) that it promises.

    slope, bend: in steps h. The last coordinate is one for all problems that are the `same`.
    """
    scale, far = np.where(h > 0, h, 1.0), reach[:, None] / FINE
    down, up = np.maximum((low - x) / scale, -far), np.minimum((low + width - x) / scale, far)
    step, gain = np.zeros_like(x), np.zeros(len(x))
    for group in {row.tobytes(): row for row in same}.values():
        step[group] = shared_step(slope[group], bend[group], down[group], up[group])
        rises = (slope * step).sum(1) + 0.5 * np.einsum("pi,pij,pj->p", step, bend, step)
        gain[group] = rises[group].sum()
    return step * scale, gain


def shared_step(slope: Array, bend: Array, down: Array, up: Array) -> Array:
    """Newton's step of problems (problem, dim) whose last coordinate is one: a problem in all of them."""
    problems, dims = slope.shape
    if problems == 1:
        return uphill(slope[0], bend[0], down[0], up[0])[None]
    n = problems * (dims - 1) + 1
    place = np.array([[*range(p * (dims - 1), (p + 1) * (dims - 1)), n - 1] for p in range(problems)])
    g, H, least, most = np.zeros(n), np.zeros((n, n)), np.zeros(n), np.zeros(n)
    for p in range(problems):
        g[place[p]] += slope[p]
        H[np.ix_(place[p], place[p])] += bend[p]
        least[place[p]], most[place[p]] = down[p], up[p]
    return np.asarray(uphill(g, H, least, most)[place])


def uphill(slope: Array, bend: Array, least: Array, most: Array) -> Array:
    """Newton's step on a quadratic between bounds, with every curvature taken as one of a hill.

    Where a coordinate comes to its bound it stays there, and the others go on from there: so the quadratic
    itself never falls on the way.
    """
    step, go = np.zeros(len(slope)), most > least
    while go.any():
        some = bend[go][:, go]
        # in units of its own curvature each, so that a flat coordinate does not pass for a ridge
        least_bent = max(np.finfo(float).eps * float(np.abs(some).max()), 1e-300)
        unit = np.sqrt(np.maximum(np.abs(np.diagonal(some)), least_bent))
        curved, axes = np.linalg.eigh(some / unit / unit[:, None])
        steep, way = np.maximum(np.abs(curved), FLATTEST), np.zeros(len(slope))
        way[go] = axes @ ((axes.T @ ((slope + bend @ step)[go] / unit)) / steep) / unit
        room, part = np.where(way > 0, most, least) - step, np.full(len(way), np.inf)
        moves = way != 0
        part[moves] = room[moves] / way[moves]
        first = int(part.argmin())
        if part[first] >= 1:
            return step + way
        step += part[first] * way
        step[first], go[first] = (most if way[first] > 0 else least)[first], False
    return step
