"""Loads drawn from a known Matern prior, smooth functions of time with all their integrals in closed form.

A sum of many sinusoids whose powers follow the Matern spectrum. No code is shared with the estimators.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import lgamma

import numpy as np
from scipy.special import erf

from forceid.records import Array

ORDER = 3  # of the Matern loads: twice differentiable
CUT = 12.0  # rates at which the spectrum ends: 1e-5 of its power lies beyond
MOST = 240  # sinusoids
BLOCK = 4096  # samples evaluated at a time


@dataclass(frozen=True)
class Drawn:
    """A load: sum of a cos(w t) + b sin(w t), and a pulse beside it.

    w (line,) rad/s; a, b (line, 3) N or N m; pulse (3,) N s, N m s: impulse of a Gaussian pulse at `when` s,
    of standard deviation `width` s.
    """

    w: Array
    a: Array
    b: Array
    pulse: Array
    when: float = 0.0
    width: float = 1.0

    def at(self, time: Array) -> Array:
        """The load (time, 3)."""
        x = (time - self.when) / self.width
        bell = np.exp(-0.5 * x**2) / (self.width * np.sqrt(2 * np.pi))
        return np.asarray(self._waves(time, self.a, self.b) + bell[:, None] * self.pulse)

    def impulse(self, time: Array) -> Array:
        """Its integral from t = 0 (time, 3)."""
        w = self.w[:, None]
        risen = self._risen(time) - self._risen(np.zeros(1))
        return np.asarray(
            self._waves(time, -self.b / w, self.a / w) + (self.b / w).sum(0) + risen[:, None] * self.pulse
        )

    def second(self, time: Array) -> Array:
        """Its second integral from t = 0 (time, 3)."""
        w, t = self.w[:, None], time[:, None]
        waves = self._waves(time, -self.a / w**2, -self.b / w**2)
        start = (self.a / w**2).sum(0) + t * (self.b / w).sum(0)
        zero = np.zeros(1)
        ramp = self._ramp(time) - self._ramp(zero) - self._risen(zero) * time
        return np.asarray(waves + start + ramp[:, None] * self.pulse)

    def _waves(self, time: Array, a: Array, b: Array) -> Array:
        parts = []
        for k in range(0, len(time), BLOCK):
            phase = np.multiply.outer(time[k : k + BLOCK], self.w)
            parts.append(np.cos(phase) @ a + np.sin(phase) @ b)
        return np.concatenate(parts)

    def _risen(self, time: Array) -> Array:
        return np.asarray(0.5 * (1 + erf((time - self.when) / (self.width * np.sqrt(2)))))

    def _ramp(self, time: Array) -> Array:
        x = time - self.when
        return np.asarray(
            x * self._risen(time) + self.width / np.sqrt(2 * np.pi) * np.exp(-0.5 * (x / self.width) ** 2)
        )


def draw(std: float, rate: float, span: float, rng: np.random.Generator) -> Drawn:
    """A Matern load of three independent components: std N or N m, rate 1/s, for a record of `span` s.

    Source: principal equations 4e.

    >>> load = draw(2.0, 12.0, 400.0, np.random.default_rng(0))
    >>> bool(np.isclose(load.at(np.arange(0, 400, 0.5)).std(), 2.0, rtol=0.1))
    True
    """
    count = min(MOST, int(np.ceil(CUT * rate * 2 * span / np.pi)) + 20)
    grid = CUT * rate * np.linspace(0, 1, count + 1) ** 1.5  # finer where the power is
    w = grid[:-1] + np.diff(grid) * rng.random(count)
    # of unit variance: 2 sqrt(pi) G(n) / G(n - 1/2) rate^(2n-1) / (w^2 + rate^2)^n over 2 pi, both signs
    scale = np.exp(lgamma(ORDER) - lgamma(ORDER - 0.5)) / np.sqrt(np.pi)
    density = 2 * scale * rate ** (2 * ORDER - 1) / (w**2 + rate**2) ** ORDER
    size = std * np.sqrt(density * np.diff(grid))[:, None]
    return Drawn(
        w, size * rng.standard_normal((count, 3)), size * rng.standard_normal((count, 3)), np.zeros(3)
    )
