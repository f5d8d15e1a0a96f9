"""The flexibility of all parts at the interface, F = B^T K^- B, as a product.

Source: principal equations 2.9, 4i.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from forceid.partition.operators.blocks import Apply, Blocks, blocks, dense, worth_keeping
from forceid.partition.operators.inverse import Factor
from forceid.partition.operators.topology import Topology
from forceid.records import Array, Indices


def flexibility(topology: Topology, each: Sequence[Factor], which: Indices) -> Blocks:
    """F of parts with the factors each[which], which (part,).

    Equal parts may share different degrees of freedom: K^- is kept at all that one of them shares, where that
    is worth it.
    """
    boundary = topology.boundary
    kept: dict[int, tuple[Indices, Array]] = {}
    for k, factor in enumerate(each):
        members = [boundary[s] for s in np.flatnonzero(which == k)]
        if worth_keeping(len(np.unique(np.concatenate(members))), len(members)):
            kept[k] = at_shared(factor, members)

    def product(s: int, _: int) -> Apply:
        k, b = int(which[s]), boundary[s]
        if k not in kept:
            return partial(each[k].moved, b)
        return dense(inverse_block(kept[k], b))

    keys = [(int(k), b.tobytes()) for k, b in zip(which, boundary, strict=True)]
    return blocks(keys, topology.rows, product)


def flexibility_matrices(topology: Topology, each: Sequence[Factor], which: Indices) -> list[Array]:
    """F_s = B_s^T K_s^- B_s (multiplier of s, multiplier of s) of every partition."""
    boundary, found = topology.boundary, [np.zeros((0, 0))] * len(which)
    for k, factor in enumerate(each):
        members = np.flatnonzero(which == k).tolist()
        inverse = at_shared(factor, [boundary[s] for s in members])
        for s in members:
            F = inverse_block(inverse, boundary[s])
            found[s] = 0.5 * (F + F.T)
    return found


def at_shared(factor: Factor, boundary: Sequence[Indices]) -> tuple[Indices, Array]:
    """All degrees of freedom (row,) that one of equal parts shares, and K^- (row, row) there."""
    shared = np.unique(np.concatenate(boundary))
    return shared, factor.moved(shared, np.eye(len(shared)))


def inverse_block(inverse: tuple[Indices, Array], rows: Indices) -> Array:
    """The rows and columns of K^- of one part."""
    at = np.searchsorted(inverse[0], rows)
    return np.asarray(inverse[1][np.ix_(at, at)])
