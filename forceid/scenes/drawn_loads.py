"""Loads drawn at random with the spectrum of a Matern process, as smooth functions of time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from forceid.records import Array

PERIOD, HIGHEST = 4.0, 40.0  # s, Hz: after which a drawn load repeats itself, and up to which it goes


def drawn_loads(size: ArrayLike, frequency: float, seed: int) -> Callable[[float], Array]:
    """Independent loads (load,) as a function of time, of standard deviation `size` (load,).

    Sines at all multiples of 1 / PERIOD up to HIGHEST, of normal amplitudes: of order 2, flat below
    `frequency` Hz and falling with its fourth power beyond.

    >>> drawn_loads([1.0, 0.0], frequency=2.0, seed=0)(0.5).shape
    (2,)
    """
    rate = 2.0 * np.pi * np.arange(1.0, HIGHEST * PERIOD + 1.0) / PERIOD
    spectrum = (rate**2 + (2.0 * np.pi * frequency) ** 2) ** -2.0
    share = np.sqrt(spectrum / spectrum.sum())
    std = np.asarray(size, dtype=float)
    rng = np.random.default_rng(seed)
    amplitude = std * share[:, None] * rng.standard_normal((2, len(rate), len(std)))
    return lambda t: np.asarray(np.cos(rate * t) @ amplitude[0] + np.sin(rate * t) @ amplitude[1])
