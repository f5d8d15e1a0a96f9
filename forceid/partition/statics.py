"""A body in parts at rest, however it is solved, with what its motions are worth.

Source: principal equations 2.9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from forceid.errors import EstimationError
from forceid.partition.operators.conjugate_gradient import Iterations
from forceid.partition.solution.accuracy import (
    SaddleSolve,
    condition_verdict,
    in_balance,
    norm,
    ratio,
    refine_solution,
)
from forceid.partition.solution.assembly import Assembly
from forceid.records import Array, Verdict

BALANCE_LIMIT = 1e-9  # of the loads' own size, that the resultant on a floating body may be
EXACT_ERROR = 2e-14  # error up to which a direct solution is as good as one in double precision gets
DRAWS_DIRECT = 4  # of rounding, that tell an error: they cost little here


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


def solve_at_rest(
    system: Assembly,
    load: Any,
    relief: bool,
    solve: SaddleSolve,
    enough: float = EXACT_ERROR,
    draws: int = DRAWS_DIRECT,
    runs: Sequence[Iterations] = (),
    tolerance: float = 0.0,
) -> Statics:
    """The body under a load by `solve`, refined to `enough`; runs: what it is done in, if in several.

    load, relief: as in `PartitionedSystem.solve`; tolerance: what was asked of the runs.
    """
    given = system.loads(load)
    f, acceleration = relieved(system, given, relief)
    start = solve(f, np.zeros(len(system.topology.frame)), 0.0)
    imbalance = 0.0 if acceleration.any() else ratio(norm(system.free_motions.T @ given), norm(given))
    best = refine_solution(system, f, start, solve, imbalance, enough, draws)
    top, u = system.topology, best.u
    return Statics(
        u=u,
        alpha=np.asarray(system.pinned @ u),
        lam=best.lam,
        u_f=np.bincount(top.frame, top.B.T @ u, len(top.interface)) / top.count[top.interface],
        energy=0.5 * float(u @ system.strained(u)),
        deficiency=system.free_motions.shape[1],
        acceleration=acceleration,
        iterations=runs[0] if runs else None,
        error=best.error,
        lam_error=best.lam_error,
        verdict=condition_verdict(system, f, best, tolerance),
    )


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


def displaced(system: Assembly, f: Array, lam: Array, alpha: Array) -> tuple[Array, Array]:
    """The multipliers, and the motions u (dof,) that they and alpha amount to: none of the whole."""
    u = system.inverse(f - system.topology.B @ lam) + system.modes @ alpha
    return lam, in_balance(system, u)
