"""Vectors and matrices that studies share: the gravity of their scenes, and cross products as matrices."""

from __future__ import annotations

import numpy as np

from forceid.pseudorigid.factors.cofactors import EYE
from forceid.records import Array

__all__ = ["EYE", "GRAVITY", "hat"]

GRAVITY = np.array([0.0, 0.0, -9.81])  # m/s2


def hat(w: Array) -> Array:
    """Skew matrices (..., 3, 3) of w (..., 3).

    >>> hat(np.array([1.0, 2.0, 3.0])).tolist()
    [[0.0, -3.0, 2.0], [3.0, 0.0, -1.0], [-2.0, 1.0, 0.0]]
    """
    out = np.zeros((*w.shape, 3))
    out[..., 2, 1], out[..., 0, 2], out[..., 1, 0] = (w[..., k] for k in range(3))
    return np.asarray(out - out.mT)
