"""Preconditioners of the interface problem: what it takes to move the interface of each part alone.

none, lumped B^T K B, or Dirichlet diag(K_bb - K_bi K_ii^-1 K_ib). Source: principal equations 4i.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from forceid.errors import ConfigError, DataError
from forceid.partition.operators.blocks import Apply, blocks, dense, worth_keeping
from forceid.partition.operators.inverse import digest_of, factor, zero_modes
from forceid.partition.operators.topology import Topology
from forceid.records import Indices

PRECONDITIONERS = ("none", "lumped", "dirichlet")


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
