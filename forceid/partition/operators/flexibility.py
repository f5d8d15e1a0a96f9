"""The interface problem: the flexibility of all parts, F = B^T K^- B, as a product, and its preconditioners.

A preconditioner is what it takes to move the interface of each part alone: none, lumped B^T K B, or Dirichlet
diag(K_bb - K_bi K_ii^-1 K_ib). Source: principal equations 2.9, 4i.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from forceid.errors import ConfigError, DataError
from forceid.partition.operators.blocks import Apply, Blocks, blocks, dense, worth_keeping
from forceid.partition.operators.inverse import Factor, digest_of, factor, zero_modes
from forceid.partition.operators.topology import Topology
from forceid.records import Array, Indices

PRECONDITIONERS = ("none", "lumped", "dirichlet")


def flexibility(topology: Topology, each: Sequence[Factor], which: Indices) -> Blocks:
    """F of parts with the factors each[which], which (part,).

    Equal parts may share different degrees of freedom: K^- is kept at all that one of them shares, where that
    is worth it.
    """
    boundary = topology.boundary
    kept: dict[int, tuple[Indices, Array]] = {}
    for k, one in enumerate(each):
        members = [boundary[s] for s in np.flatnonzero(which == k)]
        if worth_keeping(len(np.unique(np.concatenate(members))), len(members)):
            kept[k] = at_shared(one, members)

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
    for k, one in enumerate(each):
        members = np.flatnonzero(which == k).tolist()
        inverse = at_shared(one, [boundary[s] for s in members])
        for s in members:
            F = inverse_block(inverse, boundary[s])
            found[s] = 0.5 * (F + F.T)
    return found


def at_shared(one: Factor, boundary: Sequence[Indices]) -> tuple[Indices, Array]:
    """All degrees of freedom (row,) that one of equal parts shares, and K^- (row, row) there."""
    shared = np.unique(np.concatenate(boundary))
    return shared, one.moved(shared, np.eye(len(shared)))


def inverse_block(inverse: tuple[Indices, Array], rows: Indices) -> Array:
    """The rows and columns of K^- of one part."""
    at = np.searchsorted(inverse[0], rows)
    return np.asarray(inverse[1][np.ix_(at, at)])


def preconditioner(name: str, topology: Topology, stiffness: Sequence[Any]) -> Apply:
    """Forces (multiplier,) per displacement (multiplier,) of the interfaces of all parts."""
    if name == "none":
        return lambda x: x
    if name not in PRECONDITIONERS:
        known = ", ".join(PRECONDITIONERS)
        raise ConfigError(f"unknown preconditioner '{name}'", next_step=f"one of {known}")
    make = lumped if name == "lumped" else dirichlet
    keys = [(digest_of(K), b.tobytes()) for K, b in zip(stiffness, topology.boundary, strict=True)]
    return blocks(keys, topology.rows, lambda s, parts: make(stiffness[s], topology.boundary[s], parts))


def lumped(K: Any, b: Indices, parts: int) -> Apply:
    """K_bb of equal parts, b (row,) their degrees of freedom at the interface."""
    K_bb = K[b][:, b]
    return lambda x: np.asarray(K_bb @ x)


def dirichlet(K: Any, b: Indices, parts: int) -> Apply:
    """K_bb - K_bi K_ii^-1 K_ib of equal parts, b (row,) their degrees of freedom at the interface."""
    i = np.setdiff1d(np.arange(K.shape[0]), b)
    K_bb, K_ib, K_ii = K[b][:, b], K[i][:, b], K[i][:, i]
    try:
        inner = factor(K_ii, np.zeros((len(i), 0)), 0)
    except DataError:  # a mechanism inside a partition, which its interface does not feel
        inner = factor(K_ii, zero_modes(K_ii), 0)
    if worth_keeping(len(b), parts):
        return dense(K_bb.toarray() - K_ib.T @ inner.solve(K_ib.toarray()))
    return lambda x: np.asarray(K_bb @ x - K_ib.T @ inner.solve(K_ib @ x))
