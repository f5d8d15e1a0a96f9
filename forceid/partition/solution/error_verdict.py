"""The verdict on a solution in parts by its error bound, with what in the body or its loads costs digits.

Source: principal equations 6, which asks for 1e-8 of conjugate gradients.
"""

from __future__ import annotations

import numpy as np

from forceid.errors import EstimationError
from forceid.partition.solution.accuracy import Refined, norm, ratio
from forceid.partition.solution.assembly import Assembly
from forceid.records import Array, Finding, Verdict

SOUND = 1e-8  # error up to which a solution is ok
USELESS = 1e-3  # error from which it is refused, or ten times the tolerance that was asked for
REACHED = 100.0  # times the tolerance, that an error is when nothing but the tolerance is in the way
JUMP = 1e4  # ratio of the stiffnesses of parts, that is told
CANCELED = 1e4  # ratio of the loads on the parts and of what they add up to, that is told


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
