"""Whittle's likelihood of driven channels, and where it is largest: for all orders and axes at once.

Of innovations that a reference has whitened: under another load and noise their spectrum is that of these
over that of the reference. A candidate costs a sum over groups of ordinates, and its slopes are exact.
Source: Whittle (1953); the steps are those of Fisher's scoring.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.compiled import engine as compiled
from forceid.flight.color import Color
from forceid.kalman.building.process import matern_density
from forceid.records import Array, Flags, Indices
from forceid.rounding import ITERATIONS, SINGLE
from forceid.significance import PATIENCE, TENTH, THOUSANDTH

Peaks = tuple[Array, Array, Array]  # search points (order, axis, 2), noise and values (order, axis)
Edges = tuple[Array, Array]  # lowest and highest (order, axis, 3): of search points and noise

IN_OCTAVE = 8  # groups of ordinates: over one, a spectrum that falls by w^16 changes by a factor of four
IMAGES = (0, -1)  # of a spectrum, that samples fold onto its own; at most a percent is in the next
RATES_SEEN, CROSSINGS_SEEN, NOISES_SEEN = 8, 10, 7  # starts: about two to an octave of a thousand samples
SHIFT = 0.5  # of a step, off those of an even clock: beyond it, a wave near the highest turns by a quarter
LONGEST_STEP = 1.0  # of a logarithm: about as far as a spectrum is known to bend as it does here


@dataclass(frozen=True)
class Ordinates:
    """Groups of the ordinates of a stretch: their first ones and how many each holds.

    w (image, group) rad/s; white and drift (group,): spectral density of a noise of unit variance, and of one
    that adds up at a unit a second.
    """

    first: Indices
    count: Indices
    w: Array
    white: Array
    drift: Array


def is_even(time: Array) -> bool:
    """Whether a clock (time,) is so near to an even one that samples by number have ordinates by time.

    >>> is_even(np.array([0.0, 1.3, 2.0, 2.8, 4.0])), is_even(np.array([0.0, 1.0, 2.0, 3.0, 7.0]))
    (True, False)
    """
    tick = np.linspace(time[0], time[-1], len(time))
    return bool(np.ptp(time - tick) < 2 * SHIFT * (tick[1] - tick[0]))  # whose ticks begin anywhere


def ordinates(samples: int, step: float, color: Color | None) -> Ordinates:
    """Of so many samples: alone where they are slow, in groups to the octave further on."""
    each = 2 * np.pi * np.fft.rfftfreq(samples, step)[1:-1]
    index, alone = np.arange(1, len(each) + 1), 2 * IN_OCTAVE
    group = np.where(index <= alone, index, alone + np.ceil(IN_OCTAVE * np.log2(index / alone)))
    first = np.flatnonzero(np.diff(group, prepend=0))
    count = np.diff(first, append=len(each))
    w = np.add.reduceat(each, first) / count
    white = step * (np.ones(len(w)) if color is None else color.density(w))
    drift = (step / (2 * np.sin(0.5 * w * step))) ** 2
    return Ordinates(first, count, w + 2 * np.pi / step * np.array(IMAGES)[:, None], white, drift)


@dataclass(frozen=True)
class Spectrum:
    """What a reference leaves of channels, whitened: power (axis, group) of innovations, over ordinates.

    One an ordinate where the reference is right. w (image, group) rad/s, count (group,); noise (axis, group):
    density of that in z as stated, total: of all that the reference expects in z; gain: of the load on z''.
    """

    gain: float
    w: Array
    count: Indices
    noise: Array
    power: Array
    total: Array

    def load(self, points: Array, order: Array) -> tuple[Array, Array]:
        """Density (..., group) in z of loads at search points (..., 2), and its slope along the second."""
        order, square = order[..., None, None], np.exp(2 * points[..., 1, None, None])
        corner = 1 / (square + self.w**2)
        image = corner**order / self.w**4
        level = self.gain**2 * UNIT[order[..., 0]] * np.exp(2 * points[..., 0, None])
        slope = -2 * order * square * corner * image
        return level * image.sum(-2), level * slope.sum(-2)

    def value(self, density: Array, axis: Indices | slice = slice(None)) -> Array:
        """Log-likelihood (...) of densities (..., group) in z, of axes that come last or as given."""
        ratio = density / self.total[axis]
        return np.asarray(-(np.log(ratio) @ self.count) - (self.power[axis] / ratio).sum(-1))

    def about(self, points: Array, order: Array, level: Array) -> Spectrum:
        """The same of innovations under a reference of points (axis, 2), an order (1,) and noise (axis,)."""
        load = self.load(points, order)[0]
        return replace(self, total=load + np.exp(2 * level)[:, None] * self.noise)

    def slopes(self, x: Array, order: Array) -> tuple[Array, Array, Array]:
        """Log-likelihood (order, axis) at search points and noise x (order, axis, 3), slope, information."""
        if compiled is not None:
            each = self.w, self.count, self.noise, self.power, self.total
            value, slope, bend = compiled.slopes(self.gain, *each, x, order, UNIT)
            return value, slope, bend
        load, along = self.load(x[..., :2], order[:, None])
        noisy = np.exp(2 * x[..., 2, None]) * self.noise
        total = load + noisy
        D = np.stack([2 * load, along, 2 * noisy], -2) / total[..., None, :]
        slope = (D @ (self.power * self.total / total - self.count)[..., None])[..., 0]
        return self.value(total), slope, (D * self.count) @ D.mT

    def peaks(self, orders: Array, edges: Edges, same: Flags, near: Array | None = None) -> Peaks:
        """The likeliest points and noise of each order (order,) and axis, by steps from a grid.

        same (axis, axis): which axes share a noise; near (order, axis, 2): points to step from instead, where
        such are known.
        """
        points, noise = self.grid(orders, edges, same) if near is None else (near, edges[0][..., 2])
        (low, high), share = edges, same.astype(float)
        x = best_x = np.concatenate([points, noise[..., None]], -1)
        reach = np.ones(x.shape[:2])
        for turn in range(ITERATIONS):
            value, own_slope, own_bend = self.slopes(x, orders)
            if turn == 0:
                best, slope, bend = value, own_slope, own_bend
            better = (value @ share >= best @ share)[..., None]
            best_x, slope = np.where(better, x, best_x), np.where(better, own_slope, slope)
            bend, best = np.where(better[..., None], own_bend, bend), np.where(better[..., 0], value, best)
            reach = np.where(better[..., 0], np.minimum(2 * reach, 1.0), 0.25 * reach)
            step = scoring_step(slope, bend, low - best_x, high - best_x, share)
            promise = (slope * step).sum((1, 2))
            hopeless = best.sum(1) + promise < best.sum(1).max() - 2 * PATIENCE
            if (hopeless | (promise < TENTH)).all():
                break
            size = (np.abs(step).max(-1)[:, None, :] * share).max(-1)
            x = best_x + step * np.minimum(reach, LONGEST_STEP / np.maximum(size, THOUSANDTH))[..., None]
        return best_x[..., :2], best_x[..., 2], best

    def grid(self, orders: Array, edges: Edges, same: Flags) -> tuple[Array, Array]:
        """The best points (order, axis, 2) and noise of a grid: rates, and where the load meets the noise."""
        low, high = edges
        rate = np.linspace(low[..., 1], high[..., 1], RATES_SEEN, axis=-1)
        unit = self.load(np.stack([0 * rate, rate], -1), orders[:, None, None])[0][..., None, :]
        where = np.linspace(0, len(self.count) - 1, CROSSINGS_SEEN).astype(int)
        meets = 0.5 * np.log(self.noise[:, None, where] / unit[..., 0, where])
        size = np.clip(meets, low[..., None, None, 0], high[..., None, None, 0])
        load = np.exp(2 * size)[..., None] * unit
        free = bool((high[..., 2] > low[..., 2]).any())
        levels = np.linspace(low[0, :, 2], high[0, :, 2], NOISES_SEEN if free else 1)
        axis = np.arange(len(same))[:, None, None]
        noise = np.exp(2 * levels)[:, None, :, None, None, None] * self.noise[axis]
        value = self.value(load + noise, axis).reshape(*levels.shape[:1], *rate.shape[:2], -1)
        which = (value.max(-1) @ same).argmax(0)
        at = np.take_along_axis(value, which[None, ..., None], 0)[0].argmax(-1)[..., None]
        size = np.take_along_axis(size.reshape(*at.shape[:2], -1), at, -1)
        points = np.concatenate([size, np.take_along_axis(rate, at // CROSSINGS_SEEN, -1)], -1)
        return points, levels[which, np.arange(len(same))]


# density of Matern loads of each order at its search point of zeros, but for its fall
UNIT = np.array([0.0, *(float(matern_density(order, 1.0, 1.0, 0.0)) for order in range(1, 7))])


def scoring_step(slope: Array, bend: Array, down: Array, up: Array, share: Array) -> Array:
    """Step (order, axis, 3) uphill between bounds; the last coordinate is one for axes that share it.

    slope, and bend (order, axis, 3, 3) of the information. A coordinate that would leave its bounds goes to
    the bound, and the others make the best of that.
    """
    if compiled is not None:
        return np.asarray(compiled.scoring_step(slope, bend, down, up, share, SINGLE))
    along, held = slope.copy(), np.zeros(slope.shape)
    along[..., 2] = slope[..., 2] @ share
    stays = ((down >= 0) & (along <= 0)) | ((up <= 0) & (along >= 0))
    for _ in range(slope.shape[-1]):
        step = held + free_step(slope - (bend @ held[..., None])[..., 0], bend, stays, share)
        out = (step < down) | (step > up)
        if not out.any():
            break
        held, stays = np.where(out, np.clip(step, down, up), held), stays | out
    return np.clip(step, down, up)


def free_step(slope: Array, bend: Array, stays: Flags, share: Array) -> Array:
    """The same without bounds, of all coordinates but those that stay."""
    ga, gb, gc = np.moveaxis(np.where(stays, 0.0, slope), -1, 0)
    H = np.where(stays[..., None] | stays[..., None, :], 0.0, bend)
    a, b, c = np.moveaxis(np.diagonal(H, axis1=-2, axis2=-1) * (1 + SINGLE) + SINGLE, -1, 0)
    ab, ac, bc = H[..., 0, 1], H[..., 0, 2], H[..., 1, 2]
    det = a * b - ab**2
    tied_a, tied_b = (b * ac - ab * bc) / det, (a * bc - ab * ac) / det
    level = ((gc - tied_a * ga - tied_b * gb) @ share) / ((c - tied_a * ac - tied_b * bc) @ share)
    ga, gb = ga - ac * level, gb - bc * level
    return np.stack(
        [(b * ga - ab * gb) / det, (a * gb - ab * ga) / det, np.where(stays[..., 2], 0.0, level)], -1
    )
