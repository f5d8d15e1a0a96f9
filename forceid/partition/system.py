"""A body in partitions: who carries what at rest, the multipliers and motions of the interface.

K_s u_s = f_s - B_s lambda_s in every partition s, L_f^T lambda = 0, B^T u = L_f u_f: lambda are the forces
that the partitions exert on the interface. A floating partition moves by rigid modes R_s alpha_s beside.
Source: principal equations 2.7, 2.9, 2.10.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from forceid.errors import ConfigError, DataError
from forceid.partition.operators.conjugate_gradient import Iterations, projected_cg
from forceid.partition.operators.inverse import all_symmetric, rigid_modes
from forceid.partition.operators.topology import Topology, topology
from forceid.partition.saddle import Saddle, factored_saddle
from forceid.partition.solution.accuracy import REACHED, SOUND, norm, ratio
from forceid.partition.solution.assembly import Assembly
from forceid.partition.solution.interface_forces import InterfaceForces, interface_forces
from forceid.partition.statics import Statics, displaced, solve_at_rest
from forceid.records import Array

WEIGHTS = ("multiplicity", "stiffness")
GAP_ROUNDING = 1e-14  # of the gaps that loads and start vector open, below which a residual is none
CLOSER, CLOSEST = 0.1, 1e-6  # of the gaps that a correction starts from, that it leaves at most and at least
DRAWS_ITERATIVE = 2  # of rounding, that tell an error: each takes a run


class PartitionedSystem(Assembly):
    """Stiffness, mass, Boolean L_s and rigid modes R_s of every partition, in lists; dense or sparse.

    mass: None where nothing accelerates. rigid_modes: None for a partition, or for all, to have the zero
    modes of K found, mechanisms among them; a fixed partition has none, a partly supported one those that its
    supports leave. Raises DataError: K not symmetric, modes that strain it, mechanisms, L not Boolean, parts
    that do not hang together. Source: principal equations 2.7 to 2.10.

    >>> K = [[1.0, -1.0], [-1.0, 1.0]]
    >>> held = PartitionedSystem([[[1.0]], K], None, [[[1.0, 0.0]], [[1.0, 0.0], [0.0, 1.0]]], [None, None])
    >>> held.solve([0.0, 2.0]).u.tolist()
    [2.0, 2.0, 4.0]
    """

    def __init__(
        self,
        stiffness: Sequence[Any],
        mass: Sequence[Any] | None,
        boolean: Sequence[Any],
        rigid_modes: Sequence[Any] | None = None,
    ) -> None:
        super().__init__(*validated(stiffness, mass, boolean, rigid_modes))

    def solve(self, load: Any, relief: bool = False) -> Statics:
        """Multipliers, motions and energy under a load, directly: the reduced saddle-point system.

        load: assembled (size,), shared equally, or of the partitions. relief: let a floating body accelerate.
        Raises EstimationError: loads out of balance, motions that are off by more than a thousandth.
        Source: principal equations 2.9.
        """
        n, a = self.R_b.shape
        rest = np.zeros(len(self.topology.interface) + self.projection.whole.shape[1])

        def solve(f: Array, gap: Array, _: float) -> tuple[Array, Array]:
            if not n:  # one partition
                return displaced(self, f, np.zeros(0), np.zeros(a))
            saddle = self.saddle
            opened = (self.topology.B.T @ self.inverse(f) + gap) / saddle.unit
            x = saddle.solve(np.concatenate([opened, -self.resultant(f), rest]))
            return displaced(self, f, self.projection.balanced(x[:n]), saddle.unit * x[n : n + a])

        return solve_at_rest(self, load, relief, solve)

    @cached_property
    def saddle(self) -> Saddle:
        """The reduced saddle-point system, factored."""
        return factored_saddle(self)

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
        if weights not in WEIGHTS:
            raise ConfigError(f"unknown weights '{weights}'", next_step=f"one of {', '.join(WEIGHTS)}")
        if not 0 < tolerance < 1 or most < 1:
            raise ConfigError(
                f"asks for a tolerance of {tolerance:g} in {most} steps",
                next_step="a tolerance between 0 and 1, and one step or more",
            )
        P, plain = self.by_stiffness if weights == "stiffness" else self.projection, self.projection
        apply = self.precondition(preconditioner)
        # without a preconditioner gaps do not show wrong forces between stiff partitions
        mend = self.precondition("lumped") if preconditioner == "none" else apply
        runs: list[Iterations] = []

        def solve(f: Array, gap: Array, size: float) -> tuple[Array, Array]:
            b = np.asarray(self.topology.B.T @ self.inverse(f)) + gap
            start = P.start(self.resultant(f))
            opened = self.flexibility(start)
            r = b - opened
            # where statics alone gives the multipliers, the residual is rounding from the start
            least = GAP_ROUNDING * (norm(b) + norm(opened))
            goal = tolerance
            if size:  # of a correction: gaps small beside the motion, not beside those it starts from
                goal = max(CLOSEST, min(CLOSER, ratio(tolerance * size, norm(P.gaps(r)))))
            by = mend if size else apply
            done = projected_cg(self.flexibility, r, P.forces, P.gaps, by, goal, most, least)
            runs.append(done)
            lam = plain.balanced(start + done.x)
            lam = lam + plain.start(self.resultant(f) - plain.modes.T @ lam)  # what rounding left over
            alpha = plain.solve_coarse(plain.modes.T @ plain.averaged(self.flexibility(lam) - b))
            return displaced(self, f, lam, alpha)

        enough = max(SOUND, REACHED * tolerance)
        return solve_at_rest(self, load, relief, solve, enough, DRAWS_ITERATIVE, runs, tolerance)

    def start_vector(self, load: Any) -> Array:
        """lambda_alpha (multiplier,): least multipliers that balance every floating partition and every node.

        Source: principal equations 2.10.
        """
        return self.projection.start(self.resultant(self.loads(load)))

    def interface_forces(
        self, load: Any, acceleration: Any = None, displacement: Any = None, **options: Any
    ) -> InterfaceForces:
        """What passes between the partitions that accelerate so, without stiffness; with displacements by it.

        Options are those of `interface_forces.interface_forces`. Source: principal equations 2.11 A, 4h.
        """
        return interface_forces(self, load, acceleration, displacement, **options)


def validated(
    stiffness: Sequence[Any], mass: Sequence[Any] | None, boolean: Sequence[Any], modes: Sequence[Any] | None
) -> tuple[Topology, tuple[Any, ...], tuple[Any, ...] | None, tuple[Array, ...]]:
    """What a user gives, as an `Assembly` takes it. Raises DataError."""
    count = len(stiffness)
    of_parts = [None] * count if modes is None else modes
    for name, given in (("mass", mass), ("boolean", boolean), ("rigid_modes", of_parts)):
        if given is not None and len(given) != count:
            raise DataError(f"has {len(given)} entries, expected {count}, one a partition", name)
    K = all_symmetric(stiffness)
    M = None if mass is None else all_symmetric(mass, "mass")
    found = topology(boolean)
    for s, (k, g) in enumerate(zip(K, found.glob, strict=True)):
        if k.shape[0] != len(g):
            raise DataError(
                f"has {len(g)} rows, expected {k.shape[0]}, as its stiffness", f"Boolean matrix {s}"
            )
        if M is not None and M[s].shape != k.shape:
            raise DataError(
                f"has shape {M[s].shape}, expected {k.shape}, as its stiffness", f"mass of partition {s}"
            )
    R = tuple(rigid_modes(k, r, s) for s, (k, r) in enumerate(zip(K, of_parts, strict=True)))
    return found, K, M, R
