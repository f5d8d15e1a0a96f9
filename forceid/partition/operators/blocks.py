"""What every part does to its own rows, equal parts at once.

A loop over parts costs more than their arithmetic where parts are small: equal ones take their vectors side
by side through one product, and a product that is asked for often is kept dense where it is small. Source:
principal equations 4i.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from forceid.records import Array, Indices

Apply = Callable[[Array], Array]

LARGEST = 1500  # rows of a part up to which its product is kept dense,
EXPECTED_PRODUCTS = 30  # and times the parts that share it: as often as it is asked for, about


@dataclass(frozen=True)
class Blocks:
    """A block-diagonal product: groups of rows (part, m), and what it makes of their vectors (m, part)."""

    groups: tuple[tuple[Indices, Apply], ...]

    def __call__(self, x: Array) -> Array:
        """The product with x (row,)."""
        out = np.zeros_like(x)
        for rows, apply in self.groups:
            out[rows] = apply(x[rows].T).T
        return out


def blocks(keys: Sequence[object], rows: Sequence[slice], make: Callable[[int, int], Apply]) -> Blocks:
    """Of parts with these rows; parts of one key share the product make(part, parts) of the first and all."""
    return Blocks(tuple((at, make(first, len(at))) for first, at in equal_parts(keys, rows)))


def worth_keeping(rows: int, parts: int) -> bool:
    """Whether a product of that many rows is kept dense, which costs as many products as it has rows."""
    return rows <= min(LARGEST, EXPECTED_PRODUCTS * parts)


def equal_parts(keys: Sequence[object], rows: Sequence[slice]) -> list[tuple[int, Indices]]:
    """Parts of one key together: the first of them, and the rows (part, row) of all."""
    members: dict[object, list[int]] = {}
    for s, key in enumerate(keys):
        members.setdefault(key, []).append(s)
    return [
        (some[0], np.array([np.arange(rows[s].start, rows[s].stop) for s in some], dtype=np.intp))
        for some in members.values()
    ]


def dense(matrix: Array) -> Apply:
    """The product with a symmetric matrix, with what rounding left of its asymmetry taken off."""
    even = 0.5 * (matrix + matrix.T)
    return lambda x: np.asarray(even @ x)


def diagonal(matrices: Sequence[Any]) -> Any:
    """Matrices of parts, dense or sparse rows, along the diagonal of a sparse one."""
    stored = [entries(m) for m in matrices]
    shapes = np.array([m.shape for m in matrices]).reshape(-1, 2)
    rows, columns = np.cumsum(np.vstack([[0, 0], shapes]), axis=0).T
    count = np.concatenate([[0], *[c for _, _, c in stored]])
    indices = [i + at for (_, i, _), at in zip(stored, columns, strict=False)]
    data = np.concatenate([np.zeros(0), *[d for d, _, _ in stored]])
    where = np.concatenate([np.zeros(0, np.intp), *indices])
    return sp.csr_array((data, where, np.cumsum(count)), (rows[-1], columns[-1]))


def entries(m: Any) -> tuple[Array, Indices, Indices]:
    """Entries of a matrix row by row, their columns, and how many a row has."""
    if sp.issparse(m):
        rows_of: Any = m
        return rows_of.data, rows_of.indices, np.diff(rows_of.indptr)
    rows, columns = m.shape
    return m.ravel(), np.tile(np.arange(columns), rows), np.full(rows, columns)
