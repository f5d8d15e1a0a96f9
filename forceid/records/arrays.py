"""Arrays by what they hold, and what is read off covariances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
AXES = ("x", "y", "z")


def deviation(cov: Array) -> Array:
    """Standard deviations (..., n) of covariances (..., n, n)."""
    return np.asarray(np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1)))


class Claims:
    """A record with a covariance wrench_cov (..., 6, 6) of force, then moment."""

    wrench_cov: Array

    @property
    def force_std(self) -> Array:
        """Standard deviation of the force (..., 3) N."""
        return deviation(self.wrench_cov)[..., :3]

    @property
    def moment_std(self) -> Array:
        """Standard deviation of the moment (..., 3) N m."""
        return deviation(self.wrench_cov)[..., 3:]
