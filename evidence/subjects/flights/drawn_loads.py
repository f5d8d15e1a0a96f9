"""Loads drawn from a known Matern prior, smooth functions of time with all their integrals in closed form.

A sum of many sinusoids whose powers follow the Matern spectrum; in a long record, where so many would stand
apart as lines, a quintic spline through values drawn by their covariance. No code is shared
with the estimators.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.special import erf

from forceid.records import Array
from forceid.scenes.drawn_loads import spectrum, waves

LOAD_ORDER = 3  # of the Matern loads: twice differentiable
CUT_RATES = 12.0  # rates at which the spectrum ends: 1e-5 of its power lies beyond
SINUSOIDS = 260  # sinusoids
SLOWEST = 0.01  # rates below which a long record holds none of it, so that the body stays where it is
KNOTS_PER_MEMORY = 8.0  # of the spline, in the time that a load remembers


@dataclass(frozen=True)
class Drawn:
    """A load: sum of a cos(w t) + b sin(w t), and a pulse beside it.

    w (line,) rad/s; a, b (line, load) N or N m; pulse (load,) N s, N m s: impulse of a Gaussian pulse at
    `when` s, of standard deviation `width` s; curve: the load beside both in time, of as many components.
    """

    w: Array
    a: Array
    b: Array
    pulse: Array
    when: float = 0.0
    width: float = 1.0
    curve: BSpline | None = None

    def at(self, time: Array) -> Array:
        """The load (time, load)."""
        x = (time - self.when) / self.width
        bell = np.exp(-0.5 * x**2) / (self.width * np.sqrt(2 * np.pi))
        return np.asarray(
            waves(time, self.w, self.a, self.b) + bell[:, None] * self.pulse + self._curve(time)
        )

    def impulse(self, time: Array) -> Array:
        """Its integral from t = 0 (time, load)."""
        w = self.w[:, None]
        risen = self._risen(time) - self._risen(np.zeros(1))
        return np.asarray(
            waves(time, self.w, -self.b / w, self.a / w)
            + (self.b / w).sum(0)
            + risen[:, None] * self.pulse
            + self._curve(time, 1)
        )

    def second(self, time: Array) -> Array:
        """Its second integral from t = 0 (time, load)."""
        w, t = self.w[:, None], time[:, None]
        drawn = waves(time, self.w, -self.a / w**2, -self.b / w**2)
        start = (self.a / w**2).sum(0) + t * (self.b / w).sum(0)
        zero = np.zeros(1)
        ramp = self._ramp(time) - self._ramp(zero) - self._risen(zero) * time
        return np.asarray(drawn + start + ramp[:, None] * self.pulse + self._curve(time, 2))

    def _curve(self, time: Array, times: int = 0) -> Array:
        """The curve, integrated once or twice from t = 0."""
        if self.curve is None:
            return np.zeros((len(time), self.a.shape[1]))
        one = self._integrals[times]
        start, rise = one(0.0), self._integrals[1](0.0)
        return np.asarray(
            one(time) - (start if times else 0.0) - (rise * time[:, None] if times == 2 else 0.0)
        )

    @cached_property
    def _integrals(self) -> tuple[BSpline, ...]:
        assert self.curve is not None
        return self.curve, self.curve.antiderivative(1), self.curve.antiderivative(2)

    def _risen(self, time: Array) -> Array:
        return np.asarray(0.5 * (1 + erf((time - self.when) / (self.width * np.sqrt(2)))))

    def _ramp(self, time: Array) -> Array:
        x = time - self.when
        return np.asarray(
            x * self._risen(time) + self.width / np.sqrt(2 * np.pi) * np.exp(-0.5 * (x / self.width) ** 2)
        )


def draw_matern(std: float, rate: float, span: float, rng: np.random.Generator) -> Drawn:
    """A Matern load of three independent components: std N or N m, rate 1/s, for a record of `span` s.

    Source: principal equations 4e.

    >>> load = draw_matern(2.0, 12.0, 400.0, np.random.default_rng(0))
    >>> bool(np.isclose(load.at(np.arange(0, 400, 0.5)).std(), 2.0, rtol=0.1))
    True
    """
    count = int(np.ceil(CUT_RATES * rate * 2 * span / np.pi)) + 20
    if count > SINUSOIDS:
        none = np.zeros((0, 3))
        return Drawn(np.zeros(0), none, none, np.zeros(3), curve=drawn_curve(std, rate, span, rng))
    grid = CUT_RATES * rate * np.linspace(0, 1, count + 1) ** 1.5  # finer where the power is
    w = grid[:-1] + np.diff(grid) * rng.random(count)
    size = std * np.sqrt(spectrum(w, rate, LOAD_ORDER) * np.diff(grid))[:, None]
    return Drawn(
        w, size * rng.standard_normal((count, 3)), size * rng.standard_normal((count, 3)), np.zeros(3)
    )


def drawn_curve(std: float, rate: float, span: float, rng: np.random.Generator) -> BSpline:
    """A Matern load through values at the knots, drawn by circulant embedding of their covariance.

    Source: C. R. Dietrich, G. N. Newsam, SIAM J. Sci. Comput. 18 (1997) 1088, section 2.
    """
    step = 1 / (KNOTS_PER_MEMORY * rate)
    count = int(np.ceil(span / step)) + 12
    x = (
        rate * step * np.arange(count + int(40 * KNOTS_PER_MEMORY))
    )  # so far round that the ends know nothing of each other
    covariance = std**2 * (1 + x + x**2 / 3) * np.exp(-x)  # of order three
    power = np.fft.rfft(np.concatenate([covariance, covariance[-2:0:-1]])).real.clip(0)
    round_trip = 2 * len(x) - 2
    w = 2 * np.pi * np.fft.rfftfreq(round_trip, step)
    shape = np.sqrt(power) * w**2 / (w**2 + (SLOWEST * rate) ** 2)
    white = np.fft.rfft(rng.standard_normal((round_trip, 3)), axis=0)
    drawn = np.fft.irfft(shape[:, None] * white, round_trip, axis=0)
    return make_interp_spline(step * (np.arange(count) - 5), drawn[:count], k=5)
