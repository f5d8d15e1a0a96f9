"""Smoothness and noise of driven channels by maximum likelihood, the order of their prior by evidence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.kalman.channels import (
    driven,
    load_chain,
    search_box,
    start_of,
    stretch,
)
from forceid.kalman.engines import Engine, for_tuning
from forceid.kalman.lines import PATIENCE, Line
from forceid.kalman.search import maximize
from forceid.records import Array

ORDERS = (1, 2, 3, 4, 6)
ASKED = 1.0  # log-likelihood by which a record asks for an order above that
MISSED = 2  # orders in a row that may be no likelier: the search for one may have missed its peak
FREE = 4  # order of a prior up to which the smoothest is taken that no rougher one beats clearly
LEAK = 0.01  # of the load on the strongest axis
OUTLIER = 4.0  # standard deviations: one wild sample must not pass for a rough load


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


def tune_loads(
    time: Array,
    z: Array,
    gain: float,
    noise_var: Array,
    drift: Array,
    noise_range: tuple[float, float] = (1.0, 1.0),
    orders: tuple[int, ...] = ORDERS,
    lines: tuple[Line, ...] = (),
    engine: Engine | None = None,
) -> Tuned:
    """Prior of the loads that drive channels z'' = gain * load, by maximum likelihood.

    time (time,) s; z (time, axis), NaN = missing; gain: 1/kg for forces and a mass center; noise_var (time,
    axis) of z as stated, drift (axis,) of `driven`; noise_range: smallest and largest factor on the stated
    standard deviation. Of the orders, the smoothest that no rougher one beats by e^PATIENCE; on an axis where
    a varying load is not e^PATIENCE times as likely as a constant one, the constant. lines: that the load is
    known to hold beside, with directions along the axes of z. engine: the fastest, if none is given.
    """
    stretches, axes, likelihood = stretch(z), z.shape[1], for_tuning(engine).log_likelihood

    def box(order: int) -> tuple[Array, Array]:
        lower, upper = (np.tile(edge, (axes, 1)) for edge in search_box(time, z, gain, order))
        return lower, upper

    def objective(points: Array, levels: Array, order: int) -> Array:
        shape = points.shape[:-1]
        std, rate = natural(points.reshape(-1, 2), order)
        axis = np.broadcast_to(np.arange(axes)[:, None], shape).ravel()
        noise = np.broadcast_to(np.exp(2 * levels)[:, None, None], shape).ravel()
        total = np.zeros(len(std))
        for run in stretches:
            y, t = z[run] - z[run][np.isfinite(z[run]).all(1)][0], time[run]
            beside = [line.scaled(np.abs(line.direction[axis])) for line in lines]
            chain = load_chain(order, std, rate, start_of(t, y, gain), beside)
            model = driven(chain, gain, noise_var[run][:, axis] * noise, drift[axis] * noise, np.diff(t))
            total += likelihood(model, y[:, axis, None], OUTLIER)
        return total.reshape(shape)

    def search(
        order: int, shared: tuple[float, float], start: tuple[Array, float] | None = None
    ) -> tuple[Array, float, float]:
        return maximize(lambda p, s: objective(p, s, order), *box(order), shared, start)

    def tuned(order: int, at: Array, level: float, value: float) -> Tuned:
        at_limit = limits[1] > limits[0] and level - limits[0] < 0.05
        return Tuned(order, *natural(at, order), float(np.exp(level)), at_limit, value)

    limits = (float(np.log(noise_range[0])), float(np.log(noise_range[1])))
    level = limits[0]
    if limits[0] < 0.0:  # the noise was not stated: a first look at it, under a prior of middle order
        _, level, _ = search(2, limits)
    found: dict[int, tuple[Array, float, float]] = {}
    worse = 0
    for order in sorted(orders, reverse=True):  # down from the smoothest, as long as roughness pays
        found[order] = search(order, (level, level))
        pays = found[order][2] > max(value for _, _, value in found.values()) - ASKED
        worse = 0 if pays else worse + (order <= FREE)
        if worse == MISSED:
            break
    order = smoothest({order: value for order, (_, _, value) in found.items()})
    at, level, value = (
        search(order, limits, (found[order][0], level)) if limits[1] > limits[0] else found[order]
    )
    none = box(order)[0]
    quiet = maximize(lambda p, s: objective(p, s, order), none, none, limits, (none, level))
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
    """The highest order whose evidence is within PATIENCE of the best; above FREE it must be the best itself.

    So smooth a load is claimed with so little error that the record has to ask for it.

    >>> smoothest({1: -10.0, 2: 0.0, 3: -4.0, 4: -9.0})
    3
    >>> smoothest({4: 0.0, 6: 0.9}), smoothest({4: 0.0, 6: 1.1})
    (4, 6)
    """
    free = {order: value for order, value in evidence.items() if order <= FREE}
    top = max(evidence, key=lambda order: evidence[order])
    if top > FREE and evidence[top] > max(free.values(), default=-np.inf) + ASKED:
        return top
    return max(order for order, value in free.items() if value > max(free.values()) - PATIENCE)
