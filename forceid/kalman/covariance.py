"""Covariances and information of a state, combined and rooted without losing their sign."""

from __future__ import annotations

import numpy as np

from forceid.errors import EstimationError
from forceid.records import Array


def combine(P: Array, information: Array) -> Array:
    """(P^-1 + information)^-1 (time, state, state), positive: C (1 + C^T information C)^-1 C^T, P = C C^T."""
    C = square_root(P)
    known = np.eye(P.shape[-1]) + C.swapaxes(1, 2) @ information @ C
    root = np.linalg.solve(square_root(0.5 * (known + known.swapaxes(1, 2))), C.swapaxes(1, 2))
    return np.asarray(root.swapaxes(1, 2) @ root)


def square_root(P: Array) -> Array:
    """C with C C^T = P for each of many P (..., state, state)."""
    correlation, size = correlations(P)
    try:
        return np.asarray(size * np.linalg.cholesky(correlation))
    except np.linalg.LinAlgError:  # semidefinite to rounding
        spread, axes = np.linalg.eigh(correlation)
        return np.asarray(size * axes * np.sqrt(np.maximum(spread, 0.0))[..., None, :])


def correlations(P: Array) -> tuple[Array, Array]:
    """Each of many P (..., state, state) in units of its diagonal, and these units (..., state, 1)."""
    own = np.diagonal(P, axis1=-2, axis2=-1)
    size = np.sqrt(np.where(own > 1e-300, own, 1.0))[..., None]  # of no variance, or none but rounding: one
    return np.asarray(P / (size * size.swapaxes(-1, -2))), np.asarray(size)


def root(R: Array) -> Array:
    """Triangular L with L L^T = R of a noise; EstimationError where R is not positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(R), float)
    except np.linalg.LinAlgError as e:
        where, step = "R of the model", "state a measurement noise above zero"
        raise EstimationError("is not positive definite", where, step) from e


def is_positive_definite(R: Array) -> bool:
    """Whether all R (..., channel, channel) are positive definite, beyond rounding of their correlations."""
    try:
        np.linalg.cholesky(correlations(R)[0])
    except np.linalg.LinAlgError:
        return False
    return True
