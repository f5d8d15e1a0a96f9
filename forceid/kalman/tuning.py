"""Smoothness and noise of driven channels by maximum likelihood, the order of their prior by evidence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from forceid.kalman.linear import StateSpace, robust_log_likelihood
from forceid.kalman.process import Process, discretize, integrate, matern, with_mean
from forceid.records import Array

ORDERS = (1, 2, 3, 4)
PATIENCE = 7.0  # a simpler prior is kept until a rougher one is e^7 times as likely
LONGEST = 2048  # samples that tuning looks at: of a longer record, a stretch of each quarter
LEAK = 0.01  # of the load on the strongest axis
OUTLIER = 4.0  # standard deviations: one wild sample must not pass for a rough load
ROUNDS, SHRINK = 15, 0.5  # grids after the first at most, and how much finer each is
ENOUGH = 0.02  # gain in log-likelihood; three grids in a row with less end the search


@dataclass(frozen=True)
class Tuned:
    """Matern prior of loads: order, std (axis,), rate (axis,) 1/s, and the noise found with it.

    noise: factor on the stated standard deviation of the measurement; noise_at_limit: the likelihood
    would have taken a smaller one than allowed.
    """

    order: int
    std: Array
    rate: Array
    noise: float
    noise_at_limit: bool
    log_likelihood: float


def maximize(
    objective: Callable[[Array, Array], Array],
    lower: Array,
    upper: Array,
    shared: tuple[float, float],
    start: Array | None = None,
) -> tuple[Array, float, float]:
    """Maximum of a sum over problems on a box: each has its own point, all share one number.

    lower, upper (problem, dim); objective(points (level, problem, point, dim), levels (level,)) -> (level,
    problem, point). A grid, unless `start` (problem, dim) is given, then ever finer grids about the best
    point so far: no derivative, as many starts as the first grid has points, and many points cost about as
    much as one. Returns points, shared number, value.

    >>> def hills(p, s):
    ...     return -((p - 0.3) ** 2).sum(-1) - (s[:, None, None] - 0.7) ** 2
    >>> at, level, _ = maximize(hills, np.zeros((2, 2)), np.ones((2, 2)), (0.0, 1.0))
    >>> bool(abs(at - 0.3).max() < 0.01), bool(abs(level - 0.7) < 0.01)
    (True, True)
    """
    dims, free = lower.shape[-1], shared[1] > shared[0]
    wide, near = np.arange(-3.0, 4.0), np.arange(-1.0, 2.0)
    at, step = 0.5 * (lower + upper), (upper - lower) / 6
    idle, level, level_step, best = 0, 0.5 * sum(shared), (shared[1] - shared[0]) / 6, -np.inf
    if start is not None:
        at, step = start, step / 4
    for turn in range(ROUNDS + 1):
        spread = wide if turn == 0 and start is None else near
        offset = np.stack(np.meshgrid(*[spread] * dims, indexing="ij"), -1).reshape(-1, dims)
        levels = np.clip(level + level_step * (near if turn else wide), *shared) if free else np.r_[level]
        points = np.clip(at[:, None] + offset * step[:, None], lower[:, None], upper[:, None])
        points = np.broadcast_to(points, (len(levels), *points.shape))
        value = np.nan_to_num(objective(points, levels), nan=-np.inf)
        which = value.max(2).sum(1).argmax()
        found = points[which, np.arange(len(at)), value[which].argmax(1)]
        # a coordinate that still moves keeps its step
        step = np.where((found != at) & (turn > 0), step, SHRINK * step)
        gained, idle = value[which].max(1).sum() - best, idle + 1
        if gained > ENOUGH:
            idle = 0
        if gained > 0:
            best, level, at = float(value[which].max(1).sum()), float(levels[which]), found
        level_step = level_step / 2
        if idle == 3:
            break
    return at, level, best


def load_chain(order: int, std: ArrayLike, rate: ArrayLike, start: Start) -> Process:
    """States (Y, H, mean, load, load', ...) of a load under a Matern prior: Y' = H, H' = mean + load."""
    load = with_mean(matern(order, std, rate), start.mean)
    return integrate(integrate(load, start.first), start.second)


def driven(chain: Process, gain: float, noise_var: Array, drift: Array, step: Array) -> StateSpace:
    """Channels z with z'' = gain * load: one scalar model per chain in `chain`.

    noise_var (time, model) of z; drift (model,): variance per second of the part of the noise that adds up;
    step (time - 1,) s.
    """
    # equal steps share their matrices: a regular clock has one
    unique, which = np.unique(np.round(step, 12), return_inverse=True)
    F, Q = discretize(Process(chain.A[None], chain.Qc[None], chain.P0, chain.output), unique[:, None])
    Q[..., 0, 0] += drift * unique[:, None]
    if len(unique) > 1:
        F, Q = F[which], Q[which]
    H = gain * chain.output[None, None, None]
    return StateSpace(F, Q, H, noise_var[..., None, None], np.zeros(chain.P0.shape[:-1]), chain.P0)


def tune_loads(
    time: Array,
    z: Array,
    gain: float,
    noise_var: Array,
    drift: Array,
    noise_range: tuple[float, float] = (1.0, 1.0),
    orders: tuple[int, ...] = ORDERS,
) -> Tuned:
    """Prior of the loads that drive channels z'' = gain * load, by maximum likelihood.

    time (time,) s; z (time, axis), NaN = missing; gain: 1/kg for forces and a mass center; noise_var (time,
    axis) of z as stated, drift (axis,) of `driven`; noise_range: smallest and largest factor on the stated
    standard deviation. Of the orders, the smoothest that no rougher one beats by e^PATIENCE; on an axis where
    a varying load is not e^PATIENCE times as likely as a constant one, the constant.
    """
    stretches, axes = stretch(z), z.shape[1]

    def objective(points: Array, levels: Array, order: int) -> Array:
        shape = points.shape[:-1]
        std, rate = natural(points.reshape(-1, 2), order)
        axis = np.broadcast_to(np.arange(axes)[:, None], shape).ravel()
        noise = np.broadcast_to(np.exp(2 * levels)[:, None, None], shape).ravel()
        total = np.zeros(len(std))
        for s in stretches:
            y, t = z[s] - z[s][np.isfinite(z[s]).all(1)][0], time[s]
            chain = load_chain(order, std, rate, start_of(t, y, gain))
            model = driven(chain, gain, noise_var[s][:, axis] * noise, drift[axis] * noise, np.diff(t))
            total += robust_log_likelihood(model, y[:, axis], OUTLIER)
        return total.reshape(shape)

    def search(
        order: int, shared: tuple[float, float], start: Array | None = None
    ) -> tuple[Array, float, float]:
        lower, upper = search_box(time, z, gain, order)
        edges = np.tile(lower, (axes, 1)), np.tile(upper, (axes, 1))
        return maximize(lambda p, s: objective(p, s, order), *edges, shared, start)

    def tuned(order: int, at: Array, level: float, value: float) -> Tuned:
        at_limit = limits[1] > limits[0] and level - limits[0] < 0.05
        return Tuned(order, *natural(at, order), float(np.exp(level)), at_limit, value)

    limits = (float(np.log(noise_range[0])), float(np.log(noise_range[1])))
    level = limits[0]
    if limits[0] < 0.0:  # the noise was not stated: a first look at it, under a prior of middle order
        _, level, _ = search(2, limits)
    found = {order: search(order, (level, level)) for order in orders}
    order = smoothest({order: value for order, (_, _, value) in found.items()})
    at, level, value = search(order, limits, found[order][0]) if limits[1] > limits[0] else found[order]
    none = np.tile(search_box(time, z, gain, order)[0], (axes, 1))
    quiet = maximize(lambda p, s: objective(p, s, order), none, none, limits, none)
    if value - quiet[2] < PATIENCE * axes:
        return tuned(order, *quiet)
    each = objective(np.stack([at, none], 1)[None], np.array([level]), order)[0]
    best = tuned(order, at, level, value)
    still = each[:, 0] - each[:, 1] < PATIENCE
    if still.any():
        # the axes are known to about a hundredth, and by that much of it a load leaks to a still one
        strong = np.where(still, 0.0, best.std).argmax()
        std = np.where(still, LEAK * best.std[strong], best.std)
        best = replace(best, std=std, rate=np.where(still, best.rate[strong], best.rate))
    return best


def natural(points: Array, order: int) -> tuple[Array, Array]:
    """The std and rate (...) of search points (..., 2): log of std * rate^(order - 1/2), and log rate.

    The first is the level at high frequency, which a record fixes far better than std and rate alone.
    """
    rate = np.exp(points[..., 1])
    return np.exp(points[..., 0]) / rate ** (order - 0.5), rate


def smoothest(evidence: dict[int, float]) -> int:
    """The highest order whose evidence is within PATIENCE of the best.

    >>> smoothest({1: -10.0, 2: 0.0, 3: -4.0, 4: -9.0})
    3
    """
    return max(order for order, value in evidence.items() if value > max(evidence.values()) - PATIENCE)


def stretch(z: Array) -> list[slice]:
    """Stretches of a record (time, axis) that tuning looks at, each with enough samples present."""
    n = len(z)
    quarters = [slice(0, n)]
    if n > LONGEST:
        quarters = [slice(a, a + LONGEST // 4) for a in np.linspace(0, n - LONGEST // 4, 4).astype(int)]
    enough = [s for s in quarters if np.isfinite(z[s]).all(1).sum() >= 8]
    return enough or [slice(0, n)]


@dataclass(frozen=True)
class Start:
    """Variances at the start, as good as unknown: of the load's second and first integral, of its mean."""

    second: float
    first: float
    mean: float


def start_of(time: Array, z: Array, gain: float) -> Start:
    """Start of channels z (time, axis), z'' = gain * load, that begin near zero."""
    seen = np.isfinite(z).all(1)
    size, span = np.abs(z[seen]).max(initial=1e-12) / gain, np.ptp(time[seen])
    speed = np.abs(np.diff(z[seen], axis=0) / np.diff(time[seen])[:, None]).max(initial=1e-12) / gain
    return Start((10 * size) ** 2, (10 * speed) ** 2, (10 * speed / span) ** 2)


def second_difference(time: Array, z: Array, lag: int) -> Array:
    """Second divided difference (sample, axis) of z over `lag` samples either way; NaN at gaps."""
    ahead = (z[2 * lag :] - z[lag:-lag]) / (time[2 * lag :] - time[lag:-lag])[:, None]
    behind = (z[lag:-lag] - z[: -2 * lag]) / (time[lag:-lag] - time[: -2 * lag])[:, None]
    d = 2 * (ahead - behind) / (time[2 * lag :] - time[: -2 * lag])[:, None]
    return d[np.isfinite(d).all(1)]


def search_box(time: Array, z: Array, gain: float, order: int) -> tuple[Array, Array]:
    """Smallest and largest search point (2,) worth a look, from second differences at many lags.

    The first is a load that no record shows; a rate beyond half a turn a sample would pass noise for load.
    """
    sizes = [np.sqrt(np.mean(d**2)) / gain for lag in lags(z) if len(d := second_difference(time, z, lag))]
    rate = np.log([1.0 / (time[-1] - time[0]), 0.5 / np.median(np.diff(time))])
    high = max(10 * max(sizes, default=0.0), 1e-12)
    low = max(1e-3 * min(sizes, default=0.0), 1e-9 * high)
    corner = np.array([np.log(low), np.log(high)]) + (order - 0.5) * rate
    return np.array([corner[0], rate[0]]), np.array([corner[1], rate[1]])


def load_axes(time: Array, z: Array) -> Array:
    """Orthogonal axes (columns) along which the second derivative of z (time, 3) varies independently.

    Equal white noise on all axes does not turn them. They turn with the data, so that estimates do not
    depend on the frame. Taken at the lag where they stand out most.
    """
    best, axes = -1.0, np.eye(3)
    for lag in lags(z):
        d = second_difference(time, z, lag)
        if len(d) < 3:
            continue
        size, turned = np.linalg.eigh(d.T @ d / len(d))
        clear = (size[-1] - size[0]) / max(size.mean(), 1e-300) * np.sqrt(len(d) / lag)
        if clear > best:
            best, axes = clear, turned
    return np.asarray(axes * np.sign(np.linalg.det(axes)))


def lags(z: Array) -> list[int]:
    """Lags in samples, doubling, that a third of the record holds."""
    return [2**i for i in range(int(np.log2(max(len(z) // 3, 1))) + 1)]
