"""The flexibility of all parts at the interface, F = B^T K^- B, as a product.

Source: principal equations 2.9, 4i.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from forceid.partition.blocks import Apply, Blocks, blocks, dense, worth_keeping
from forceid.partition.inverse import Factor
from forceid.partition.topology import Topology
from forceid.records import Array, Indices


def flexibility(topology: Topology, each: Sequence[Factor], which: Indices) -> Blocks:
    """F of parts with the factors each[which], which (part,).

    Equal parts may share different degrees of freedom: K^- is kept at all that one of them shares, where that
    is worth it.
    """
    boundary = topology.boundary
    kept: dict[int, tuple[Indices, Array]] = {}
    for k in range(len(each)):
        members = np.flatnonzero(which == k)
        shared = np.unique(np.concatenate([boundary[s] for s in members]))
        if worth_keeping(len(shared), len(members)):
            kept[k] = shared, each[k].moved(shared, np.eye(len(shared)))

    def product(s: int, _: int) -> Apply:
        k, b = int(which[s]), boundary[s]
        if k not in kept:
            return partial(each[k].moved, b)
        at = np.searchsorted(kept[k][0], b)
        return dense(kept[k][1][np.ix_(at, at)])

    keys = [(int(k), b.tobytes()) for k, b in zip(which, boundary, strict=True)]
    return blocks(keys, topology.rows, product)
