"""What a window takes from a load, sample by sample: the bias of two derivatives, at ends and gaps as well.

A window is a linear map of the path, so what it makes of a wave of the load is what it makes of the path of
that wave: exactly, on any clock and across what is lost. The mean squared bias of a load that varies alike
all along is the sum over its waves. Its spectrum is that of a Matern load, of the order where little tells
orders apart; size and rate are those by which two windows come out as large, and as far apart, as they do on
the record. A load faster than half the rate of the samples, or than a filter lets pass, counts as that fast:
no record tells it from a larger one that is faster.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from forceid.flight.color import LowPassed
from forceid.flight.priors.matern import UNTOLD_ORDER
from forceid.kalman.building.process import matern_density
from forceid.motion import Window, WindowChoice, derivatives, error_of_square, smooth_taper
from forceid.records import Array, Flags

WAVES = 48  # less than a tenth of a decade apart in 5000 samples: a spectrum bends over a decade
WAVES_IN_RECORD = 0.5  # of the slowest load: slower ones hardly bend the path
WAVES_IN_STEP = 8.0  # of the fastest load: of one that lasts a step, 1e-4 of the power is beyond
NUMBERS = 2**21  # waves times samples that are held at once
LOAD_RATES = 64  # rates of a load that are tried: a tenth from one to the next in a record of 200 samples


def bias_of(
    time: Array, seen: Flags, choice: WindowChoice, noise: Array, filtered: LowPassed | None = None
) -> Array:
    """Mean squared bias (time,) of the load under the window chosen, summed over its axes.

    seen (time,): samples of the path that are known; noise (time,): variance of the load that those give it,
    summed over axes; filtered: what passed of the path at the source, which takes from the load as well.
    """
    step = float(np.median(np.diff(time)))
    f = np.geomspace(WAVES_IN_RECORD / np.ptp(time), WAVES_IN_STEP / step, WAVES)
    some = max(NUMBERS // len(time), 1)
    waves = [Waves(time, seen, f[k : k + some], filtered) for k in range(0, WAVES, some)]
    known, load = np.isfinite(noise) & np.isfinite(choice.target).all(1), choice.target
    taper = smooth_taper(len(time)) * known
    weight = np.where(known, taper / noise, 0.0)
    weight /= weight.sum()
    means = np.concatenate([one.means(choice, weight) for one in waves], 1)
    fastest = 0.5 / step if filtered is None else min(filtered.cut, 0.5 / step)
    rate = 2 * np.pi * np.geomspace(f[0], fastest, LOAD_RATES)[:, None]
    share = 2 * matern_density(UNTOLD_ORDER, 1.0, rate, 2 * np.pi * f) * np.gradient(f)
    own, off, apart = means @ share.T
    level = float(weight[known] @ noise[known])
    size = float(weight[known] @ ((load - weight[known] @ load[known]) ** 2)[known].sum(1)) - level
    size = max(size, 0.0) + level * error_of_square(taper, choice.window, load.shape[1])
    # no less than the best window has in theory: there noise falls as length^-5
    least = level * 5 / (2 * choice.window.bias_power)
    power = size / own
    k = max(first_above(power * apart, choice.apart * level), first_above(power * off, least))
    each = zip(waves, np.split(share[k], range(some, WAVES, some)), strict=True)
    taken = sum((one.taken(choice.window) @ part for one, part in each), np.zeros(len(time)))
    return np.asarray(max(power[k], least / off[k]) * taken)


def first_above(values: Array, limit: float) -> int:
    """Index of the first of values (rate,) that reaches a limit, the last where none does."""
    reached = np.append(values >= limit, True)
    return min(int(np.argmax(reached)), len(values) - 1)


@dataclass(frozen=True)
class Waves:
    """Loads that are waves of frequency (wave,) Hz, of which a path seen (time,) at times (time,) s tells."""

    time: Array
    seen: Flags
    frequency: Array
    filtered: LowPassed | None

    @cached_property
    def load(self) -> Array:
        """The waves (time, wave), complex."""
        return np.asarray(np.exp(2j * np.pi * self.frequency * (self.time[:, None] - self.time.mean())))

    def through(self, window: Window) -> Array:
        """What a window makes of them (time, wave), complex."""
        f = self.frequency
        passed = np.ones(len(f)) if self.filtered is None else np.sqrt(self.filtered.power(f))
        path = -self.load / (2 * np.pi * f) ** 2 * passed
        z = np.where(self.seen[:, None], np.concatenate([path.real, path.imag], 1), np.nan)
        d = derivatives(self.time, z, window).second
        return np.asarray(d[:, : len(f)] + 1j * d[:, len(f) :])

    def taken(self, window: Window) -> Array:
        """Power (time, wave) of what a window takes from them."""
        return np.asarray(np.abs(self.through(window) - self.load) ** 2)

    def means(self, choice: WindowChoice, weight: Array) -> Array:
        """Weighted mean power (3, wave) of what the window makes of them, of what it takes, and of what is
        between it and the window that it was compared with.
        """
        own, other = self.through(choice.window), self.through(choice.compared)
        known = weight > 0
        parts = own, own - self.load, own - other
        return np.stack([weight[known] @ np.nan_to_num(np.abs(part[known])) ** 2 for part in parts])
