"""Loads drawn from a Matern prior that repeat themselves: the sinusoids of a period.

No code is shared with the estimators.
"""

from __future__ import annotations

from math import lgamma

import numpy as np
from numpy.typing import ArrayLike

from forceid.records import Array

ORDER_PERIODIC = 2  # of the Matern loads: differentiable once
PERIOD, HIGHEST_PERIODIC = 4.0, 40.0  # s, Hz: after which these do, and up to which they go
SAMPLES_TOGETHER = 4096  # samples evaluated at a time


def draw_periodic(std: ArrayLike, rate: float, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Independent Matern loads of std (load,) N or N m, rate 1/s, that repeat themselves after PERIOD s.

    Sines at all its harmonics up to HIGHEST_PERIODIC: w, a, b as `waves` takes them.
    """
    w = 2 * np.pi * np.arange(1.0, HIGHEST_PERIODIC * PERIOD + 1) / PERIOD
    power = spectrum(w, rate, ORDER_PERIODIC)
    each = np.asarray(std, dtype=float)
    size = each * np.sqrt(power / power.sum())[:, None]
    a, b = size * rng.standard_normal((2, len(w), len(each)))
    return w, a, b


def waves(time: Array, w: Array, a: Array, b: Array) -> Array:
    """Sum (time, load) of a cos(w t) + b sin(w t); w (line,) rad/s, a, b (line, load)."""
    parts = []
    for k in range(0, len(time), SAMPLES_TOGETHER):
        phase = np.multiply.outer(time[k : k + SAMPLES_TOGETHER], w)
        parts.append(np.cos(phase) @ a + np.sin(phase) @ b)
    return np.concatenate(parts)


def spectrum(w: Array, rate: float, order: int) -> Array:
    """Power per rad/s at w rad/s of a Matern load of unit variance, both signs of w together."""
    # 2 sqrt(pi) G(n) / G(n - 1/2) rate^(2n-1) / (w^2 + rate^2)^n over 2 pi
    scale = np.exp(lgamma(order) - lgamma(order - 0.5)) / np.sqrt(np.pi)
    return np.asarray(2 * scale * rate ** (2 * order - 1) / (w**2 + rate**2) ** order)
