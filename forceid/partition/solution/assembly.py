"""A body in partitions as a record: what ties them, their matrices and rigid modes, and factors of these.

Factors and projections are made on first use and kept. Source: principal equations 2.7, 2.9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag

from forceid.errors import DataError
from forceid.partition.operators.blocks import Apply
from forceid.partition.operators.flexibility import flexibility, preconditioner
from forceid.partition.operators.inverse import Factor, block_products, factor_parts, solved
from forceid.partition.operators.projection import Projection
from forceid.partition.operators.topology import Topology, slices
from forceid.partition.validation import finite
from forceid.records import Array, Indices


@dataclass(frozen=True)
class Assembly:
    """Topology, and of every partition stiffness and mass, sparse (dof, dof), and rigid modes (dof, mode).

    mass: None where nothing accelerates.
    """

    topology: Topology
    stiffness: tuple[Any, ...]
    mass: tuple[Any, ...] | None
    rigid_modes: tuple[Array, ...]

    @property
    def masses(self) -> tuple[Any, ...]:
        """The mass of every partition; DataError where none was given."""
        if self.mass is None:
            raise DataError("is not given, and what accelerates needs it", "mass", "give one a partition")
        return self.mass

    @property
    def boolean(self) -> tuple[Any, ...]:
        """Boolean L_s of every partition, sparse (dof, size)."""
        L = self.topology.L
        return tuple(L[d] for d in self.topology.dofs)

    @cached_property
    def columns(self) -> tuple[slice, ...]:
        """The alpha of each partition among all."""
        return slices([r.shape[1] for r in self.rigid_modes])

    @cached_property
    def R_b(self) -> Array:
        """Rigid modes at the interface (multiplier, alpha)."""
        parts = zip(self.rigid_modes, self.topology.boundary, strict=True)
        return np.asarray(block_diag(*[r[b] for r, b in parts]))

    @cached_property
    def factored(self) -> tuple[tuple[Factor, ...], Indices]:
        """K^- of every partition, equal ones once."""
        return factor_parts(self.stiffness, self.rigid_modes)

    @cached_property
    def projection(self) -> Projection:
        """P with averages by multiplicity."""
        return Projection(self.topology, self.R_b, np.ones(len(self.topology.frame)))

    @cached_property
    def by_stiffness(self) -> Projection:
        """P with averages by the stiffness of each partition at the interface."""
        pairs = zip(self.stiffness, self.topology.boundary, strict=True)
        weight = np.concatenate([K.diagonal()[b] for K, b in pairs])
        return Projection(self.topology, self.R_b, weight / weight.mean())

    def loads(self, load: Any) -> Array:
        """Loads on the partitions (dof,): as given, one array each, or an assembled load in equal shares."""
        top = self.topology
        if isinstance(load, list | tuple) and len(load) == len(top.glob) and np.ndim(load[0]) == 1:
            f = np.concatenate([np.asarray(part, dtype=float) for part in load])
        else:
            f = np.asarray(load, dtype=float)
            if f.shape == (top.size,):
                f = top.shared(f)
        if f.shape != (top.dofs[-1].stop,):
            raise DataError(
                f"has shape {f.shape}, expected ({top.size},) assembled, or ({top.dofs[-1].stop},) of all "
                "partitions", "load",
            )  # fmt: skip
        return finite(f, "load")

    @cached_property
    def strained(self) -> Apply:
        """K u of displacements (dof,)."""
        return block_products(self.stiffness, self.topology.dofs)

    @cached_property
    def strained_terms(self) -> Apply:
        """|K| u: what the terms of K u add up to without their signs."""
        return block_products(self.stiffness, self.topology.dofs, abs)

    def resultant(self, f: Array) -> Array:
        """R^T f (alpha,) of loads (dof,)."""
        return np.asarray(self.modes.T @ f)

    def inverse(self, f: Array) -> Array:
        """K^- f of loads (dof,)."""
        return solved(*self.factored, self.topology.dofs, f)

    @cached_property
    def flexibility(self) -> Apply:
        """F lambda = B^T K^- B lambda."""
        return flexibility(self.topology, *self.factored)

    def whole(self) -> Array:
        """Rigid motions of the assembly (dof, mode), in units of those of its first floating partition."""
        free = self.projection.whole
        first = next((free[c] for c in self.columns if c.stop - c.start == free.shape[1]), None)
        if first is not None and free.shape[1] and np.linalg.cond(first) < 1e8:
            free = free @ np.linalg.inv(first)
        parts = zip(self.rigid_modes, self.columns, strict=True)
        return np.concatenate([r @ free[c] for r, c in parts])

    @cached_property
    def rigid(self) -> Any:
        """Rigid modes of every partition, orthonormal, sparse (dof, alpha)."""
        return sp.block_diag([np.linalg.qr(r)[0] for r in self.rigid_modes], format="csr")

    @cached_property
    def pinned(self) -> Any:
        """R^+ of every partition, sparse (alpha, dof)."""
        return sp.block_diag([np.linalg.pinv(r) for r in self.rigid_modes], format="csr")

    @cached_property
    def modes(self) -> Any:
        """R of every partition, sparse (dof, alpha)."""
        return sp.block_diag(self.rigid_modes, format="csr")

    @cached_property
    def free_motions(self) -> Array:
        """Rigid motions of the assembly (dof, mode), orthonormal."""
        return np.asarray(np.linalg.qr(self.whole())[0])

    @cached_property
    def precondition(self) -> Callable[[str], Apply]:
        """The preconditioner of a name, of displacements (multiplier,) of the interface; made once."""
        return cache(lambda name: preconditioner(name, self.topology, self.stiffness))
