"""The polar rotation and its rate of matrices as they are given, in eighty decimal digits.

Newton's iteration X <- (X + X^-T) / 2, scaled while it is far: slow, and right at any condition. Source:
pseudo-rigid bodies, section 2.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from typing import Any

import numpy as np

from forceid.records import Array

DECIMAL_DIGITS = 80
NEXT = (1, 2, 0)


def exact_polar(F: Array, dF: Array) -> tuple[Array, Array]:
    """Rotation L (frame, 3, 3) and omega (frame, 3) of F and dF (frame, 3, 3) as they are given."""
    with localcontext() as context:
        context.prec = DECIMAL_DIGITS
        found = [decimal_polar(decimals(f), decimals(df)) for f, df in zip(F, dF, strict=True)]
    return np.array([L for L, _ in found]), np.array([w for _, w in found])


def decimal_polar(F: Any, dF: Any) -> tuple[Array, Array]:
    """The same of one frame in decimals: L by Newton's iteration X <- (X + X^-T) / 2, scaled at first."""
    X = F
    for _ in range(200):
        Y = decimal_inverse(X).T
        g = (abs_sum(Y) / abs_sum(X)).sqrt()
        g = Decimal(1) if abs(g - 1) < Decimal("0.01") else g
        last, X = X, (g * X + Y / g) / 2
        if abs_sum(X - last) < Decimal(10) ** (8 - DECIMAL_DIGITS):
            break
    U, A = X.T @ F, X.T @ dF
    skew = A - A.T
    inertia = (U[0, 0] + U[1, 1] + U[2, 2]) * decimals(np.eye(3)) - (U + U.T) / 2
    omega = decimal_inverse(inertia) @ np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    return X.astype(float), omega.astype(float)


def decimals(A: Array) -> Any:
    """The same numbers as decimals."""
    return np.array([Decimal(float(a)) for a in A.ravel()], dtype=object).reshape(A.shape)


def abs_sum(A: Any) -> Decimal:
    """Sum of absolute values."""
    return sum((abs(a) for a in A.ravel()), Decimal(0))


def decimal_inverse(A: Any) -> Any:
    """Inverse (3, 3) by cofactors, in decimals."""
    minors = [[minor(A, i, j) for j in range(3)] for i in range(3)]
    C = np.array(minors, dtype=object)
    return C.T / (A[0] @ C[0])


def minor(A: Any, i: int, j: int) -> Any:
    """Cofactor of one entry."""
    k, m = NEXT[i], NEXT[j]
    return A[k, m] * A[NEXT[k], NEXT[m]] - A[k, NEXT[m]] * A[NEXT[k], m]
