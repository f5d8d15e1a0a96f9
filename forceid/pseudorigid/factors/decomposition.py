"""Polar and bipolar factors of deformations, and their rates: F = L U = L diag(D) R.

    omega = (tr U I - U)^-1 vee(A - A^T),  A = L^T F'                         polar
    (omega + lam)_k = (A_ji - A_ij) / (a_i + a_j),  A = L^T F' R^T            bipolar
    (omega - lam)_k = (A_ji + A_ij) / (a_i - a_j),  D' = diag(A)

with L^T L' = [omega]x, R' R^T = [lam]x and (i, j, k) cyclic. Source: pseudo-rigid bodies 2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forceid.compiled import engine as compiled
from forceid.errors import DataError
from forceid.principal import axial
from forceid.pseudorigid.factors import twofold
from forceid.pseudorigid.validation import matrices, tensors
from forceid.records import Array, Flags

PRODUCT_ROUNDING = 0.5 * float(np.finfo(float).eps)  # of F and F' and of products of them, that rates divide
COALESCED = 1e-8  # of the largest: singular values so close leave no digit of omega - lam
MATRICES_TOGETHER = 65536  # matrices at once in numpy
OTHERS = ((1, 2), (2, 0), (0, 1))  # i and j of each k


@dataclass(frozen=True)
class BipolarRates:
    """Rates of F = L diag(D) R: omega (..., 3) rad/s along the columns of L, lam along the rows of R, and dD.

    defined (..., 3): False, and omega and lam NaN, about axis k where the two other singular values
    coalesce. rounding (..., 3) rad/s: about what rounding of F and F' costs of omega and of lam, as 1/gap^2.
    L, D, R: the factors that these are the rates of. Where values coalesce, `bipolar_rates` turns them to
    the basis that an analytic path passes through, in which dD holds; F is met to the gap there.
    """

    L: Array
    D: Array
    R: Array
    omega: Array
    lam: Array
    dD: Array
    defined: Flags
    rounding: Array


@dataclass(frozen=True)
class PolarRates:
    """Rates of F = L U: omega (..., 3) rad/s in body axes, and dU (..., 3, 3). Unpacks to both.

    rounding (...,) rad/s: about what rounding of F and F' costs of omega, by how little the two least
    stretches show of a turn.
    """

    omega: Array
    dU: Array
    rounding: Array

    def __iter__(self) -> Iterator[Array]:
        """Both rates."""
        return iter((self.omega, self.dU))


def polar(F: ArrayLike) -> tuple[Array, Array]:
    """Rotation L (..., 3, 3) and stretch U (..., 3, 3), symmetric and positive, of F = L U.

    F (..., 3, 3), det F > 0. L is that of the matrix given to the last digits at any condition: errors of the
    rotation from rounding within are not amplified by 1 / (s2 + s3). Raises DataError. Source: pseudo-rigid
    bodies 2.

    >>> L, U = polar([[1.0, 1.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    >>> L.round(12) + 0.0
    array([[ 0.8,  0.6,  0. ],
           [-0.6,  0.8,  0. ],
           [ 0. ,  0. ,  1. ]])
    >>> U.round(12).tolist()
    [[0.8, 0.6, 0.0], [0.6, 1.7, 0.0], [0.0, 0.0, 1.0]]
    """
    F, flat = _matrices(F)
    if compiled is not None:
        L, U, det = compiled.polar(flat)
        _refuse_folded(F, det)
        return L.reshape(F.shape), U.reshape(F.shape)
    L, _, _ = _in_numpy(F, flat)
    U = L.swapaxes(1, 2) @ flat
    return L.reshape(F.shape), (0.5 * (U + U.swapaxes(1, 2))).reshape(F.shape)


def bipolar(F: ArrayLike) -> tuple[Array, Array, Array]:
    """L (..., 3, 3), singular values D (..., 3) in descending order and R (..., 3, 3) of F = L diag(D) R.

    L and R are rotations, F (..., 3, 3) with det F > 0. L R is the polar rotation. Unique at distinct D up to
    the signs of two axes; `bipolar_path` follows them over time. Raises DataError. Source: pseudo-rigid
    bodies 2.

    >>> L, D, R = bipolar([[0.0, -3.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> D.round(12).tolist(), bool(np.allclose(L * D @ R, [[0, -3, 0], [2, 0, 0], [0, 0, 1]]))
    ([3.0, 2.0, 1.0], True)
    """
    F, flat = _matrices(F)
    if compiled is not None:
        L, D, R, det = compiled.bipolar(flat)
        _refuse_folded(F, det)
    else:
        Q, D, R = _in_numpy(F, flat)
        L = Q @ R.swapaxes(1, 2)
    return L.reshape(F.shape), D.reshape(F.shape[:-1]), R.reshape(F.shape)


def polar_rates(F: ArrayLike, dF: ArrayLike) -> PolarRates:
    """Rates of F = L U: omega (..., 3) rad/s in body axes, L^T L' = [omega]x, and dU (..., 3, 3).

    F and its rate dF (..., 3, 3); det F > 0. Defined at every such F, and known to `rounding`. Raises
    DataError. Source: pseudo-rigid bodies 2.

    >>> omega, dU = polar_rates(np.eye(3), [[0.5, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    >>> omega.tolist(), dU.diagonal().tolist()
    ([0.0, 0.0, 2.0], [0.5, 0.0, 0.0])
    """
    L, U = polar(F)
    V = rate_of(L, dF)
    A = L.swapaxes(-1, -2) @ V
    inertia = np.trace(U, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - U
    omega = np.linalg.solve(inertia, axial(A.swapaxes(-1, -2))[..., None])[..., 0]
    dU = A - np.cross(omega[..., None], U, axis=-2)
    sums = np.linalg.eigvalsh(inertia)  # of two stretches; the least may be rounding itself
    rounding = (
        PRODUCT_ROUNDING * np.linalg.norm(V, axis=(-2, -1)) / np.maximum(sums[..., 0], 1e-16 * sums[..., 2])
    )
    return PolarRates(omega, 0.5 * (dU + dU.swapaxes(-1, -2)), rounding)


def bipolar_rates(
    F: ArrayLike,
    dF: ArrayLike,
    factors: tuple[Array, Array, Array] | None = None,
    coalesced: ArrayLike = COALESCED,
) -> BipolarRates:
    """Rates of F = L diag(D) R; NaN and a flag about axes where they are not defined.

    F, dF (..., 3, 3); det F > 0. factors: L, D, R of a path, taken as they are; None: those of `bipolar`.
    coalesced: gap of two singular values, as a part of the largest, up to which omega - lam is undefined.
    Raises DataError. Source: pseudo-rigid bodies 2.

    >>> spin = bipolar_rates(np.diag([3.0, 2.0, 1.0]), [[0, -2, 0], [3, 0, 0], [0, 0, 0]])
    >>> spin.omega.tolist(), spin.lam.tolist(), spin.defined.tolist()
    ([0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [True, True, True])
    >>> bipolar_rates(np.diag([2.0, 2.0, 1.0]), np.diag([1.0, 0.0, 0.0])).omega.tolist()
    [0.0, 0.0, nan]
    """
    L, D, R = bipolar(F) if factors is None else factors
    dF = rate_of(L, dF)
    i, j = np.array(OTHERS).T
    close = np.abs(D[..., i] - D[..., j]) <= np.asarray(coalesced) * D.max(-1, keepdims=True)
    A = L.swapaxes(-1, -2) @ dF @ R.swapaxes(-1, -2)
    if factors is None and close.any():
        Q = _analytic_basis(A, close)
        L, R, A = L @ Q, Q.swapaxes(-1, -2) @ R, Q.swapaxes(-1, -2) @ A @ Q
        D = np.einsum("...ki,...k->...i", Q * Q, D)
    together = (A[..., j, i] - A[..., i, j]) / (D[..., i] + D[..., j])
    gap = np.where(close, 1.0, D[..., i] - D[..., j])
    apart = np.where(close, np.nan, A[..., j, i] + A[..., i, j]) / gap
    dD = np.einsum("...ii->...i", A).copy()
    size = np.linalg.norm(dF, axis=(-2, -1))[..., None] * D.max(-1, keepdims=True)
    rounding = np.where(close, np.nan, PRODUCT_ROUNDING * size / gap**2)
    return BipolarRates(L, D, R, 0.5 * (together + apart), 0.5 * (together - apart), dD, ~close, rounding)


def _analytic_basis(A: Array, close: Flags) -> Array:
    """Rotations Q (..., 3, 3) within clusters of values that make the blocks of Q^T sy(A) Q diagonal."""
    pair = np.array([[0, 2, 1], [2, 1, 0], [1, 0, 2]])
    linked: Flags = np.asarray(np.logical_or(close[..., pair], np.eye(3, dtype=bool)))
    linked = np.asarray(linked @ linked)  # where one value is close to two, all three are one cluster
    apart = 20 * np.abs(A).max((-1, -2))[..., None] * linked.argmax(-1)  # keeps clusters in their order
    S = np.where(linked, A + A.swapaxes(-1, -2), 0.0) + apart[..., None] * np.eye(3)
    Q = np.linalg.eigh(S)[1]
    Q[..., 0] *= np.linalg.det(Q)[..., None]
    return np.asarray(np.where(np.asarray(close.any(-1))[..., None, None], Q, np.eye(3)))


def rate_of(F: Array, dF: ArrayLike) -> Array:
    """A rate dF (..., 3, 3) that goes together with F. DataError."""
    V = matrices(dF, "dF", "give the rate of every F")
    try:
        np.broadcast_shapes(F.shape, V.shape)
    except ValueError:
        what = f"has shape {V.shape}, expected that of F, {F.shape}"
        raise DataError(what, "dF", "give the rate of every F") from None
    return V


def _matrices(F: ArrayLike) -> tuple[Array, Array]:
    """F as it is shaped, and as (n, 3, 3)."""
    F = tensors(F, "F", "give deformations of a solid body")
    return F, F.reshape(-1, 3, 3)


def _in_numpy(F: Array, flat: Array) -> tuple[Array, Array, Array]:
    """The polar rotation, D and R of every matrix."""
    blocks = [
        twofold.exact_factors(flat[k : k + MATRICES_TOGETHER])
        for k in range(0, max(len(flat), 1), MATRICES_TOGETHER)
    ]
    Q, D, R, det = (np.concatenate(part) for part in zip(*blocks, strict=True))
    _refuse_folded(F, det)
    return Q, D, R


def _refuse_folded(F: Array, det: Array) -> None:
    """Raise at the first matrix without det > 0."""
    if (det > 0).all():
        return
    first = int(np.argmin(det > 0))
    at = np.unravel_index(first, F.shape[:-2]) if F.ndim > 2 else ()
    where = f"F[{', '.join(str(k) for k in at)}]" if at else "F"
    if not np.isfinite(F[at]).all():
        raise DataError("is not finite, expected a deformation", where, "leave that frame out or fill it")
    value = -abs(float(np.linalg.det(F[at]))) if det[first] else 0.0
    raise DataError(
        f"has determinant {value:.3g}, expected > 0",
        where,
        "no body goes through that frame: look for markers mixed up or a motion in one plane",
    )
