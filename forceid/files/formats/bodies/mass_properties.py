"""Mass, center and inertia of one body of a file of another program, and what such a file has to be."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.records import Array

LARGEST = 32 << 20  # bytes of a text that describes bodies: ten times a human body with all its muscles
ROUNDED = (
    0.01  # of the largest moment, by which one may exceed the sum of the others: numbers of three digits
)


@dataclass(frozen=True)
class MassProperties:
    """A body by name: mass kg, center (3,) m and inertia (3, 3) kg m2 about it, in the axes of the body.

    marker: places (3,) m on it by name, where the file has them.
    """

    name: str
    mass: float
    center: Array
    inertia: Array
    marker: dict[str, Array] = field(default_factory=dict)


def text_of(path: Path) -> str:
    """The text of a file. DataError: missing, too large, or no text."""
    try:
        size = path.stat().st_size
        if size > LARGEST:
            what = f"holds {size >> 20} MB, expected {LARGEST >> 20} MB at most of a text"
            raise DataError(what, str(path), "export the body alone")
        return path.read_bytes().decode("utf-8-sig")
    except OSError as e:
        raise DataError(f"cannot be read ({e.strerror})", str(path), "correct [import.body] file") from e
    except UnicodeDecodeError as e:
        raise DataError("is not UTF-8 text", str(path), "export it again") from e


def numbers_of(text: str | None, count: int, where: str) -> Array:
    """`count` finite numbers of a text, parted by spaces. DataError: others."""
    words = (text or "").split()
    try:
        found = np.array([float(word) for word in words])
    except ValueError:
        found = np.zeros(0)
    if len(found) != count or not np.isfinite(found).all():
        shown = " ".join(words)[:60]
        what = f"is {shown!r}, expected {count} number{'s' * (count > 1)}"
        hint = "run xacro first" if "${" in shown else "correct it"
        raise DataError(what, where, hint)
    return found


def symmetric(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> Array:
    """The tensor (3, 3) of its six numbers.

    >>> symmetric(1, 2, 3, 4, 5, 6).tolist()
    [[1, 4, 5], [4, 2, 6], [5, 6, 3]]
    """
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def checked(found: MassProperties, where: str) -> MassProperties:
    """The same, of a body that can be. DataError: no mass, or moments that no body has."""
    if not (math.isfinite(found.mass) and found.mass > 0):
        raise DataError(f"has mass {found.mass:g} kg, expected more than zero", where, "correct it")
    moments = np.linalg.eigvalsh(found.inertia)
    if moments[0] <= 0 or moments[2] > moments[0] + moments[1] + ROUNDED * moments[2]:
        shown = ", ".join(f"{m:.4g}" for m in moments)
        what = f"has principal moments {shown} kg m2, expected positive ones, none over the sum of the others"
        raise DataError(what, where, "correct its inertia, and the signs of its products")
    return found
