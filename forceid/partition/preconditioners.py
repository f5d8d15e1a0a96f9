"""Preconditioners of the interface problem: what it takes to move the interface of each part alone.

none, lumped B^T K B, or Dirichlet diag(K_bb - K_bi K_ii^-1 K_ib). Source: principal equations 4i.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from forceid.errors import ConfigError, DataError
from forceid.partition.inverse import Factor, factors, zero_modes
from forceid.partition.topology import Topology
from forceid.records import Array, Indices

NAMES = ("none", "lumped", "dirichlet")


def preconditioner(name: str, topology: Topology, stiffness: Sequence[Any]) -> Callable[[Array], Array]:
    """Forces (multiplier,) per displacement (multiplier,) of the interfaces of all parts."""
    if name == "none":
        return lambda x: x
    if name not in NAMES:
        raise ConfigError(f"unknown preconditioner '{name}'", next_step=f"one of {', '.join(NAMES)}")
    inner = [
        np.setdiff1d(np.arange(K.shape[0]), b) for K, b in zip(stiffness, topology.boundary, strict=True)
    ]
    pairs = list(zip(stiffness, topology.boundary, inner, strict=True))
    K_bb = [K[b][:, b] for K, b, _ in pairs]
    if name == "lumped":
        return lambda x: np.concatenate([k @ x[row] for k, row in zip(K_bb, topology.rows, strict=True)])
    K_ib = [K[i][:, b] for K, b, i in pairs]
    inside = [K[i][:, i] for K, _, i in pairs]
    try:
        each, which = factors(inside, [np.zeros((len(i), 0)) for i in inner])
    except DataError:  # a mechanism inside a partition, which its interface does not feel
        each, which = factors(inside, [zero_modes(k) for k in inside])

    def dirichlet(x: Array) -> Array:
        moved = [x[row] for row in topology.rows]
        within = solved(each, which, [k @ u for k, u in zip(K_ib, moved, strict=True)])
        return np.concatenate(
            [kb @ u - ki.T @ v for kb, u, ki, v in zip(K_bb, moved, K_ib, within, strict=True)]
        )

    return dirichlet


def solved(each: Sequence[Factor], which: Indices, loads: Sequence[Array]) -> list[Array]:
    """K^- f for each part, the loads of equal parts at once."""
    found: list[Array] = [np.zeros(0)] * len(loads)
    for k, factor in enumerate(each):
        members = np.flatnonzero(which == k)
        together = factor.solve(np.stack([loads[s] for s in members.tolist()], axis=1))
        for column, s in enumerate(members.tolist()):
            found[s] = together[:, column]
    return found
