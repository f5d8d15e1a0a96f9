"""Which joints hold their parts together as stated, what these keep then, and which move or may bend.

Source: principal equations 2.8, 4f, 4h.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from forceid.estimation.joints.constraints import Constraints, PartMotion, accelerated, held_poses
from forceid.estimation.joints.linkage import Linkage, pose_cov
from forceid.estimation.joints.linked_flight import LinkedPart
from forceid.estimation.joints.parts import Joint, Part
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.records import Array, Estimate, Finding
from forceid.significance import DENIED

HELD = 0.004  # standard deviations of parts by themselves, to which accelerations are held


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
