"""What a user gives, as arrays of real numbers: anything else is told in one line, with its place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from forceid.errors import DataError
from forceid.records import Array

KINDS = {"c": "complex numbers", "U": "text", "S": "text", "O": "objects", "M": "dates", "V": "records"}


def real_array(given: Any, where: str, axes: int | None = None) -> Any:
    """A dense or sparse array of real numbers, if axes is given with that many. Raises DataError."""
    if sp.issparse(given):
        A: Any = given
    else:
        try:
            A = np.asarray(given)
        except ValueError as e:
            raise DataError("has rows of different lengths, expected an array", where, "fill it") from e
    if A.dtype.kind not in "fiub":
        what = KINDS.get(A.dtype.kind, str(A.dtype))
        raise DataError(f"holds {what}, expected real numbers", where, "give an array of float64")
    if axes is not None and A.ndim != axes:
        what = f"has shape {A.shape}, expected {axes} axes"
        raise DataError(what, where, "give rows and columns" if axes == 2 else "give one row of numbers")
    return A


def finite(given: Any, where: str) -> Array:
    """An array of floats, none of them NaN or infinite. Raises DataError."""
    A = np.asarray(real_array(given, where), dtype=float)
    if not np.isfinite(A).all():
        raise DataError("holds numbers that are not finite", where)
    return A


def real_matrix(given: Any, where: str) -> Any:
    """A matrix as sparse rows of float64."""
    return sp.csr_array(real_array(given, where, 2), dtype=np.float64)


def real_positions(given: Sequence[Any], where: str = "") -> list[Array]:
    """Positions (node, axis) m of every part, finite, with the same axes."""
    name = [where or f"position of partition {s}" for s in range(len(given))]
    found = [np.asarray(real_array(x, n, 2), dtype=float) for x, n in zip(given, name, strict=True)]
    if not found:
        raise DataError("has no entry, expected one a part", "position", "give the places of the nodes")
    for s, x in enumerate(found):
        if x.shape[1] != found[0].shape[1] or not np.isfinite(x).all():
            what = f"has shape {x.shape}, expected finite (node, {found[0].shape[1]})"
            raise DataError(what, name[s], "give the place of every node")
    return found
