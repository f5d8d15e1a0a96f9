"""How far a solution in parts is off, and the verdict on it, with what in the body or its loads costs digits.

A solution leaves r_s = f_s - K_s u_s - B_s lambda_s of every part, and gaps B^T u - L_f u_f between them.
Solved for by the same means they make a correction, which is what the solution is off. Beside them stand
loads of random sign: rounding of the given ones, what they are out of balance, and what rigid modes strain
their part beyond rounding. Up to rounding K_s R_s is zero here: stiff parts that move far would else carry as
much of it as soft ones carry force. Source: principal equations 2.9, 6, which asks for 1e-8 of conjugate
gradients; N. J. Higham, Accuracy and Stability of Numerical Algorithms, chapter 12.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from forceid.errors import EstimationError
from forceid.partition.solution.assembly import Assembly
from forceid.records import Array, Finding, Verdict

UNIT = float(np.finfo(float).eps) / 2  # of a number, which rounding takes or adds
ROUNDING_FACTOR = 5.0  # times rounding, so that one draw of its signs is seldom too small; less for several
STRAIN_FACTOR = 4  # roundings of its terms, beyond which K R is more than that
STORAGE_ERROR = 64 * UNIT  # of motions and forces, that they are off as they are held and summed
PASSES = 3  # corrections at most
DIVERGED = 2.0  # times the last error, above which a correction is taken back
HELPS = 0.1  # of the last correction, which one is to be at most for another to be worth it
EVEN = 100.0  # ratio of stiffnesses up to which it does not matter which of two parts follows the other
LEAST_FORCE = 1e-6  # of the loads at the interface, below which multipliers are measured by these

SaddleSolve = Callable[[Array, Array, float], tuple[Array, Array]]
SOUND = 1e-8  # error up to which a solution is ok
USELESS = 1e-3  # error from which it is refused, or ten times the tolerance that was asked for
REACHED = 100.0  # times the tolerance, that an error is when nothing but the tolerance is in the way
JUMP = 1e4  # ratio of the stiffnesses of parts, that is told
CANCELED = 1e4  # ratio of the loads on the parts and of what they add up to, that is told


@dataclass(frozen=True)
class Doubt:
    """What nobody knows: forces (dof,) N, and gaps (multiplier,) m that are no more than rounding of motions.

    rounding: of the loads, of random sign; imbalance N: length of what is random all over; strain: what K and
    the same without its rigid motions differ by.
    """

    rounding: Array
    imbalance: float
    strain: Array
    gap: Array

    def drawn(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Loads (dof,) and gaps (multiplier,) that may be there unseen."""
        n = len(self.rounding)
        signs, way = rng.choice([-1.0, 1.0], n), rng.standard_normal(n)
        load = signs * self.rounding + self.imbalance / np.sqrt(max(n, 1)) * way - self.strain
        return np.asarray(load), np.asarray(rng.choice([-1.0, 1.0], len(self.gap)) * self.gap)


@dataclass(frozen=True)
class Refined:
    """lam and u, and what one more correction would change of each, relative to its length."""

    lam: Array
    u: Array
    lam_error: float
    error: float
    doubt: Doubt

    @property
    def worse(self) -> float:
        """The larger of the two errors."""
        return max(self.lam_error, self.error)


def refine_solution(
    system: Assembly,
    f: Array,
    found: tuple[Array, Array],
    solve: SaddleSolve,
    imbalance: float = 0.0,
    enough: float = 0.0,
    draws: int = 1,
) -> Refined:
    """Multipliers and motions corrected while that helps and they are off by more than enough.

    found: lam (multiplier,) and u (dof,) of the loads f (dof,); solve: the same of loads (dof,), of gaps
    (multiplier,) that are to be closed, and of the length of u, by which gaps are small; imbalance: of the
    loads, relative to their length; draws: of what is unseen, each of which takes a solution. Raises what
    `solve` raises.
    """
    rng, (lam, u) = np.random.default_rng(0), found
    last: Refined | None = None
    for _ in range(PASSES):
        doubt = in_doubt(system, f, u, imbalance, ROUNDING_FACTOR / np.sqrt(draws))
        r, gap = residuals(system, f, lam, u)
        drawn = [doubt.drawn(rng) for _ in range(draws)]
        each = [solve(in_balance(system, r + unseen), gap + slit, norm(u)) for unseen, slit in drawn]
        off = np.array([relative_errors(system, f, lam, u, *more) for more in each])
        lam_error, error = np.sqrt((off**2).mean(axis=0)).tolist()
        now = Refined(lam, u, lam_error, error, doubt)
        if last is not None and now.worse > DIVERGED * last.worse:
            return last
        if now.worse <= enough or (last is not None and now.worse > HELPS * last.worse):
            return now
        more_lam, more_u = solve(in_balance(system, r), gap, norm(u))  # without what is only drawn
        last, lam, u = now, lam + more_lam, u + more_u
    assert last is not None
    return last


