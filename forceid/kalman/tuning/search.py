"""Maximum of many problems at once: a grid, then Newton's steps by differences, many points to a pass."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement, product

import numpy as np
from numpy.typing import ArrayLike

from forceid.records import Array, Flags

FINER_GRIDS = 2  # grids after the first, each half as wide
NEWTON_ROUNDS, FINE = 12, 1 / 200  # Newton's steps at most, and their differences as part of the box
ENOUGH = 0.01  # gain in log-likelihood that a further step must promise
TRUST, TRUST_AT_MOST = 0.1, 0.5  # of the box: how far the first step may go, and any
FLATTEST = 1e-3  # curvature over the largest one of the same problem that a step believes in


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

    >>> def hills(p, s):
    ...     return -((p - 0.3) ** 2).sum(-1) - (s[..., None] - 0.7) ** 2
    >>> at, level, _ = maximize(hills, np.zeros((2, 2)), np.ones((2, 2)), (0.0, 1.0))
    >>> bool(abs(at - 0.3).max() < 0.01), bool(abs(level - 0.7).max() < 0.01)
    (True, True)
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
    (problems, dims), free = lower.shape, bool((shared[1] > shared[0]).any())
    low = np.concatenate([lower, shared[0][:, None]], 1)
    width = np.concatenate([upper, shared[1][:, None]], 1) - low
    h, x = FINE * width, np.concatenate([at, level[:, None]], 1)
    offset = np.array(list(product((-1.0, 0.0, 1.0), repeat=dims)))
    levels_off = np.array([-1.0, 0.0, 1.0]) if free else np.zeros(1)
    grid = np.array([(*o, s) for s in levels_off for o in offset])
    middle = int(np.abs(grid).sum(1).argmin())
    reach, best = np.full(problems, TRUST), np.full(problems, -np.inf)
    best_x, slope, bend = x, np.zeros((problems, dims + 1)), np.zeros((problems, dims + 1, dims + 1))
    for _ in range(NEWTON_ROUNDS):
        points = x[:, None, :-1] + offset * h[:, None, :-1]
        levels = x[:, -1] + levels_off[:, None] * h[:, -1]
        value = objective(np.broadcast_to(points, (len(levels), *points.shape)), levels)
        value = np.nan_to_num(np.moveaxis(value, 0, 1).reshape(problems, -1), nan=-np.inf)
        here = value[:, middle]
        # problems that share a number stand and fall together
        better = np.array([here[mine].sum() > best[mine].sum() for mine in same])
        if not np.isfinite(best).all():
            better[:] = True
        new_slope, new_bend = parabola(grid, value)
        slope[better], bend[better] = new_slope[better], new_bend[better]
        best_x, best = np.where(better[:, None], x, best_x), np.where(better, here, best)
        reach = np.where(better, np.minimum(2 * reach, TRUST_AT_MOST), 0.2 * reach)
        step, promise = newton(slope, bend, h, best_x, low, width, reach, same)
        if promise.max() < ENOUGH:
            break
        x = best_x + step
    return best_x[:, :-1], best_x[:, -1], best


def parabola(grid: Array, value: Array) -> tuple[Array, Array]:
    """Slope and bend at the middle of values (problem, point) on a grid (point, dim) of steps -1, 0, 1.

    Zero where a value is not finite.
    """
    dims = grid.shape[1]
    pairs = list(combinations_with_replacement(range(dims), 2))
    columns = [np.ones(len(grid)), *grid.T, *(grid[:, a] * grid[:, b] for a, b in pairs)]
    known = np.isfinite(value).all(axis=1, keepdims=True)
    c = np.where(known, value, 0.0) @ np.linalg.pinv(np.stack(columns, 1)).T
    bend = np.zeros((len(value), dims, dims))
    for (a, b), h in zip(pairs, c[:, 1 + dims :].T, strict=True):
        bend[:, a, b] += h
        bend[:, b, a] += h
    return c[:, 1 : 1 + dims], bend


def newton(
    slope: Array, bend: Array, h: Array, x: Array, low: Array, width: Array, reach: Array, same: Flags
) -> tuple[Array, Array]:
    """Step (problem, dim) uphill within reach and box, and the gain (problem,) that it promises.

    slope, bend: in steps h. The last coordinate is one for all problems that are the `same`.
    """
    scale = np.where(h > 0, h, 1.0)
    down, up = (low - x) / scale, (low + width - x) / scale
    step, gain = np.zeros_like(x), np.zeros(len(x))
    for group in np.unique(same, axis=0):
        step[group] = shared_step(slope[group], bend[group], down[group], up[group])
        size = (np.abs(step[group]) * FINE).max()
        step[group] *= np.minimum(1.0, reach[group] / max(size, 1e-300))[:, None]
        rises = (slope * step).sum(1) + 0.5 * np.einsum("pi,pij,pj->p", step, bend, step)
        gain[group] = rises[group].sum()
    return step * scale, gain


def shared_step(slope: Array, bend: Array, down: Array, up: Array) -> Array:
    """Newton's step of problems (problem, dim) whose last coordinate is one: a problem in all of them."""
    problems, dims = slope.shape
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

    A coordinate that would leave its bounds goes to the bound, and the others make the best of that.

    >>> ridge = np.array([[-2.0, 1.9], [1.9, -2.0]])
    >>> uphill(np.array([0.1, 0.1]), ridge, np.array([-9.0, -9.0]), np.array([9.0, 0.5])).round(3).tolist()
    [0.525, 0.5]
    """
    step, go = np.zeros(len(slope)), most > least
    while go.any():
        curved, axes = np.linalg.eigh(bend[np.ix_(go, go)])
        steep = np.maximum(np.abs(curved), max(FLATTEST * np.abs(curved).max(), 1e-300))
        tilted = slope[go] + bend[np.ix_(go, ~go)] @ step[~go]
        step[go] = axes @ ((axes.T @ tilted) / steep)
        out = go & ((step < least) | (step > most))
        if not out.any():
            break
        step[out] = np.clip(step[out], least[out], most[out])
        go &= ~out
    return step
