"""What is known of a load before a record is seen, by who knows: the rest of its prior is tuned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior
from forceid.records import Array


@dataclass(frozen=True)
class Stated:
    """Of the Matern kernel of a load, alike along all axes; None where it is not known.

    order; std of each component (N, or N m) about its mean, which stays open; rate (1/s) at which the load
    forgets itself, or bandwidth (Hz), at which its spectral density has fallen to a half.
    """

    order: int | None = None
    std: float | None = None
    rate: float | None = None
    bandwidth: float | None = None

    @property
    def whole(self) -> bool:
        """Whether nothing is left to tune."""
        return None not in (self.order, self.std) and self.paced

    @property
    def paced(self) -> bool:
        """Whether the rate is known, for a given order."""
        return self.rate is not None or self.bandwidth is not None

    def rate_at(self, order: int) -> float | None:
        """The rate (1/s) of a kernel of that order.

        >>> Stated(bandwidth=2.0).rate_at(1) == 2 * np.pi * 2.0
        True
        """
        if self.bandwidth is None:
            return self.rate
        return float(2 * np.pi * self.bandwidth / np.sqrt(2.0 ** (1 / order) - 1))

    def held(self, order: int, std: Array, rate: Array) -> tuple[Array, Array]:
        """The std and rate (...), with what is known in the place of what was tried."""
        known = self.rate_at(order)
        std = std if self.std is None else np.full_like(std, self.std)
        return std, rate if known is None else np.full_like(rate, known)

    def kept(self, prior: LoadPrior) -> LoadPrior:
        """A prior that was changed since, with what is known of it as it is known."""
        kernel = prior.kernel
        if not isinstance(kernel, Matern):
            return prior
        order = kernel.order if self.order is None else self.order
        return prior.with_kernel(Matern(order, *self.held(order, kernel.std, kernel.rate)))