def relative_errors(
    system: Assembly, f: Array, lam: Array, u: Array, more_lam: Array, more_u: Array
) -> tuple[float, float]:
    """Errors of multipliers and motions by their correction, and by what it leaves, relative to their length.

    It leaves gaps, to be closed where parts are soft, and by rigid motions before forces.
    """
    top, new_u = system.topology, u + more_u
    gap = system.projection.averaged(top.B.T @ new_u)
    stiff = np.concatenate([K.diagonal() for K in system.stiffness])
    uneven = stiff.min() > 0 and stiff.max() > EVEN * stiff.min()
    follow = (
        system.by_stiffness if uneven else system.projection
    )  # the softer of two parts, where that matters
    closing = system.precondition("lumped")(follow.gaps(gap))
    force = max(norm(lam + more_lam), LEAST_FORCE * norm(top.B.T @ f))
    return (
        STORAGE_ERROR + ratio(norm(more_lam) + norm(closing), force),
        STORAGE_ERROR + ratio(norm(more_u) + norm(gap), norm(new_u)),
    )


def residuals(system: Assembly, f: Array, lam: Array, u: Array) -> tuple[Array, Array]:
    """What lam and u leave: r (dof,) of the balance of each part, and gaps (multiplier,) between them."""
    top, Q = system.topology, system.rigid
    inner = system.strained(u - Q @ (Q.T @ u))
    r = f - top.B @ system.projection.balanced(lam) - (inner - Q @ (Q.T @ inner))
    return r, system.projection.averaged(top.B.T @ u)


def in_doubt(system: Assembly, f: Array, u: Array, imbalance: float, sure: float = ROUNDING_FACTOR) -> Doubt:
    """What nobody knows of the forces on parts under loads f (dof,) that move by u (dof,)."""
    Q, R, strain = system.rigid, system.modes, np.zeros_like(f)
    rigid = Q @ (Q.T @ u)
    inner = u - rigid
    terms = system.strained_terms(np.abs(inner))
    forced, summed = system.strained(rigid), Q.T @ system.strained(inner)
    rounding = system.strained_terms(np.abs(rigid)), abs(Q).T @ terms
    for d, c in zip(system.topology.dofs, system.columns, strict=True):
        pairs = (forced[d], rounding[0][d]), (summed[c], rounding[1][c])
        if any(norm(x) > STRAIN_FACTOR * UNIT * norm(y) for x, y in pairs):
            strain[d] = forced[d] + Q[d, c] @ summed[c]
    size = np.abs(f) + terms
    held = np.abs(inner) + abs(R) @ np.abs(system.pinned @ u)
    gap = sure * UNIT * (system.topology.B.T @ held)
    return Doubt(sure * UNIT * size, imbalance * norm(f) * np.sqrt(sure), strain, gap)


def in_balance(system: Assembly, f: Array) -> Array:
    """Loads (dof,) less, by least squares, what moves the whole."""
    S = system.free_motions
    return np.asarray(f - S @ (S.T @ f))


def norm(x: Array) -> float:
    """Euclidean."""
    return float(np.linalg.norm(x))


def ratio(part: float, whole: float) -> float:
    """Part over whole; none of nothing."""
    return part / whole if part > 0 and whole > 0 else 0.0


def condition_verdict(system: Assembly, f: Array, best: Refined, tolerance: float) -> Verdict:
    """The verdict on the best solution under loads f (dof,); EstimationError where it is useless."""
    if best.worse <= SOUND:
        return Verdict()
    cause, step = cause_of(system, f, best, tolerance)
    off = (
        f"the motions are off by {best.error:.1g} of their size, the forces by {best.lam_error:.1g}: {cause}"
    )
    if not best.worse <= max(USELESS, 10 * tolerance):
        raise EstimationError(off, "", step)
    errors = {"error": best.error, "lam_error": best.lam_error}
    return Verdict("degraded", (Finding("inaccurate-solution", "degraded", errors, f"{off}; {step}"),))


def cause_of(system: Assembly, f: Array, best: Refined, tolerance: float) -> tuple[str, str]:
    """What costs a solution its digits, and what to do about it."""
    doubt = best.doubt
    rounding, strain = norm(doubt.rounding), norm(doubt.strain)
    if strain > max(rounding, doubt.imbalance):
        at = int(np.argmax([norm(doubt.strain[d]) for d in system.topology.dofs]))
        force = ratio(strain, norm(f))
        return (
            f"rigid modes of partition {at} strain it, by forces of {force:.1g} of the loads",
            "give stiffness and rigid modes of one shape with more digits, or leave the modes out",
        )
    if doubt.imbalance > rounding:
        out = ratio(doubt.imbalance, norm(f))
        return (
            f"nothing holds the body, and the loads are out of balance by {out:.1g} of their size",
            "balance them, hold the body, or ask for inertia relief with relief=True",
        )
    if best.worse <= REACHED * tolerance:
        return f"conjugate gradients were stopped at {tolerance:.1g} of the gaps", "ask for a lower tolerance"
    canceled = ratio(norm(f), norm(system.topology.assembled(f)))
    if canceled > CANCELED:
        return (
            f"loads on the partitions are {canceled:.1g} times what they add up to",
            "take what only cancels between partitions out of them",
        )
    mean = np.array([K.diagonal().mean() for K in system.stiffness])
    some = mean[mean > 0]
    jump = float(some.max() / some.min()) if len(some) else 1.0
    if jump > JUMP:
        if best.lam_error > best.error:
            lost = "the forces between stiff ones are lost in the rounding of how far these move"
        else:
            lost = "the loads of stiff ones are known to rounding, which soft ones have to carry"
        return f"stiffness jumps by {jump:.1g} between partitions, and {lost}", "join very stiff partitions"
    return (
        "little holds the body or a part of it, and rounding of the loads moves it: a near mechanism",
        "look for a part that hangs on little stiffness, and hold it",
    )
