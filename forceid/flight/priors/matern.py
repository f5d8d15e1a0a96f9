"""A load without a pattern: the Matern kernel along each axis. Source: principal equations 4e."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from forceid.kalman.building.process import Process, matern, matern_density
from forceid.records import Array, Indices

UNTOLD_ORDER = 2  # order where a record leaves little to tell orders apart: continuous, with a rate


@dataclass(frozen=True)
class Matern:
    """Matern kernels: order, the load and its derivatives as states; std (axis,) of the load; rate (axis,)
    1/s.
    """

    order: int
    std: Array
    rate: Array
    rivals = True

    @property
    def kinks(self) -> bool:
        """Whether the load has no rate: the roughest order."""
        return self.order == 1

    @property
    def slope(self) -> Array:
        """Row (state,) that reads the rate of the load, zero where it has none."""
        return np.asarray(np.eye(1, self.order, 1)[0])

    @cached_property
    def process(self) -> Process:
        """The load along each axis."""
        return matern(self.order, self.std, self.rate)

    def density(self, w: Array) -> Array:
        """Spectral density (..., axis), two-sided, per Hz, at w (..., 1) rad/s."""
        return matern_density(self.order, self.std, self.rate, w)

    def of(self, axes: Indices) -> Matern:
        """The kernels of some axes."""
        return Matern(self.order, self.std[axes], self.rate[axes])

    def scaled(self, share: Array | float) -> Matern:
        """The kernels of a load that is so many times as large."""
        return replace(self, std=self.std * share)

    def moved(self, by: Array) -> Matern:
        """The kernels whose level at high frequency is e^by[0] times itself, and whose rate e^by[1]."""
        std = self.std * np.exp(by[0] - (self.order - 0.5) * by[1])
        return replace(self, std=std, rate=self.rate * np.exp(by[1]))

    def hastened(self, factor: float) -> Matern:
        """The kernels of loads as large that forget themselves so many times as fast."""
        return replace(self, rate=factor * self.rate)

    def unknown(self, std: Array, rate: float) -> Matern:
        """Kernels for loads of which little is known but std (axis,) and about what rate (1/s)."""
        return Matern(UNTOLD_ORDER, std, np.full(len(std), rate))

    def numbers(self) -> dict[str, float]:
        """What a result file says of the kernels."""
        found: dict[str, float] = {"order": self.order}
        for i, (std, rate) in enumerate(zip(self.std, self.rate, strict=True), 1):
            found |= {f"std_{i}": float(std), f"rate_{i}": float(rate)}
        return found
