"""What every part does to its own rows, equal parts at once.

A loop over parts costs more than their arithmetic where parts are small: equal ones take their vectors side
by side through one product, and a product that is asked for often is kept dense where it is small. Source:
principal equations 4i.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

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
