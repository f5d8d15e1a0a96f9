"""Eigenvalues and pseudo-inverse of stacks of symmetric matrices in which a gap is NaN and stays NaN."""

from __future__ import annotations

import numpy as np

from forceid.records import Array


def eigen(A: Array) -> tuple[Array, Array]:
    """Ascending eigenvalues (..., n) and orthonormal eigenvectors (..., n, n); NaN where A has a NaN."""
    known = np.asarray(np.isfinite(A).all(axis=(-2, -1), keepdims=True))
    value, vector = np.linalg.eigh(np.where(known, A, 0.0))
    return np.where(known[..., 0], value, np.nan), np.where(known, vector, np.nan)


def pseudo_inverse(A: Array, floor: float = 0.0) -> Array:
    """A^+ of positive semidefinite A; eigenvalues below 1e-12 of the largest, or below floor, count as zero.

    >>> pseudo_inverse(np.diag([2.0, 0.0]))
    array([[0.5, 0. ],
           [0. , 0. ]])
    """
    value, vector = eigen(A)
    kept = value > np.maximum(1e-12 * value[..., -1:], floor)
    inverse = np.where(kept, 1 / np.where(kept, value, 1.0), 0.0)
    return np.asarray((vector * inverse[..., None, :]) @ vector.mT)
