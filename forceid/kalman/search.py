"""Maximum of many problems at once: a grid, then Newton's steps by differences, many points to a pass."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement, product

import numpy as np

from forceid.records import Array

COARSE = 2  # grids after the first, each half as wide
ROUNDS, FINE = 12, 1 / 200  # Newton's steps at most, and their differences as part of the box
ENOUGH = 0.01  # gain in log-likelihood that a further step must promise
TRUST, TRUST_AT_MOST = 0.1, 0.5  # of the box: how far the first step may go, and any
FLATTEST = 1e-3  # curvature over the largest one of the same problem that a step believes in


def maximize(
    objective: Callable[[Array, Array], Array],
    lower: Array,
    upper: Array,
    shared: tuple[float, float],
    start: tuple[Array, float] | None = None,
) -> tuple[Array, float, float]:
    """Maximum of a sum over problems on a box: each has its own point, all share one number.

    lower, upper (problem, dim); objective(points (level, problem, point, dim), levels (level,)) -> (level,
    problem, point). A grid, so as many starts as it has points, unless start (points and number) is given;
    then Newton's steps, derivatives by differences: many points cost about as much as one. Returns points,
    shared number, value.

    >>> def hills(p, s):
    ...     return -((p - 0.3) ** 2).sum(-1) - (s[:, None, None] - 0.7) ** 2
    >>> at, level, _ = maximize(hills, np.zeros((2, 2)), np.ones((2, 2)), (0.0, 1.0))
    >>> bool(abs(at - 0.3).max() < 0.01), bool(abs(level - 0.7) < 0.01)
    (True, True)
    """
    at, level = coarse(objective, lower, upper, shared) if start is None else start
    return climb(objective, lower, upper, shared, at, level)


def coarse(
    objective: Callable[[Array, Array], Array], lower: Array, upper: Array, shared: tuple[float, float]
) -> tuple[Array, float]:
    """The best point of a grid over the box, and of a few finer ones about it."""
    dims, free, each = lower.shape[-1], shared[1] > shared[0], np.arange(len(lower))
    at, step = 0.5 * (lower + upper), (upper - lower) / 6
    level, level_step, best = 0.5 * sum(shared), (shared[1] - shared[0]) / 6, -np.inf
    for turn in range(COARSE + 1):
        spread = np.arange(-1.0, 2.0) if turn else np.arange(-3.0, 4.0)
        offset = np.array(list(product(spread, repeat=dims)))
        levels = np.clip(level + level_step * spread, *shared) if free else np.r_[level]
        points = np.clip(at[:, None] + offset * step[:, None], lower[:, None], upper[:, None])
        points = np.broadcast_to(points, (len(levels), *points.shape))
        value = np.nan_to_num(objective(points, levels), nan=-np.inf)
        which = int(value.max(2).sum(1).argmax())
        if (total := float(value[which].max(1).sum())) > best:
            best, level, at = total, float(levels[which]), points[which, each, value[which].argmax(1)]
        step, level_step = step / 2, level_step / 2
    return at, level


def climb(
    objective: Callable[[Array, Array], Array],
    lower: Array,
    upper: Array,
    shared: tuple[float, float],
    at: Array,
    level: float,
) -> tuple[Array, float, float]:
    """Newton's steps from a point, each trusted as far as the last one kept its promise."""
    problems, dims, free = *lower.shape, shared[1] > shared[0]
    width = np.concatenate([upper - lower, np.full((problems, 1), shared[1] - shared[0])], 1)
    low = np.concatenate([lower, np.full((problems, 1), shared[0])], 1)
    h, x = FINE * width, np.concatenate([at, np.full((problems, 1), level)], 1)
    offset = np.array(list(product((-1.0, 0.0, 1.0), repeat=dims)))
    levels_off = np.array([-1.0, 0.0, 1.0]) if free else np.zeros(1)
    grid = np.array([(*o, s) for s in levels_off for o in offset])
    middle = int(np.abs(grid).sum(1).argmin())
    reach, best = np.full(problems, TRUST), np.full(problems, -np.inf)
    best_x, slope, bend = x, np.zeros((problems, dims + 1)), np.zeros((problems, dims + 1, dims + 1))
    for _ in range(ROUNDS):
        points = x[:, None, :-1] + offset * h[:, None, :-1]
        levels = x[0, -1] + levels_off * h[0, -1]
        value = objective(np.broadcast_to(points, (len(levels), *points.shape)), levels)
        value = np.nan_to_num(np.moveaxis(value, 0, 1).reshape(problems, -1), nan=-np.inf)
        here = value[:, middle]
        # with a shared number the problems stand and fall together
        better = np.full(problems, here.sum() > best.sum()) if free else here > best
        if not np.isfinite(best).all():
            better[:] = True
        new_slope, new_bend = parabola(grid, value)
        slope[better], bend[better] = new_slope[better], new_bend[better]
        best_x, best = np.where(better[:, None], x, best_x), np.where(better, here, best)
        reach = np.where(better, np.minimum(2 * reach, TRUST_AT_MOST), 0.2 * reach)
        step, promise = newton(slope, bend, h, best_x, low, width, reach, free)
        if promise.max() < ENOUGH:
            break
        x = best_x + step
    return best_x[:, :-1], float(best_x[0, -1]), float(best.sum())


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
    slope: Array, bend: Array, h: Array, x: Array, low: Array, width: Array, reach: Array, free: bool
) -> tuple[Array, Array]:
    """Step (problem, dim) uphill within reach and box, and the gain (problem,) that it promises.

    slope, bend: in steps h. The last coordinate is shared by all problems, where it is free.
    """
    problems, dims = x.shape
    scale = np.where(h > 0, h, 1.0)
    down, up = (low - x) / scale, (low + width - x) / scale
    if free:  # one problem in all coordinates
        n = problems * (dims - 1) + 1
        place = np.array([[*range(p * (dims - 1), (p + 1) * (dims - 1)), n - 1] for p in range(problems)])
        g, H, least, most = np.zeros(n), np.zeros((n, n)), np.zeros(n), np.zeros(n)
        for p in range(problems):
            g[place[p]] += slope[p]
            H[np.ix_(place[p], place[p])] += bend[p]
            least[place[p]], most[place[p]] = down[p], up[p]
        step = uphill(g, H, least, most)[place]
    else:
        step = np.stack([uphill(*of) for of in zip(slope, bend, down, up, strict=True)])
    size = (np.abs(step) * FINE).max(1)
    size = np.full(problems, size.max()) if free else size
    step = step * np.minimum(1.0, reach / np.maximum(size, 1e-300))[:, None]
    gain = (slope * step).sum(1) + 0.5 * np.einsum("pi,pij,pj->p", step, bend, step)
    return step * scale, np.full(problems, gain.sum()) if free else gain


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
