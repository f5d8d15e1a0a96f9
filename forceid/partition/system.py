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
import scipy.sparse as sp
from scipy.linalg import block_diag
from scipy.sparse.linalg import LinearOperator

from forceid.errors import ConfigError, DataError, EstimationError
from forceid.partition.conjugate_gradient import Iterations, projected_cg
from forceid.partition.interface_forces import InterfaceForces, interface_forces, stiffness_forces
from forceid.partition.inverse import Factor, factors, rigid_modes, symmetric
from forceid.partition.preconditioners import preconditioner, solved
from forceid.partition.projection import Projection
from forceid.partition.saddle import solve_saddle
from forceid.partition.topology import Topology, slices, topology
from forceid.records import Array, Indices

WEIGHTS = ("multiplicity", "stiffness")
ROUNDING = 1e-14  # of the gaps that loads and start vector open, below which a residual is none
BALANCED = 1e-9  # of the loads' own size, that the resultant on a floating body may be


@dataclass(frozen=True)
class Statics:
    """A body in partitions at rest, or accelerating as one.

    u (dof,) m of all partitions; alpha (alpha,): their rigid motions, the least-squares part of u along R;
    lam (multiplier,) N: forces of the partitions on the interface; u_f (frame,) m; energy J of deformation;
    deficiency: rigid motions of the whole that no support holds; acceleration (deficiency,): along these, of
    inertia relief; iterations: of conjugate gradients, None for a direct solution.
    """

    u: Array
    alpha: Array
    lam: Array
    u_f: Array
    energy: float
    deficiency: int
    acceleration: Array
    iterations: Iterations | None = None


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
        K = tuple(symmetric(k, s) for s, k in enumerate(self.stiffness))
        M = None if self.mass is None else tuple(symmetric(m, s, "mass") for s, m in enumerate(self.mass))
        found = topology([sp.csr_array(L) for L in self.boolean])
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

    def resultant(self, f: Array) -> Array:
        """R^T f (alpha,) of loads (dof,)."""
        parts = zip(self.rigid_modes, self.topology.dofs, strict=True)  # type: ignore[arg-type]
        return np.concatenate([r.T @ f[d] for r, d in parts])

    def inverse(self, f: Array) -> Array:
        """K^- f of loads (dof,)."""
        return np.concatenate(solved(*self.factored, [f[d] for d in self.topology.dofs]))

    def flexibility(self, lam: Array) -> Array:
        """F lambda = B^T K^- B lambda."""
        B = self.topology.B
        return np.asarray(B.T @ self.inverse(B @ lam))

    def whole(self) -> Array:
        """Rigid motions of the assembly (dof, mode), in units of those of its first floating partition."""
        free = self.projection.whole
        first = next((free[c] for c in self.columns if c.stop - c.start == free.shape[1]), None)
        if first is not None and free.shape[1] and np.linalg.cond(first) < 1e8:
            free = free @ np.linalg.inv(first)
        parts = zip(self.rigid_modes, self.columns, strict=True)  # type: ignore[arg-type]
        return np.concatenate([r @ free[c] for r, c in parts])

    def relieved(self, f: Array, relief: bool) -> tuple[Array, Array]:
        """Loads in equilibrium, and the acceleration (mode,) of the whole that its inertia takes for it.

        Raises EstimationError where the whole is not held, the loads are not in equilibrium, and no relief is
        asked for.
        """
        S = self.whole()
        out = S.T @ f
        if not S.shape[1] or (np.abs(out) <= BALANCED * np.linalg.norm(S, axis=0) * np.linalg.norm(f)).all():
            return f, np.zeros(S.shape[1])
        if not relief:
            told = ", ".join(f"{v:.4g}" for v in out)
            raise EstimationError(
                f"is not in equilibrium: nothing holds {S.shape[1]} motions of the body, and along them it "
                f"adds up to ({told})",
                "load",
                "balance it, hold the body, or ask for inertia relief with relief=True",
            )
        if self.mass is None:
            raise DataError("is not given, and inertia relief needs it", "mass")
        carried = np.concatenate([m @ S[d] for m, d in zip(self.mass, self.topology.dofs, strict=True)])
        acceleration = np.linalg.solve(S.T @ carried, out)
        top = self.topology
        return f - top.shared(top.assembled(carried @ acceleration)), acceleration

    def solve(self, load: Any, relief: bool = False) -> Statics:
        """Multipliers, motions and energy under a load, directly: the reduced saddle-point system.

        load: assembled (size,), shared equally, or of the partitions. relief: let a floating body accelerate.
        Source: principal equations 2.9.
        """
        f, acceleration = self.relieved(self.loads(load), relief)
        lam, alpha = solve_saddle(self, f)
        return self.recovered(f, lam, alpha, acceleration, None)

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
        partitions; tolerance: of the projected residual. Source: principal equations 2.10, 4i.
        """
        f, acceleration = self.relieved(self.loads(load), relief)
        if weights not in WEIGHTS:
            raise ConfigError(f"unknown weights '{weights}'", next_step=f"one of {', '.join(WEIGHTS)}")
        P = self.by_stiffness if weights == "stiffness" else self.projection
        b = np.asarray(self.topology.B.T @ self.inverse(f))
        start = P.start(self.resultant(f))
        moved = self.flexibility(start)
        apply = self.precondition(preconditioner)
        # where statics alone gives the multipliers, the residual is rounding from the start
        least = ROUNDING * float(np.linalg.norm(b) + np.linalg.norm(moved))
        done = projected_cg(self.flexibility, b - moved, P.forces, P.gaps, apply, tolerance, most, least)
        lam = self.projection.balanced(start + done.x)
        lam = lam + self.projection.start(self.resultant(f) - self.R_b.T @ lam)  # what rounding left over
        gap = self.flexibility(lam) - b
        alpha = self.projection.solve_coarse(self.R_b.T @ self.projection.averaged(gap))
        return self.recovered(f, lam, alpha, acceleration, done)

    def precondition(self, name: str) -> Any:
        """The preconditioner of that name, of displacements (multiplier,) of the interface."""
        return preconditioner(name, self.topology, self.stiffness)

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

    def recovered(
        self, f: Array, lam: Array, alpha: Array, acceleration: Array, iterations: Iterations | None
    ) -> Statics:
        """Displacements, motion of the interface and energy that multipliers and rigid motions amount to."""
        top, B = self.topology, self.topology.B
        parts = list(zip(self.rigid_modes, top.dofs, self.columns, strict=True))  # type: ignore[arg-type]
        u = self.inverse(f - B @ lam) + np.concatenate([r @ alpha[c] for r, _, c in parts])
        S = self.whole()
        if S.shape[1]:
            u = u - S @ np.linalg.lstsq(S, u, rcond=None)[0]
        alpha = np.concatenate([np.linalg.lstsq(r, u[d], rcond=None)[0] for r, d, _ in parts])
        u_f = np.bincount(top.frame, B.T @ u, len(top.interface)) / top.count[top.interface]
        energy = sum(0.5 * float(u[d] @ (K @ u[d])) for K, d in zip(self.stiffness, top.dofs, strict=True))
        return Statics(u, alpha, lam, u_f, energy, S.shape[1], acceleration, iterations)
