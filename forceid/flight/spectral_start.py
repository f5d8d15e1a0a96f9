"""Where the search for the prior of a load begins: the peak of Whittle's likelihood, of whitened channels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forceid.flight.channels import driven, lags, load_chain, second_difference, start_of
from forceid.flight.color import Color
from forceid.flight.whittle import UNIT, Ordinates, Spectrum, is_even, ordinates
from forceid.kalman.building.lines import Line, along_axes
from forceid.kalman.building.process import matern
from forceid.kalman.engines import Engine
from forceid.records import Array, Flags
from forceid.rounding import SINGLE
from forceid.significance import OUTLIER, PATIENCE

ENOUGH_SAMPLES = 100  # of a stretch: start, speed and a constant load take three of its fifty ordinates
FIRST_ORDER = 2  # order of references: continuous, and rough enough to leave no wave unseen
BEGUN_AT = 8  # at which a search may begin: about two to an octave of a thousand samples
WHITENINGS = 4  # at most: the second is of a reference about right

Box = Callable[[int], tuple[Array, Array]]  # lowest and highest search points (axis, 2) of an order
Peak = tuple[Array, Array, Array]  # search points (axis, 2), logarithms of the noise, values (axis,)


@dataclass(frozen=True)
class Channels:
    """What a search looks at: stretches of channels z'' = gain * load, and what their model takes besides.

    drift (axis,), lines along the axes, color: as in `tune_loads`; box: of its search points.
    """

    runs: list[tuple[Array, Array, Array]]
    gain: float
    drift: Array
    lines: tuple[Line, ...]
    color: Color | None
    box: Box
    engine: Engine

    @property
    def even(self) -> bool:
        """Whether the stretches have ordinates: enough samples, on a clock that is about even."""
        return all(np.isfinite(y).all(1).sum() >= ENOUGH_SAMPLES and is_even(t) for t, y, _ in self.runs)


@dataclass(frozen=True)
class Sight:
    """Channels whitened by a reference."""

    channels: Channels
    spectrum: Spectrum

    def peaks(
        self,
        orders: tuple[int, ...],
        shared: tuple[ArrayLike, ArrayLike],
        same: Flags,
        near: Array | None = None,
    ) -> tuple[Array, Array, Array]:
        """Likeliest points (order, axis, 2), noise and values (order, axis); shared: bounds of the noise."""
        return self.spectrum.peaks(np.array(orders), self.edges(orders, shared), same, near)

    def edges(self, orders: tuple[int, ...], shared: tuple[ArrayLike, ArrayLike]) -> tuple[Array, Array]:
        """Lowest and highest points and noise (order, axis, 3) of orders."""
        box = [self.channels.box(order) for order in orders]

        def edge(side: int) -> Array:
            points = np.stack([each[side] for each in box])
            return np.concatenate([points, np.broadcast_to(shared[side], points.shape[:2])[..., None]], 2)

        return edge(0), edge(1)

    def starts(self, order: int, shared: tuple[ArrayLike, ArrayLike], same: Flags) -> tuple[Array, Array]:
        """Likeliest points (start, axis, 2) and noise (start, axis): first of all, then at some rates.

        Ordinates say little of what is slower than the record, in which a load may have most of its size.
        """
        low, high = self.edges((order,) * (1 + BEGUN_AT), shared)
        rates = np.linspace(low[0, :, 1], high[0, :, 1], BEGUN_AT)
        low[1:, :, 1] = high[1:, :, 1] = rates
        points, noise, _ = self.spectrum.peaks(np.full(1 + BEGUN_AT, order), (low, high), same)
        return points, noise

    @property
    def value(self) -> float:
        """Log-likelihood of the reference."""
        return -float(self.spectrum.power.sum())

    def peak(self, order: int, shared: tuple[ArrayLike, ArrayLike], same: Flags) -> Peak:
        """The same of one order."""
        points, noise, value = self.peaks((order,), shared, same)
        return points[0], noise[0], value[0]

    def alike(self, points: Array, was: int, order: int) -> Array:
        """Search points (axis, 2) of an order whose load is about that of an order that `was`.

        As strong at the slowest ordinate, and where it meets the noise.
        """
        slow, E = self.spectrum.w[0, 0] ** 2, np.exp(2 * points[:, 1])
        load = self.spectrum.load(points, np.array([was]))[0]
        meets = np.abs(np.log(load / self.spectrum.noise)).argmin(1)
        fast = self.spectrum.w[0, np.maximum(meets, 1)] ** 2
        falls = ((E + fast) / (E + slow)) ** (was / order)
        corner = np.maximum((fast - falls * slow) / (falls - 1), SINGLE * slow)
        level = np.log(UNIT[was] / UNIT[order]) + order * np.log(corner + fast) - was * np.log(E + fast)
        return np.stack([points[:, 0] + 0.5 * level, 0.5 * np.log(corner)], 1)


def first_sight(time: Array, z: Array, channels: Channels, limits: tuple[float, float]) -> Sight:
    """Channels z (time, axis) about as white as the likeliest prior of one order makes them.

    From a load that meets the noise where second differences of z are smallest; limits: of the noise.
    """
    size, at = np.full(z.shape[1], np.finfo(float).tiny), np.ones(z.shape[1])
    bent = [(lag, d) for lag in lags(z) if len(d := second_difference(time, z, lag))]
    if bent:
        sizes = np.array([np.sqrt((d**2).mean(0)) for _, d in bent]) / channels.gain
        least = sizes.argmin(0)
        size, at = np.maximum(sizes.min(0), size), np.array([lag for lag, _ in bent])[least]
    rate = -np.log(at * np.median(np.diff(time)))
    points = np.stack([np.log(size) + (FIRST_ORDER - 0.5) * rate, rate], 1)
    points, same = np.clip(points, *channels.box(FIRST_ORDER)), np.ones((z.shape[1],) * 2, bool)
    level: Array = np.full(z.shape[1], limits[0])
    for _ in range(WHITENINGS):
        found = sight(channels, FIRST_ORDER, points, level)
        points, level, value = found.peak(FIRST_ORDER, limits, same)
        if value.sum() < found.value + PATIENCE:
            break
    return found


def sight(channels: Channels, order: int, points: Array, level: Array) -> Sight:
    """Channels as a reference of search points (axis, 2) and logarithms of noise (axis,) whitens them."""
    rate, noise = np.exp(points[:, 1]), np.exp(2 * level)
    std = np.exp(points[:, 0]) / rate ** (order - 0.5)
    parts: list[tuple[Ordinates, Array, Array]] = []
    for t, y, var in channels.runs:
        held = along_axes(channels.lines)
        chain = load_chain(matern(order, std, rate), start_of(t, y, channels.gain), held)
        model = driven(chain, channels.gain, var * noise, channels.drift * noise, np.diff(t), channels.color)
        v = channels.engine.innovations(model, y).T
        seen = np.isfinite(v)
        share = seen.mean(1, keepdims=True)
        at = ordinates(len(t), float(np.ptp(t)) / (len(t) - 1), channels.color)
        v = np.where(seen, np.clip(v, -OUTLIER, OUTLIER), 0.0)
        power = np.abs(np.fft.rfft(v)[:, 1:-1]) ** 2 / (share * len(t))
        typical = np.where(seen, var.T, 0.0).sum(1, keepdims=True) / (share**2 * len(t))
        stated = typical * at.white + channels.drift[:, None] * at.drift
        parts.append((at, stated, np.add.reduceat(power, at.first, axis=1)))
    w, count = np.concatenate([at.w for at, *_ in parts], 1), np.concatenate([at.count for at, *_ in parts])
    stated, power = (np.concatenate([part[k] for part in parts], 1) for k in (1, 2))
    blank = Spectrum(channels.gain, w, count, stated, power, stated)
    return Sight(channels, blank.about(points, np.array([order]), level))
