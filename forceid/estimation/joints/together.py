"""All parts of a body smoothed under what their joints forbid, where the record bears that out.

Source: principal equations 2.8, 4f, 4h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from forceid.config import Settings
from forceid.estimation.joints.bending import Bending
from forceid.estimation.joints.constraints import (
    Constraints,
    PartMotion,
    accelerated,
    held_poses,
    stacked_constraints,
)
from forceid.estimation.joints.link_loads import LinkLoad, link_loads
from forceid.estimation.joints.linkage import Linkage, about_center, at_joints, carried_over, pose_cov, split
from forceid.estimation.joints.linked_flight import LinkedFlight, LinkedPart, linked_parts
from forceid.estimation.joints.linked_smoothing import smooth_linked
from forceid.estimation.joints.linked_tuning import tuned_linked
from forceid.estimation.joints.parts import Joint, Part
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.flight.tuning import FREE
from forceid.kalman.engines import Engine, engine
from forceid.principal import transport
from forceid.records import Array, Estimate, Finding
from forceid.rounding import SINGLE
from forceid.significance import CHANCE, DENIED, SIGMAS

HELD = 0.004  # standard deviations of parts by themselves, to which accelerations are held


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
    moved = w - np.stack([np.concatenate([e.force, e.moment], 1) for e in estimates], 1)
    claimed = np.stack([np.diagonal(e.wrench_cov, axis1=1, axis2=2) for e in estimates], 1)
    if np.nanmean(moved**2 / claimed) > SIGMAS**2:
        return None, findings  # parts that contradict each other are for the test of consistency
    return Together(transport(w, linkage.arms), carry @ C @ carry.mT, loads), findings


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

    One for all, lest balances that are all but exact were upset. The loads of all links have one order: so
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


def constraints_of(
    linkage: Linkage,
    joints: tuple[Joint, ...],
    parts: tuple[Part, ...],
    linked: list[LinkedPart],
    estimates: list[Estimate],
    solutions: list[Solution | None],
) -> tuple[list[Constraints], list[int], list[Finding]]:
    """What the joints keep of the poses, and of accelerations where no part bends; of how much of what each
    joint passes these tell; which of them move.

    A joint that moves by more than chance is not held. Of others, parts that are stated to be rigid
    hold it exactly, and parts that may bend as far as the markers let them: how fast these ring nobody says.
    """
    rotation, frame = [p.reference.rotation for p in linked], [p.flight.pose_cov for p in linked]
    centers = np.stack([e.center for e in estimates], 1)
    spread = [pose_cov(solution, len(centers)) for solution in solutions]
    motions = [motion_of(part) for part in linked]
    constraints, held, findings = [], [0] * len(joints), []
    for index, joint in enumerate(joints):
        kept = held_poses(joint, parts, linkage.on[index], rotation, frame, linkage.point[:, index])
        size, times = changed(kept, centers, spread)
        if times:
            findings.append(note("joint-moves", joint=joint.name, times=times, kind=joint.kind))
        elif all(parts[k].rigid for k in joint.moving):
            constraints += [kept, accelerated(joint, parts, motions, give(joint, linked, estimates))]
            held[index] = kept.gap.shape[1]
        else:
            findings.append(note("joint-may-bend", joint=joint.name))
            constraints.append(replace(kept, bends=size))
    return constraints, held, findings


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


def changed(constraints: Constraints, center: Array, pose_cov: list[Array]) -> tuple[Array, float]:
    """By how much what a joint keeps of the poses changes (row,), m and rad; and the larger of place and
    directions in standard deviations of the poses as known, zero where chance explains both.

    center (time, part, 3) m; pose_cov (time, 6, 6) of each part, along its reference. A part that bends moves
    its joint by less than the noise of a frame, and a joint that is held all the same claims far too little.
    """
    T, n = constraints.gap.shape
    rows = constraints.on_motion.reshape(T, n, -1, 9)
    off = constraints.gap - np.einsum("trpa,tpa->tr", rows[..., :3], center)
    noise = sum(
        np.einsum("tra,tab,trb->tr", rows[:, :, k, :6], cov, rows[:, :, k, :6])
        for k, cov in enumerate(pose_cov)
    )
    known = np.isfinite(off).all(1) & np.isfinite(noise).all(1)
    design = constraints.offset[known].reshape(-1, constraints.offset.shape[2])
    constant = np.linalg.lstsq(design, off[known].ravel(), rcond=None)[0]
    left = (off[known].ravel() - design @ constant).reshape(-1, n)
    size, times = np.zeros(n), 0.0
    for part in (slice(0, 3), slice(3, n)):
        if part.start < n:
            square, by_chance = np.mean(left[:, part] ** 2), np.mean(noise[known][:, part])
            size[part] = np.sqrt(square)
            if square / by_chance > chance_limit(left[:, part], part.stop - part.start):
                times = max(times, float(np.sqrt(square / by_chance)))
    return size, times


def motion_of(part: LinkedPart) -> PartMotion:
    """A part along its reference."""
    reference, flight = part.reference, part.flight
    H, T, _ = reference.moment.read(reference.chain)
    return PartMotion(reference.rotation, H, T, flight.mass, flight.inertia, flight.h, flight.gravity)


def give(joint: Joint, linked: list[LinkedPart], estimates: list[Estimate]) -> Array:
    """Variances (time, 2) of accelerations, of place and angle, to which a joint keeps its parts."""
    found = []
    for k in joint.moving:
        cov = np.diagonal(estimates[k].wrench_cov, axis1=1, axis2=2).reshape(-1, 2, 3).mean(2)
        flight = linked[k].flight
        light = np.linalg.eigvalsh(flight.inertia)[:, 0]
        found.append(cov / np.stack([np.full(len(cov), flight.mass**2), light**2], 1))
    return np.asarray(HELD**2 * sum(found))


def chance_limit(series: Array, dof: int) -> float:
    """The mean square per degree of freedom, of `dof` a sample, that chance reaches in one honest record in
    ten thousand; series (time, column) turns about its mean as often as its samples are independent.

    >>> slow = np.sin(np.arange(400.0)[:, None] / 40)
    >>> chance_limit(slow, 3) > chance_limit(slow[:, [0]] * (-1) ** np.arange(400)[:, None], 3) > 1
    True
    """
    turns = np.diff(np.sign(series - series.mean(0)), axis=0) != 0
    independent = max(1.0, float(turns.sum(0).mean()))
    return float(chdtri(dof * independent, DENIED) / (dof * independent))
