"""All parts of a body smoothed under what their joints forbid, where the record bears that out.

Source: principal equations 2.8, 4f, 4h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forceid.config import Settings
from forceid.estimation.joints.bending import Bending
from forceid.estimation.joints.constraints import stacked_constraints
from forceid.estimation.joints.holding import constraints_of
from forceid.estimation.joints.link_loads import LinkLoad, link_loads
from forceid.estimation.joints.linkage import Linkage, about_center, at_joints, carried_over, split
from forceid.estimation.joints.linked_flight import LinkedFlight, linked_parts
from forceid.estimation.joints.linked_smoothing import smooth_linked
from forceid.estimation.joints.linked_tuning import tuned_linked
from forceid.estimation.joints.parts import Joint, Part
from forceid.estimation.methods.problem import Solution
from forceid.flight.tuning import FREE
from forceid.kalman.engines import Engine, engine
from forceid.principal import transport
from forceid.records import Array, Estimate, Finding
from forceid.rounding import SINGLE
from forceid.significance import CHANCE, SIGMAS


@dataclass(frozen=True)
class Together:
    """Wrenches (time, part, 6) about the center of all parts smoothed together, their covariance (time, part
    * 6, part * 6), and what the loads of the links were taken for.
    """

    wrench: Array
    cov: Array
    loads: Sequence[LinkLoad]


def smooth_linked_parts(
    linkage: Linkage,
    parts: tuple[Part, ...],
    joints: tuple[Joint, ...],
    estimates: list[Estimate],
    solutions: list[Solution | None],
    settings: Settings,
) -> tuple[Together | None, list[Finding]]:
    """The parts smoothed together, and findings; None where one was not smoothed by itself, or where they
    contradict.
    """
    passes = engine(settings.engine)
    if sharp(linkage, solutions) or not (parted := linked_parts(solutions)):
        return None, []
    constraints, held, findings = constraints_of(linkage, joints, parts, parted, estimates, solutions)
    tied = stacked_constraints(constraints, len(linkage.center), len(parts))
    unplaced = moment_unplaced(linkage, estimates)
    found: list[tuple[float, LinkedFlight, Bending]] = []
    near = np.zeros(6)
    for order in (FREE, FREE - 1, FREE - 2):  # the smoothest first
        guess = link_loads(linkage, estimates, order, held)
        if not guess:
            return None, findings
        flight = LinkedFlight(parted, guess, tied, unplaced)
        flight, bending, likely, near = tuned_linked(flight, passes, near)
        found.append((likely, flight, bending))
        if likely < max(value for value, *_ in found) + np.log(CHANCE):
            break
    smoothed = smooth_under_orders(found, passes)
    if smoothed is None:
        return None, findings
    w, C, loads = smoothed
    carry = carried_over(linkage)
    for k, solution in enumerate(solutions):
        assert solution is not None
        assert solution.smoothing is not None
        own = slice(6 * k, 6 * k + 6)
        C[:, own, own] += solution.smoothing.allowance
    C *= grown_together(solutions) ** 2
    if contradicted(w, C, estimates):
        return None, findings  # for the test of consistency
    return Together(transport(w, linkage.arms), carry @ C @ carry.mT, loads), findings


def contradicted(wrench: Array, cov: Array, estimates: Sequence[Estimate]) -> bool:
    """Whether wrenches (time, part, 6) of parts smoothed together, of covariance (time, part * 6, part * 6),
    are off those of the parts by themselves beyond the claims of both.

    A light part between large loads knows its own wrench, their difference, better than all parts together
    know it: these know nothing of how smooth that difference is.
    """
    moved = wrench - np.stack([np.concatenate([e.force, e.moment], 1) for e in estimates], 1)
    alone = np.stack([np.diagonal(e.wrench_cov, axis1=1, axis2=2) for e in estimates], 1)
    claimed = alone + np.diagonal(cov, axis1=1, axis2=2).reshape(alone.shape)
    return bool(np.nanmean(moved**2 / claimed) > SIGMAS**2)


def smooth_under_orders(
    found: list[tuple[float, LinkedFlight, Bending]], passes: Engine
) -> tuple[Array, Array, Sequence[LinkLoad]] | None:
    """Wrenches (time, part, 6), covariance (time, part * 6, part * 6), and loads of the likeliest order.

    found: log-likelihood, flight and bending of each order. Orders that a record does not tell apart share by
    their likelihoods, and what they differ by is claimed. None where all are lost to rounding.
    """
    kept: list[tuple[float, Array, Array]] = []
    best: tuple[float, Sequence[LinkLoad]] | None = None
    for likely, flight, bending in sorted(found, key=lambda one: -one[0]):
        if best is not None and likely < best[0] + np.log(CHANCE):
            break
        w, C = smooth_linked(flight, bending, passes)
        if np.isfinite(C[np.isfinite(w).all((1, 2))]).all():  # else a prior so smooth is lost to rounding
            best = (likely, flight.loads) if best is None else best
            kept.append((np.exp(likely - best[0]), w, C))
    if best is None:
        return None
    share = np.array([one for one, *_ in kept]) / sum(one for one, *_ in kept)
    w = np.einsum("o,otpa->tpa", share, [w for _, w, _ in kept])
    off = [(own - w).reshape(len(w), -1, 1) for _, own, _ in kept]
    spread = (part * (C + d @ d.mT) for part, (*_, C), d in zip(share, kept, off, strict=True))
    return w, np.asarray(sum(spread)), best[1]


def grown_together(solutions: Sequence[Solution | None]) -> float:
    """Factor on claimed deviations that allows for what the record does not tell of the priors.

    One for all, lest balances that are all but exact were upset. What drives the parts has one order: so
    all parts tell it, and each axis its own rate and size.
    """
    told = [(s.growth, s.rivals) for s in solutions if s is not None]
    orders = np.sum([rivals.orders for _, rivals in told if rivals is not None], axis=0)
    found = [
        typical(growth) * typical(rivals.growth(orders)) / typical(rivals.growth())
        for growth, rivals in told
        if growth is not None and rivals is not None
    ]
    return float(np.mean(found or [1.0]))


def typical(growth: Array) -> float:
    """The mean factor of growth ([time,] 6, 6)."""
    return float(np.trace(growth, axis1=-2, axis2=-1).mean() / len(growth.T))


def sharp(linkage: Linkage, solutions: list[Solution | None]) -> bool:
    """Whether frames show the poses to rounding: parts by themselves do, and constraints lose digits."""
    frames = [s.smoothing.flight.pose_cov for s in solutions if s is not None and s.smoothing is not None]
    noise = [float(np.sqrt(np.nanmean(np.einsum("taa->t", cov[:, :3, :3])))) for cov in frames]
    return max(noise, default=0.0) < SINGLE * float(np.sqrt(np.nanmean((linkage.arms**2).sum(-1))))


def moment_unplaced(linkage: Linkage, estimates: list[Estimate]) -> Array:
    """Variance (time, part) of the moment on each part, N2 m2, since where joints are and how their axes
    stand is known by so much.

    By what each joint passes: a light part between two others passes far more than moves it.
    """
    wrench, _ = about_center(linkage, estimates)
    time, joints = len(wrench), linkage.point.shape[1]
    passed = -(split(linkage) @ wrench.reshape(time, -1, 1)).reshape(time, -1, 6)[:, :joints]
    force, moment, _ = at_joints(linkage, passed, np.zeros((time, 6 * joints, 6 * joints)))
    reach, tilt = (np.einsum("tjaa->tj", cov) for cov in (linkage.point_cov, linkage.tilt))
    each = (force**2).sum(2) * reach + (moment**2).sum(2) * tilt
    held = [[k in ends for ends in linkage.links[:joints]] for k in range(len(estimates))]
    return np.asarray(each @ np.array(held, float).T)
