"""What is handed in, as arrays of finite numbers of the right shape, or one line that says what is wrong.

Source: pseudo-rigid bodies, sections 0 and 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from forceid.errors import DataError
from forceid.pseudorigid.factors.cofactors import EYE, determinant
from forceid.pseudorigid.material.material_law import validated_constant
from forceid.records import Array

STEPS_AT_MOST = 1e8  # steps of one motion: an hour and more
ROTATION_ROUNDING = 1e-6  # of L^T L = I, that rounding of a rotation written to few digits may miss


def real_values(value: Any, name: str, advice: str = "give real numbers") -> Array:
    """An array of floats. DataError for text, None, complex numbers, lists that are no arrays."""
    try:
        found = np.asarray(value)
        if found.dtype.kind not in "biuf":
            raise TypeError
    except (TypeError, ValueError):
        raise DataError(f"is {type(value).__name__} without real numbers", name, advice) from None
    return np.asarray(found, float)


def tensors(value: Any, name: str = "F", advice: str = "give matrices") -> Array:
    """Matrices (..., 3, 3) of floats, finite or not; at no cost where they are such already."""
    A = value
    if not isinstance(A, np.ndarray) or A.dtype != np.float64:
        A = real_values(value, name, advice)
    if A.shape[-2:] != (3, 3):
        raise DataError(f"has shape {A.shape}, expected (..., 3, 3)", name, advice)
    return np.asarray(A)


def matrices(value: Any, name: str, advice: str = "give matrices") -> Array:
    """Finite matrices (..., 3, 3). DataError for any other shape, or what is not finite."""
    A = tensors(value, name, advice)
    if not np.isfinite(A).all():
        raise DataError("holds values that are not finite", name, "leave those frames out or fill them")
    return A


def matrix(value: Any, name: str) -> Array:
    """One finite matrix (3, 3)."""
    A = matrices(value, name, "give one matrix")
    if A.ndim != 2:
        raise DataError(f"has shape {A.shape}, expected (3, 3)", name, "hand in one at a time")
    return A


def shaped(value: Any, shape: tuple[int, ...], name: str, advice: str) -> Array:
    """Finite numbers of a shape."""
    found = real_values(value, name)
    if found.shape != shape or not np.isfinite(found).all():
        what = f"has shape {found.shape}, expected {shape}" if found.shape != shape else "is not finite"
        raise DataError(what, name, advice)
    return found


def real_vector(value: Any, name: str) -> Array:
    """One finite vector (3,)."""
    return shaped(value, (3,), name, "give three finite numbers")


def deformation(value: Any, name: str) -> Array:
    """One finite matrix (3, 3) of det > 0."""
    F = matrix(value, name)
    J = float(np.linalg.det(F))
    if not J > 0:
        raise DataError(f"has determinant {J:.3g}, expected > 0", name, "exchange two columns")
    return F


def rotation_matrix(value: Any, name: str) -> Array:
    """One rotation (3, 3)."""
    L = matrix(value, name)
    off = float(np.abs(L.T @ L - np.eye(3)).max())
    if off > ROTATION_ROUNDING or not np.linalg.det(L) > 0:
        what = f"is no rotation: L^T L is off I by {off:.2g}, det L = {np.linalg.det(L):.3g}"
        raise DataError(what, name, "give its polar rotation, polar(L)[0]")
    return L


def instants(value: Any, name: str = "time", rising: bool = True, least: int = 1) -> Array:
    """Finite instants (time,), s, growing if `rising`. DataError for any other."""
    t = real_values(value, name, "give instants in s")
    if t.ndim != 1 or len(t) < least or not np.isfinite(t).all():
        what = f"is not a list of {least} or more finite numbers"
        raise DataError(what, name, "give instants in s")
    if rising and (np.diff(t) <= 0).any():
        what = "is not a growing list of finite numbers"
        raise DataError(what, name, "sort it and drop repeated samples")
    return t


def validated_second_moment(value: Any) -> Array:
    """E (3, 3) kg m^2, symmetric positive definite, of E or of mu in E = mu I. DataError for any other."""
    where = "second_moment"
    E = real_values(value, where, "give E = int rho X X^T dX, or mu")
    E = E * EYE if E.ndim == 0 else E
    if E.shape != (3, 3):
        raise DataError(f"has shape {E.shape}, expected (3, 3)", where, "give E = int rho X X^T dX, or mu")
    if not np.isfinite(E).all() or np.abs(E - E.T).max() > 1e-12 * np.abs(E).max():
        raise DataError("is not a finite symmetric matrix", where, "give E = int rho X X^T dX")
    least, _, most = np.linalg.eigvalsh(E)
    if not least > 1e-12 * most:
        what = f"has the eigenvalue {least:.3g} beside {most:.3g}, expected all positive"
        advice = "a flat or thin body has no affine motion across: use a rigid body, or give it thickness"
        raise DataError(what, where, advice)
    return E


def validated_start(F0: ArrayLike, dF0: ArrayLike) -> tuple[Array, Array]:
    """F and V (..., 3, 3) of one shape, copied. DataError where they are not the start of a motion."""
    F, V = matrices(F0, "F0"), matrices(dF0, "dF0")
    try:
        F, V = (A.copy() for A in np.broadcast_arrays(F, V))
    except ValueError:
        what = f"have shapes {F.shape} and {V.shape}, which do not go together"
        raise DataError(what, "F0 and dF0", "give a rate for every start") from None
    if not F.size:
        raise DataError("holds no body", "F0", "give at least one matrix")
    J = determinant(F)
    if not (J > 0).all():
        what = f"has det F0 = {float(J.min()):.6g}, expected > 0"
        raise DataError(what, "F0", "exchange two columns, or flatten the body less")
    return F, V


def check_step(step: float, span: float) -> None:
    """DataError where a step (s) is not above zero, or takes no end of steps over a span (s)."""
    validated_constant("simulate", "step", step)
    if not (np.isfinite(step) and step > 0):
        raise DataError(f"is {step:g} s, expected > 0", "step", "give a positive step")
    if span / step > STEPS_AT_MOST:
        what = f"is {step:g} s, {span / step:.1e} of them over {span:g} s"
        raise DataError(what, "step", f"give one of {span / STEPS_AT_MOST:.2g} s or more, or fewer samples")
