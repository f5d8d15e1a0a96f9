"""Smoothness and noise of driven channels by maximum likelihood, the order of their prior by evidence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from forceid.flight.channels import (
    Start,
    driven,
    load_chain,
    model_in_pieces,
    runs_of,
    search_box,
    start_of,
)
from forceid.flight.color import Color
from forceid.flight.pieces import Pieces
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import Tuned
from forceid.flight.priors.stated import Stated
from forceid.flight.spectral_start import Box, Channels, Peak, first_sight, sight
from forceid.kalman.building.lines import Line, along_axes
from forceid.kalman.building.process import Process, matern
from forceid.kalman.engines import Engine, for_tuning
from forceid.kalman.tuning.search import WORST, maximize, promise_apart
from forceid.records import Array, Flags
from forceid.significance import NUMBER, OUTLIER, PATIENCE

ORDERS = (1, 2, 3, 4, 6)  # of the priors that are tried, from rough to smooth
MIDDLE = ORDERS[len(ORDERS) // 2]  # where nothing is known yet, or orders are no matter
MISSED = 2  # orders in a row that may be no likelier: the search for one may have missed its peak
FREE = 4  # order of a prior up to which the smoothest is taken that no rougher one beats clearly
DOUBT = (
    PATIENCE  # of a log-likelihood: by as much a spectrum may err between two orders, short records the most
)
AT_LIMIT = 0.05  # of a logarithm: a noise this near to the least allowed would be smaller
PROBE = 0.02  # of a logarithm: over which a likelihood is differenced; a hundredth of its top's width
LEAK = 0.01  # of the load on the strongest axis


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
    near: Tuned | None = None,
    color: Color | None = None,
    pieces: Pieces | None = None,
    stated: Stated | None = None,
) -> Tuned:
    """Matern prior of the loads that drive channels z'' = gain * load, by maximum likelihood.

    time (time,) s; z (time, axis), NaN = missing; gain: 1/kg for forces and a mass center; noise_var (time,
    axis) of z as stated, drift (axis,) of `driven`; noise_range: smallest and largest factor on its std, one
    for all axes that do not ask for their own. Of the orders, the smoothest that no rougher one beats by
    e^PATIENCE; on an axis where a varying load is not e^PATIENCE times as likely as a constant one, the
    constant. lines: that the load is known to hold beside, with directions along the axes of z. engine: the
    fastest, if none is given. near: a prior about where this one is, which has its order. color: of the
    noise, None for white; pieces: in which the load comes, with their sizes. stated: what is known of the
    prior, and not searched for.
    """
    known = Stated() if stated is None else stated
    orders = orders if known.order is None else (known.order,)
    axes, likelihood, runs = z.shape[1], for_tuning(engine).log_likelihood, runs_of(time, z, noise_var)
    box = search_boxes(time, z, gain, axes, known)

    def numbers(points: Array, order: int) -> tuple[Array, Array]:
        return known.held(order, *natural(points, order))

    def objective(points: Array, levels: Array, order: int) -> Array:
        shape = points.shape[:-1]
        std, rate = numbers(points.reshape(-1, 2), order)
        axis = np.broadcast_to(np.arange(axes)[:, None], shape).ravel()
        noise = np.broadcast_to(np.exp(2 * levels)[..., None], shape).ravel()
        total = np.zeros(len(std))
        for t, y, var in runs:
            held = along_axes(lines, axis)
            start, seen = start_of(t, y, gain), (gain, var[:, axis] * noise, drift[axis] * noise)

            def chain(haste: float, start: Start = start, held: list[Process] = held) -> Process:
                return load_chain(matern(order, std, haste * rate), start, held)

            if pieces is None:
                model = driven(chain(1.0), *seen, np.diff(t), color)
            else:
                model = model_in_pieces(chain, *seen, t, order, color)([pieces.of(axis)])
            total += likelihood(model, y[:, axis, None], OUTLIER)
        return total.reshape(shape)

    def search(
        order: int,
        shared: tuple[ArrayLike, ArrayLike],
        same: Flags,
        start: tuple[Array, ArrayLike] | None = None,
        load: bool = True,
    ) -> Peak:
        if start is None and seen is not None:
            start = likeliest(order, shared, same)
        bounds = box(order) if load else (box(order)[0],) * 2
        return maximize(lambda p, s: objective(p, s, order), *bounds, shared, start, same)

    def likeliest(
        order: int, shared: tuple[ArrayLike, ArrayLike], same: Flags, *more: Array
    ) -> tuple[Array, Array]:
        """The likeliest of where a search may begin, and of `more` points (axis, 2) under the first noise."""
        assert seen is not None
        points, levels = seen.starts(order, shared, same)
        points = np.concatenate([points, np.reshape(more, (-1, axes, 2))])
        levels = np.concatenate([levels, np.tile(levels[:1], (len(more), 1))])
        value = objective(points[:, :, None], levels, order)[..., 0]
        alone = np.eye(axes, dtype=bool) if np.array_equal(*shared) else same
        which = (np.nan_to_num(value, nan=WORST, neginf=WORST) @ alone).argmax(0)
        return points[which, np.arange(axes)], levels[which, np.arange(axes)]

    def pays_apart(order: int) -> Callable[[Peak], bool]:
        def pays(peak: Peak) -> bool:
            at, level, _ = peak
            gain = promise_apart(lambda p, s: objective(p, s, order), *box(order), limits, at, level)
            return gain > PATIENCE / 2  # slopes at a point tell half of what they decide on

        return pays

    def tuned(order: int, at: Array, level: Array, value: float, moved: Flags) -> Tuned:
        at_limit = limits[1] > limits[0] and np.mean(level[moved] - limits[0] < AT_LIMIT) > 0.5
        return Tuned(Matern(order, *numbers(at, order)), np.exp(level), bool(at_limit), value, pieces)

    limits = (float(np.log(noise_range[0])), float(np.log(noise_range[1])))
    level: Array = np.full(axes, limits[0])
    together, first, seen = np.ones((axes, axes), bool), None, None
    channels = Channels(runs, gain, drift, lines, color, box, for_tuning(engine))
    free = known.std is None and not known.paced
    stationary = channels.even and pieces is None and free  # what has a spectrum
    if near is not None:
        kernel, level = near.kernel, np.clip(np.log(near.noise), *limits)
        assert isinstance(kernel, Matern)
        orders, first = (kernel.order,), (np.clip(points_of(kernel), *box(kernel.order)), level)
        seen = sight(channels, kernel.order, *first) if stationary else None
    else:
        unstated = limits[0] < 0.0
        seen = first_sight(time, z, channels, limits if unstated else limits[:1] * 2) if stationary else None
        if unstated:  # a first look at the noise, under a prior of middle order
            (_, level, _), _ = by_axis(lambda same: search(2, limits, same), axes, pays_apart(2))
    if seen is not None and near is None:
        expected = seen.peaks(orders, (level, level), together)[2]
        orders = in_doubt(dict(zip(orders, expected.sum(1).tolist(), strict=True)))
    found: dict[int, Peak] = {}
    worse = 0
    for order in sorted(orders, reverse=True):  # down from the smoothest, as long as roughness pays
        if seen is not None and near is None:
            # or as the order before
            before = [np.clip(seen.alike(found[last][0], last, order), *box(order)) for last in [*found][-1:]]
            first = likeliest(order, (level, level), together, *before)
        found[order] = search(order, (level, level), together, first)
        pays = found[order][2].sum() > max(value.sum() for _, _, value in found.values()) - NUMBER
        worse = 0 if pays else worse + (order <= FREE)
        if worse == MISSED:
            break
    order = smoothest({order: float(value.sum()) for order, (_, _, value) in found.items()})
    peak, same = found[order], np.eye(axes, dtype=bool)
    if limits[1] > limits[0]:
        start = (peak[0], level)
        peak, same = by_axis(lambda same: search(order, limits, same, start), axes, pays_apart(order))
    at, level, value = peak
    if known.std is not None:  # then it varies
        return tuned(order, at, level, float(value.sum()), np.ones(axes, bool))
    none = box(order)[0]
    each = objective(np.stack([at, none], 1)[None], level[None], order)[0]
    quiet = none, level, each[:, 1]
    if limits[1] > limits[0]:
        quiet = search(order, limits, same, quiet[:2], load=False)
    if value.sum() - quiet[2].sum() < PATIENCE * axes:
        return tuned(order, *quiet[:2], float(quiet[2].sum()), np.ones(axes, bool))
    still = each[:, 0] - each[:, 1] < PATIENCE
    best = tuned(order, at, level, float(value.sum()), ~still if not still.all() else still)
    if still.any():
        # the axes are known to about a hundredth, and by that much of it a load leaks to a still one
        strong = np.where(still, 0.0, best.kernel.std).argmax()
        kernel = best.kernel.of(np.where(still, strong, np.arange(axes)))
        best = replace(best, kernel=kernel.scaled(np.where(still, LEAK, 1.0)))
    return best


def search_boxes(time: Array, z: Array, gain: float, axes: int, known: Stated | None = None) -> Box:
    """Lowest and highest search points (axis, 2) of an order, on channels z (time, axis)."""
    edges, known = search_box(time, z, gain, 0), Stated() if known is None else known

    def box(order: int) -> tuple[Array, Array]:
        lower, upper = (np.tile([level + order * rate, rate], (axes, 1)) for level, rate in edges)
        for at, value in ((0, known.std), (1, known.rate_at(order))):
            if value is not None:  # what a coordinate that does not move stands for is taken from `known`
                lower[:, at] = upper[:, at] = np.log(value)
        return lower, upper

    return box


def by_axis(
    search: Callable[[Flags], Peak], axes: int, pays_apart: Callable[[Peak], bool]
) -> tuple[Peak, Flags]:
    """The peak under one noise for all axes, or under more where each is e^PATIENCE times as likely.

    search(same (axis, axis)): the peak where axes share a noise; pays_apart: whether its likelihood may
    gain as much where none do. Also returned: which of them do. So an axis that shows
    no noise, as of a planar video or an encoder, has no say in that of the others.
    """
    same: Flags = np.ones((axes, axes), bool)
    best = search(same)
    if axes == 1 or not pays_apart(best):
        return best, same
    apart = np.eye(axes, dtype=bool)
    own = search(apart)
    if own[2].sum() < best[2].sum() + PATIENCE:
        return best, same
    cost = PATIENCE * (axes - 1)
    found = [(float(best[2].sum()), best, same), (float(own[2].sum()) - cost, own, apart)]
    order = own[1].argsort()
    for cuts in product((False, True), repeat=axes - 1):
        if 0 < sum(cuts) < axes - 1:
            group = np.zeros(axes, int)
            group[order] = np.cumsum([0, *cuts])
            same = group[:, None] == group
            peak = search(same)
            found.append((float(peak[2].sum()) - PATIENCE * sum(cuts), peak, same))
    _, best, same = max(found, key=lambda one: one[0])
    return best, same


def natural(points: Array, order: int) -> tuple[Array, Array]:
    """The std and rate (...) of search points (..., 2): log of std * rate^(order - 1/2), and log rate.

    The first is the level at high frequency, which a record fixes far better than std and rate alone.
    """
    rate = np.exp(points[..., 1])
    return np.exp(points[..., 0]) / rate ** (order - 0.5), rate


def points_of(kernel: Matern) -> Array:
    """The search points (axis, 2) of a kernel: those whose `natural` it is."""
    level = np.log(np.maximum(kernel.std, np.finfo(float).tiny)) + (kernel.order - 0.5) * np.log(kernel.rate)
    return np.stack([level, np.log(kernel.rate)], 1)


def in_doubt(expected: dict[int, float]) -> tuple[int, ...]:
    """The orders that may be the `smoothest`, or decide it, where evidence is expected with a DOUBT."""
    first = smoothest(expected)
    if len(expected) == 1:
        return (first,)
    turns = {
        order: smoothest(expected | {order: value + off})
        for order, value in expected.items()
        for off in ((-DOUBT,) if order == first else (DOUBT,))
    }
    others = {order for order, found in turns.items() if found != first} | set(turns.values())
    if others == {first}:
        return (first,)
    free = {order: value for order, value in expected.items() if order <= FREE}
    return tuple(sorted({*others, first, max(free or expected, key=lambda order: expected[order])}))


def smoothest(evidence: dict[int, float]) -> int:
    """The highest order whose evidence is within PATIENCE of the best; above FREE it must be the best itself.

    So smooth a load is claimed with so little error that the record has to ask for it.
    """
    free = {order: value for order, value in evidence.items() if order <= FREE}
    top = max(evidence, key=lambda order: evidence[order])
    if top > FREE and evidence[top] > max(free.values(), default=-np.inf) + NUMBER:
        return top
    return max(order for order, value in free.items() if value >= max(free.values()) - PATIENCE)
