"""A body in partitions: who carries what at rest, the multipliers and motions of the interface.

K_s u_s = f_s - B_s lambda_s in every partition s, L_f^T lambda = 0, B^T u = L_f u_f: lambda are the forces
that the partitions exert on the interface. A floating partition moves by rigid modes R_s alpha_s beside.
Source: principal equations 2.7, 2.9, 2.10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse.linalg import LinearOperator

from forceid.errors import DataError
from forceid.partition.blocks import Apply, diagonal
from forceid.partition.flexibility import flexibility
from forceid.partition.interface_forces import InterfaceForces, interface_forces, stiffness_forces
from forceid.partition.inverse import Factor, all_symmetric, factors, products, rigid_modes, solved
from forceid.partition.preconditioners import preconditioner
from forceid.partition.projection import Projection
from forceid.partition.saddle import Saddle, factored_saddle
from forceid.partition.statics import Statics, relieved, solve_direct, solve_iteratively
from forceid.partition.topology import Topology, slices, topology
from forceid.records import Array, Indices


@dataclass(frozen=True)
class PartitionedSystem:
    """Stiffness, mass, Boolean L_s and rigid modes R_s of every partition, in lists; dense or sparse.

    mass: None where nothing accelerates. rigid_modes: None for a partition, or for all, to have the zero
    modes of K found, mechanisms among them; a fixed partition has none, a partly supported one those that its
    supports leave. Raises DataError: K not symmetric, modes that strain it, mechanisms, L not Boolean, parts
    that do not hang together. Source: principal equations 2.7 to 2.10.

    >>> K = np.array([[1.0, -1.0], [-1.0, 1.0]])
    >>> held = PartitionedSystem([[[1.0]], K], None, [[[1.0, 0.0]], np.eye(2)], [None, None])
    >>> held.solve([0.0, 2.0]).u.tolist()
    [2.0, 2.0, 4.0]
    """

    stiffness: Sequence[Any]
    mass: Sequence[Any] | None
    boolean: Sequence[Any]
    rigid_modes: Sequence[Any] | None = None
    topology: Topology = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = len(self.stiffness)
        modes = [None] * count if self.rigid_modes is None else self.rigid_modes
        for name, given in (("mass", self.mass), ("boolean", self.boolean), ("rigid_modes", modes)):
            if given is not None and len(given) != count:
                raise DataError(f"has {len(given)} entries, expected {count}, one a partition", name)
        K = all_symmetric(self.stiffness)
        M = None if self.mass is None else all_symmetric(self.mass, "mass")
        found = topology(self.boolean)
        for s, (k, g) in enumerate(zip(K, found.glob, strict=True)):
            if k.shape[0] != len(g):
                raise DataError(
                    f"has {len(g)} rows, expected {k.shape[0]}, as its stiffness", f"Boolean matrix {s}"
                )
            if M is not None and M[s].shape != k.shape:
                raise DataError(
                    f"has shape {M[s].shape}, expected {k.shape}, as its stiffness", f"mass of partition {s}"
                )
        R = tuple(rigid_modes(k, r, s) for s, (k, r) in enumerate(zip(K, modes, strict=True)))
        for name, value in (("stiffness", K), ("mass", M), ("rigid_modes", R), ("topology", found)):
            object.__setattr__(self, name, value)

    @property
    def R(self) -> Array:
        """Rigid modes (dof, alpha), each partition in its own columns."""
        return np.asarray(block_diag(*self.rigid_modes))  # type: ignore[misc]

    @cached_property
    def columns(self) -> tuple[slice, ...]:
        """The alpha of each partition among all."""
        return slices([r.shape[1] for r in self.rigid_modes])  # type: ignore[union-attr]

    @cached_property
    def R_b(self) -> Array:
        """Rigid modes at the interface (multiplier, alpha)."""
        parts = zip(self.rigid_modes, self.topology.boundary, strict=True)  # type: ignore[arg-type]
        return np.asarray(block_diag(*[r[b] for r, b in parts]))

    @cached_property
    def factored(self) -> tuple[tuple[Factor, ...], Indices]:
        """K^- of every partition, equal ones once."""
        return factors(self.stiffness, self.rigid_modes)  # type: ignore[arg-type]

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
        if not np.isfinite(f).all():
            raise DataError("holds numbers that are not finite", "load")
        return f

    @cached_property
    def strained(self) -> Apply:
        """K u of displacements (dof,)."""
        return products(self.stiffness, self.topology.dofs)

    @cached_property
    def strained_terms(self) -> Apply:
        """|K| u: what the terms of K u add up to without their signs."""
        return products(self.stiffness, self.topology.dofs, abs)

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
        parts = zip(self.rigid_modes, self.columns, strict=True)  # type: ignore[arg-type]
        return np.concatenate([r @ free[c] for r, c in parts])

    @cached_property
    def rigid(self) -> Any:
        """Rigid modes of every partition, orthonormal, sparse (dof, alpha)."""
        return diagonal([np.linalg.qr(r)[0] for r in self.rigid_modes or ()])

    @cached_property
    def pinned(self) -> Any:
        """R^+ of every partition, sparse (alpha, dof)."""
        return diagonal([np.linalg.pinv(r) for r in self.rigid_modes or ()])

    @cached_property
    def modes(self) -> Any:
        """R of every partition, sparse (dof, alpha)."""
        return diagonal(self.rigid_modes or ())

    @cached_property
    def free_motions(self) -> Array:
        """Rigid motions of the assembly (dof, mode), orthonormal."""
        return np.asarray(np.linalg.qr(self.whole())[0])

    @cached_property
    def saddle(self) -> Saddle:
        """The reduced saddle-point system, factored."""
        return factored_saddle(self)

    def relieved(self, f: Array, relief: bool) -> tuple[Array, Array]:
        """Loads (dof,) in equilibrium, and the acceleration (mode,) of the whole that relief takes for it."""
        return relieved(self, f, relief)

    def solve(self, load: Any, relief: bool = False) -> Statics:
        """Multipliers, motions and energy under a load, directly: the reduced saddle-point system.

        load: assembled (size,), shared equally, or of the partitions. relief: let a floating body accelerate.
        Raises EstimationError: loads out of balance, motions that are off by more than a thousandth.
        Source: principal equations 2.9.
        """
        return solve_direct(self, load, relief)

    def solve_cg(
        self,
        load: Any,
        preconditioner: str = "dirichlet",
        weights: str = "multiplicity",
        tolerance: float = 1e-10,
        most: int = 1000,
        relief: bool = False,
    ) -> Statics:
        """The same by projected conjugate gradients, matrix-free: for many partitions.

        preconditioner: none, lumped or dirichlet; weights: multiplicity, or stiffness where it jumps between
        partitions; tolerance: of the projected residual; most: steps of one run. What a run leaves is solved
        for in a short second one: it says what the solution is off, and mends one that is off by more than
        the tolerance asks for. Source: principal equations 2.10, 4i.
        """
        return solve_iteratively(self, load, preconditioner, weights, tolerance, most, relief)

    def precondition(self, name: str) -> Apply:
        """The preconditioner of that name, of displacements (multiplier,) of the interface."""
        if name not in self.preconditioners:
            self.preconditioners[name] = preconditioner(name, self.topology, self.stiffness)
        return self.preconditioners[name]

    @cached_property
    def preconditioners(self) -> dict[str, Apply]:
        """Those made so far."""
        return {}

    def operator(self) -> LinearOperator:
        """P^T F P for the solvers of scipy."""
        n, P = len(self.topology.frame), self.projection
        return LinearOperator(
            (n, n), matvec=lambda x: P.gaps(self.flexibility(P.forces(np.ravel(x)))), dtype=float
        )

    def start_vector(self, load: Any) -> Array:
        """lambda_alpha (multiplier,): least multipliers that balance every floating partition and every node.

        Source: principal equations 2.10.
        """
        return self.projection.start(self.resultant(self.loads(load)))

    def interface_forces(
        self, load: Any, acceleration: Any = None, displacement: Any = None, **options: Any
    ) -> InterfaceForces:
        """What passes between the partitions that accelerate so, without stiffness; with displacements by it.

        Options are those of `interface_forces.interface_forces`, or of `stiffness_forces` there where
        displacements are given. Source: principal equations 2.11 A, 4h.
        """
        if displacement is None:
            return interface_forces(self, load, acceleration, **options)
        return stiffness_forces(self, load, displacement, acceleration, **options)
