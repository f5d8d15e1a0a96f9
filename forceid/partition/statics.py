"""A body in parts at rest: directly or by conjugate gradients, with what its motions are worth.

Source: principal equations 2.9, 2.10, 4i.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from forceid.errors import ConfigError, EstimationError
from forceid.partition.operators.conjugate_gradient import Iterations, projected_cg
from forceid.partition.saddle import solve_saddle
from forceid.partition.solution.accuracy import Refined, in_balance, norm, ratio, refine_solution
from forceid.partition.solution.assembly import Assembly
from forceid.partition.solution.error_verdict import REACHED, SOUND, condition_verdict
from forceid.records import Array, Verdict

WEIGHTS = ("multiplicity", "stiffness")
GAP_ROUNDING = 1e-14  # of the gaps that loads and start vector open, below which a residual is none
BALANCE_LIMIT = 1e-9  # of the loads' own size, that the resultant on a floating body may be
CLOSER, CLOSEST = 0.1, 1e-6  # of the gaps that a correction starts from, that it leaves at most and at least
EXACT_ERROR = 2e-14  # error up to which a direct solution is as good as one in double precision gets
DRAWS_DIRECT, DRAWS_ITERATIVE = 4, 2  # of rounding, that tell an error: they cost little where direct


@dataclass(frozen=True)
class Statics:
    """A body in partitions at rest, or accelerating as one.

    u (dof,) m of all partitions; alpha (alpha,): their rigid motions, the least-squares part of u along R;
    lam (multiplier,) N: forces of the partitions on the interface; u_f (frame,) m; energy J of deformation;
    deficiency: rigid motions of the whole that no support holds; acceleration (deficiency,): along these, of
    inertia relief; iterations: of conjugate gradients before any correction, None for a direct solution.
    error, lam_error: how far u and lam are off, of their length, by one more solution of what they leave;
    verdict: ok, or degraded with the reason; what would be refused is raised.
    """

    u: Array
    alpha: Array
    lam: Array
    u_f: Array
    energy: float
    deficiency: int
    acceleration: Array
    iterations: Iterations | None = None
    error: float = 0.0
    lam_error: float = 0.0
    verdict: Verdict = field(default_factory=Verdict)


def solve_direct(system: Assembly, load: Any, relief: bool = False) -> Statics:
    """By the reduced saddle-point system; arguments as in `PartitionedSystem.solve`."""

    def solve(f: Array, gap: Array, _: float) -> tuple[Array, Array]:
        lam, alpha = solve_saddle(system, f, gap)
        return displaced(system, f, system.projection.balanced(lam), alpha)

    given = system.loads(load)
    f, acceleration = relieved(system, given, relief)
    start = solve(f, np.zeros(len(system.topology.frame)), 0.0)
    best = refine_solution(
        system, f, start, solve, out_of_balance(system, given, acceleration), EXACT_ERROR, DRAWS_DIRECT
    )
    return complete_solution(system, f, best, acceleration, None, 0.0)


def solve_iteratively(
    system: Assembly,
    load: Any,
    preconditioner: str,
    weights: str,
    tolerance: float,
    most: int,
    relief: bool,
) -> Statics:
    """By projected conjugate gradients; arguments as in `PartitionedSystem.solve_cg`."""
    if weights not in WEIGHTS:
        raise ConfigError(f"unknown weights '{weights}'", next_step=f"one of {', '.join(WEIGHTS)}")
    if not 0 < tolerance < 1 or most < 1:
        raise ConfigError(
            f"asks for a tolerance of {tolerance:g} in {most} steps",
            next_step="a tolerance between 0 and 1, and one step or more",
        )
    P = system.by_stiffness if weights == "stiffness" else system.projection
    apply = system.precondition(preconditioner)
    # without a preconditioner gaps do not show wrong forces between stiff partitions
    mend = system.precondition("lumped") if preconditioner == "none" else apply
    runs: list[Iterations] = []

    def solve(f: Array, gap: Array, size: float) -> tuple[Array, Array]:
        b = np.asarray(system.topology.B.T @ system.inverse(f)) + gap
        start = P.start(system.resultant(f))
        opened = system.flexibility(start)
        r = b - opened
        # where statics alone gives the multipliers, the residual is rounding from the start
        least = GAP_ROUNDING * (norm(b) + norm(opened))
        goal = tolerance
        if size:  # of a correction: gaps that are small beside the motion, not beside those it starts from
            goal = max(CLOSEST, min(CLOSER, ratio(tolerance * size, norm(P.gaps(r)))))
        by = mend if size else apply
        done = projected_cg(system.flexibility, r, P.forces, P.gaps, by, goal, most, least)
        runs.append(done)
        lam = system.projection.balanced(start + done.x)
        lam = lam + system.projection.start(
            system.resultant(f) - system.projection.modes_T @ lam
        )  # what rounding left over
        alpha = system.projection.solve_coarse(
            system.projection.modes_T @ system.projection.averaged(system.flexibility(lam) - b)
        )
        return displaced(system, f, lam, alpha)

    given = system.loads(load)
    f, acceleration = relieved(system, given, relief)
    start = solve(f, np.zeros(len(system.topology.frame)), 0.0)
    enough = max(SOUND, REACHED * tolerance)
    best = refine_solution(
        system, f, start, solve, out_of_balance(system, given, acceleration), enough, DRAWS_ITERATIVE
    )
    return complete_solution(system, f, best, acceleration, runs[0], tolerance)


def relieved(system: Assembly, f: Array, relief: bool) -> tuple[Array, Array]:
    """Loads in equilibrium, and the acceleration (mode,) of the whole that its inertia takes for it.

    Raises EstimationError where the whole is not held, the loads are not in equilibrium, and no relief is
    asked for.
    """
    S = system.whole()
    out, still = S.T @ f, np.zeros(S.shape[1])
    if not S.shape[1]:
        return f, still
    inside = bool((np.abs(out) <= BALANCE_LIMIT * np.linalg.norm(S, axis=0) * norm(f)).all())
    if inside and not (relief and system.mass is not None):
        return in_balance(system, f), still
    if not relief:
        sums = ", ".join(f"{v:.4g}" for v in out)
        raise EstimationError(
            f"is not in equilibrium: nothing holds {S.shape[1]} motions of the body, and along them it "
            f"adds up to ({sums})",
            "load",
            "balance it, hold the body, or ask for inertia relief with relief=True",
        )
    carried = np.concatenate([m @ S[d] for m, d in zip(system.masses, system.topology.dofs, strict=True)])
    try:
        acceleration = np.linalg.solve(S.T @ carried, out)
    except np.linalg.LinAlgError:
        raise EstimationError(
            "carry no mass along a motion that nothing holds", "partitions", "give their mass, or hold them"
        ) from None
    top = system.topology
    return in_balance(system, f - top.shared(top.assembled(carried @ acceleration))), acceleration


def out_of_balance(system: Assembly, f: Array, acceleration: Array) -> float:
    """The share of loads (dof,) that moves the whole and is carried by no acceleration."""
    return 0.0 if acceleration.any() else ratio(norm(system.free_motions.T @ f), norm(f))


def displaced(system: Assembly, f: Array, lam: Array, alpha: Array) -> tuple[Array, Array]:
    """The multipliers, and the motions u (dof,) that they and alpha amount to: none of the whole."""
    u = system.inverse(f - system.topology.B @ lam) + system.modes @ alpha
    return lam, in_balance(system, u)


def complete_solution(
    system: Assembly,
    f: Array,
    best: Refined,
    acceleration: Array,
    iterations: Iterations | None,
    tolerance: float,
) -> Statics:
    """Rigid motions, motion of the interface, energy and verdict of the best solution."""
    top, u = system.topology, best.u
    return Statics(
        u=u,
        alpha=np.asarray(system.pinned @ u),
        lam=best.lam,
        u_f=np.bincount(top.frame, top.B.T @ u, len(top.interface)) / top.count[top.interface],
        energy=0.5 * float(u @ system.strained(u)),
        deficiency=system.free_motions.shape[1],
        acceleration=acceleration,
        iterations=iterations,
        error=best.error,
        lam_error=best.lam_error,
        verdict=condition_verdict(system, f, best, tolerance),
    )
