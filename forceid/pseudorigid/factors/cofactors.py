"""Products, determinants and cofactors of 3 by 3 matrices over leading axes, without loops or LAPACK.

Written on whole slices: arrays stored component first, as `by_component` makes them, cost a few passes
through memory for any number of bodies. cof F = det(F) F^-T = F x F / 2 with the symmetric bilinear product
of J. Bonet, A. J. Gil and R. Ortigosa, Comput. Methods Appl. Mech. Eng. 283 (2015) 1061, which makes
derivatives of det F and of the second invariant short. Source: pseudo-rigid bodies, sections 1, 3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from forceid.records import Array

EYE = np.eye(3)
CYCLIC = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


def by_component(F: ArrayLike) -> Array:
    """A copy of matrices (..., 3, 3) stored component by component; shape as before."""
    A = np.asarray(F, float)
    return np.moveaxis(np.array(np.moveaxis(A, (-2, -1), (0, 1)), order="C"), (0, 1), (-2, -1))


def product(A: Array, B: Array) -> Array:
    """A B of matrices (..., 3, 3)."""
    out = A[..., :, 0, None] * B[..., None, 0, :]
    out += A[..., :, 1, None] * B[..., None, 1, :]
    out += A[..., :, 2, None] * B[..., None, 2, :]
    return np.asarray(out)


def trace(A: Array) -> Array:
    """Trace (...,) of matrices (..., 3, 3)."""
    return np.asarray(A[..., 0, 0] + A[..., 1, 1] + A[..., 2, 2])


def inner(A: Array, B: Array) -> Array:
    """A : B = tr(A B^T) of matrices (..., 3, 3)."""
    rows = (A * B).sum(-1)
    return np.asarray(rows[..., 0] + rows[..., 1] + rows[..., 2])


def wrapped(F: Array) -> Array:
    """F (..., 3, 3) with two rows and columns repeated, (..., 5, 5): cyclic indices become slices."""
    F = np.concatenate([F, F[..., :2, :]], -2)
    return np.concatenate([F, F[..., :2]], -1)


def cofactor(F: Array) -> Array:
    """Cofactors det(F) F^-T of matrices (..., 3, 3), also where F is singular."""
    P = np.concatenate([F, F[..., :2]], -1)
    out = np.empty_like(P[..., :3])
    for i, j, k in CYCLIC:  # less memory at once than in one go, which counts for many bodies
        np.multiply(P[..., j, 1:4], P[..., k, 2:5], out=out[..., i, :])
        out[..., i, :] -= P[..., j, 2:5] * P[..., k, 1:4]
    return out


def tensor_cross(A: Array, B: Array) -> Array:
    """A x B (..., 3, 3), bilinear, symmetric, with F x F = 2 cof F: the derivative of cof F by H is F x H."""
    P, Q = wrapped(A), wrapped(B)
    out = P[..., 1:4, 1:4] * Q[..., 2:5, 2:5]
    out += P[..., 2:5, 2:5] * Q[..., 1:4, 1:4]
    out -= P[..., 1:4, 2:5] * Q[..., 2:5, 1:4]
    out -= P[..., 2:5, 1:4] * Q[..., 1:4, 2:5]
    return np.asarray(out)


def determinant(F: Array) -> Array:
    """Determinants (...,) of matrices (..., 3, 3)."""
    a, b, c = (F[..., i, :] for i in range(3))
    return np.asarray(
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )


def inverse(F: Array) -> Array:
    """F^-1 of matrices (..., 3, 3) through cofactors."""
    C = cofactor(F)
    return np.asarray(C.mT / determinant(F)[..., None, None])


def scaled(factor: Array, A: Array) -> Array:
    """Numbers (...,) times matrices (..., 3, 3)."""
    return np.asarray(factor[..., None, None] * A)
