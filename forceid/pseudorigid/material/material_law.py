"""What a material is: the functions a body asks it for, its small-strain constants, the range of constants.

Source: pseudo-rigid bodies, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any, Protocol

import numpy as np

from forceid.errors import DataError
from forceid.records import Array


class Material(Protocol):
    """What a body asks of its material: W, dW/dF and d2W/dF2 [H]; a user's own class needs no more."""

    def energy(self, F: Array) -> Array:
        """W (...,) of F (..., 3, 3)."""
        ...

    def gradient(self, F: Array) -> Array:
        """dW/dF (..., 3, 3)."""
        ...

    def hessian(self, F: Array, H: Array) -> Array:
        """d/ds dW/dF(F + s H) at s = 0, (..., 3, 3); F and H broadcast."""
        ...


@dataclass(frozen=True)
class Lame:
    """Small-strain constants about the reference state: first Lame constant and shear modulus."""

    lam: float
    mu: float


def validated_constant(material: str, name: str, value: Any) -> float:
    """A constant as a number. DataError where it is none."""
    if not isinstance(value, Real):
        what = f"{name} is {type(value).__name__}, expected one number"
        raise DataError(what, f"{material}:", f"give {name} as a number")
    return float(value)


def check_range(material: str, name: str, value: float, holds: bool, wanted: str) -> None:
    """DataError where a constant is not a number in its range."""
    if not (np.isfinite(value) and holds):
        raise DataError(f"{name} = {value:g}, expected {wanted}", f"{material}:", f"choose {name} {wanted}")


def check_above(material: str, name: str, value: Any, least: float = 0.0, itself: bool = False) -> None:
    """DataError where a constant is not a finite number above the least one, which may be allowed itself."""
    x, wanted = validated_constant(material, name, value), f"{'>=' if itself else '>'} {least:g}"
    check_range(material, name, x, x > least or (itself and x == least), wanted)


def check_finite(material: str, **values: Any) -> None:
    """DataError where a constant is not a finite number."""
    for name, value in values.items():
        check_range(material, name, validated_constant(material, name, value), True, "finite")


def check_material_of(body: str, material: Any) -> None:
    """DataError where a material lacks one of the functions of `Material`."""
    missing = [n for n in ("energy", "gradient", "hessian") if not callable(getattr(material, n, None))]
    if missing:
        what = f"is {type(material).__name__}, which has no {', '.join(missing)}"
        raise DataError(what, f"material of {body}", "give a material, or a class with these functions")


def validated_determinant(material: str, J: Array) -> Array:
    """Determinants J (...,) of a material that resists collapse. DataError where one is not above 0."""
    if not (J > 0).all():
        value = float(np.asarray(J)[~(np.asarray(J) > 0)].flat[0])
        found = f"is {value:.3g}, expected > 0" if value == value else "is not finite"
        raise DataError(
            found, f"{material}: det F", "a body keeps its orientation: look for what turned it over"
        )
    return J


def check_volumetric(material: str, c: float, d: float, incompressible: bool) -> None:
    """DataError where c J^2 - d log J does not keep the body from collapsing."""
    c, d = validated_constant(material, "c", c), validated_constant(material, "d", d)
    if incompressible:
        if c or d:
            what = f"c = {c:g}, d = {d:g} of an incompressible material, whose multiplier replaces Gamma"
            raise DataError(what, f"{material}:", "leave c and d out")
        return
    check_above(material, "c", c, itself=True)
    if not (np.isfinite(d) and d > 0):
        what = f"d = {d:g}, expected > 0: without the barrier -d log J the body collapses"
        raise DataError(what, f"{material}:", "choose d > 0, or incompressible=True")
