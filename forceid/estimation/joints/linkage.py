"""Parts and joints as they move: where the joints are, what they can pass, and what that does to the parts.

Source: principal equations 2.8, 4h.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from forceid.estimation.body.kinematics import rotations
from forceid.estimation.joints.bending import Carried, carried
from forceid.estimation.joints.parts import Joint, Part
from forceid.estimation.methods.problem import Solution
from forceid.partition.coupling.resultants import GROUND, incidence, transmitted
from forceid.principal import cross_matrix, transport, transport_cov, transport_matrix
from forceid.records import Array, Estimate
from forceid.rounding import SINGLE


@dataclass(frozen=True)
class Linkage:
    """Parts and joints as they move: world point and gap (time, joint, 3) m, point_cov (time, joint, 3, 3) m2
    and gap_cov alike; center of all parts (time, 3) m and arms (time, part, 3) m from there to their own;
    links (first, second) with passes (time, 6, k) about that center; loads from outside, of the ground, last.
    tilt (time, joint, 3, 3) rad2: covariance of how the free axis of a hinge stands, zero for other joints.
    on: where every joint is on the parts that it holds, by their numbers.
    """

    point: Array
    point_cov: Array
    gap: Array
    gap_cov: Array
    center: Array
    arms: Array
    links: tuple[tuple[int, int], ...]
    passes: tuple[Array, ...]
    tilt: Array
    on: tuple[Mapping[int, Carried], ...]


def linkage_of(
    parts: tuple[Part, ...],
    joints: tuple[Joint, ...],
    estimates: list[Estimate],
    solutions: list[Solution | None],
) -> Linkage:
    """Where joints and parts are at every sample of their estimates, and what the joints can pass."""
    center = np.stack([e.center for e in estimates], 1)
    R = np.stack([rotation_of(e, s) for e, s in zip(estimates, solutions, strict=True)], 1)
    covs = np.stack([pose_cov(solution, len(center)) for solution in solutions], 1)
    return linkage_at(parts, joints, (center, R, covs), solutions)


def linkage_at(
    parts: tuple[Part, ...],
    joints: tuple[Joint, ...],
    poses: tuple[Array, Array, Array],
    solutions: Sequence[Solution | None],
) -> Linkage:
    """The same at poses: centers (time, part, 3) m, rotations (time, part, 3, 3) and their covariances.

    solutions: that carry the joints on parts that deform, None for rigid ones.
    """
    centers, R, covs = poses
    mass = np.array([part.mass for part in parts])
    center = np.einsum("p,tpa->ta", mass / mass.sum(), centers)
    at, spread, links, passes, on = [], [], [], [], []
    for joint in joints:
        on.append({k: carried(joint, parts[k], solutions[k], len(center)) for k in joint.moving})
        ends, off = joint_ends(joint, on[-1], centers, R, covs)
        at.append(ends)
        spread.append(off)
        links.append((joint.before, joint.behind))
        # the point, halfway between what the two parts say of it
        passes.append(transport_matrix(ends.mean(1) - center) @ passed(joint, R[:, joint.moving[0]]))
    for k, part in enumerate(parts):
        if part.external:
            links.append((GROUND, k))
            passes.append(np.broadcast_to(np.eye(6), (len(center), 6, 6)))
    ends, off = np.stack(at, 1), np.stack(spread, 1)
    return Linkage(
        point=ends.mean(2), point_cov=off.sum(2) / 4, gap=ends[:, :, 1] - ends[:, :, 0],
        gap_cov=off.sum(2), center=center, arms=centers - center[:, None],
        links=tuple(links), passes=tuple(passes),
        tilt=np.stack([covs[:, j.moving[0], 3:, 3:] * (j.free == "one") for j in joints], 1), on=tuple(on),
    )  # fmt: skip


def joint_ends(
    joint: Joint, on: Mapping[int, Carried], center: Array, rotation: Array, cov: Array
) -> tuple[Array, Array]:
    """Where both parts of a joint have it (time, 2, 3) m, and the covariances (time, 2, 3, 3) of that.

    on: where it is on the parts; center (time, part, 3), rotation (time, part, 3, 3) and
    cov (time, part, 6, 6) of the poses. The ground has it where the other part has it in the mean, as well as
    known.
    """
    ends, off = {}, {}
    for k in joint.moving:
        arm = np.einsum("tab,tb->ta", rotation[:, k], on[k].arm)
        moved = np.concatenate([np.broadcast_to(np.eye(3), (len(arm), 3, 3)), -cross_matrix(arm)], 2)
        ends[k], off[k] = center[:, k] + arm, moved @ cov[:, k] @ moved.swapaxes(1, 2)
    if GROUND in (joint.before, joint.behind):
        (place,) = ends.values()
        ends[GROUND] = np.broadcast_to(np.nanmean(place, axis=0), place.shape)
        off[GROUND] = np.zeros((len(place), 3, 3))
    both = joint.before, joint.behind
    return np.stack([ends[k] for k in both], 1), np.stack([off[k] for k in both], 1)


def passed(joint: Joint, R: Array) -> Array:
    """Wrenches (time, 6, k) about the joint that it can pass; its axis turns with a part that it holds.

    Forces, then moments across the axis of a hinge, then that about it.
    """
    force = np.broadcast_to(np.eye(6, 3), (len(R), 6, 3))
    if joint.free == "all":
        return force
    if joint.axis is None:
        return np.broadcast_to(np.eye(6), (len(R), 6, 6))
    across = np.linalg.svd(joint.axis[None])[2][1:].T
    turning = across if joint.free == "one" else np.column_stack([across, joint.axis])
    moment = np.concatenate([np.zeros((len(R), 3, turning.shape[1])), R @ turning], 1)
    return np.concatenate([force, moment], 2)


def about_center(linkage: Linkage, estimates: list[Estimate]) -> tuple[Array, Array]:
    """Wrenches (time, part, 6) about the center of all parts, and their covariances (time, part, 6, 6)."""
    w = np.stack([np.concatenate([e.force, e.moment], 1) for e in estimates], 1)
    C = np.stack([e.wrench_cov for e in estimates], 1)
    return transport(w, linkage.arms), transport_cov(C, linkage.arms)


def balances(linkage: Linkage) -> tuple[Array, Array, float]:
    """Effects A (time, part * 6, column) of what links can pass on the parts, moments over a length; the same
    columns E (time, link * 6, column) of the links; and that length (m).
    """
    length = float(np.sqrt(np.nanmean((linkage.arms**2).sum(-1)))) or 1.0
    parts = linkage.arms.shape[1]
    E = transmitted(list(linkage.passes), len(linkage.links), 6)
    A = np.kron(incidence(linkage.links, parts), np.eye(6)) @ E
    return A / np.tile(np.repeat([1.0, length], 3), parts)[:, None], E, length


def carried_over(linkage: Linkage) -> Array:
    """Matrix (time, part * 6, part * 6) from wrenches about the centers of parts to about that of all."""
    T, count = linkage.arms.shape[:2]
    carry = np.zeros((T, 6 * count, 6 * count))
    for k in range(count):
        own = slice(6 * k, 6 * k + 6)
        carry[:, own, own] = transport_matrix(linkage.arms[:, k])
    return carry


def split(linkage: Linkage) -> Array:
    """Matrix (time, link * 6, part * 6) from wrenches that balance to those of the links."""
    A, E, length = balances(linkage)
    known = np.asarray(np.isfinite(A).all((1, 2)))
    back = np.full((len(A), E.shape[1], A.shape[1]), np.nan)
    back[known] = E[known] @ np.linalg.pinv(A[known], rcond=SINGLE)
    return np.asarray(back / np.tile(np.repeat([1.0, length], 3), linkage.arms.shape[1]))


def at_joints(linkage: Linkage, g: Array, C: Array) -> tuple[Array, Array, Array]:
    """Force, moment (time, joint, 3) about the joints, and covariance (time, joint, 6, 6), with that of where
    the joints are and how their axes stand.
    """
    count = g.shape[1]
    each = np.stack([C[:, 6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(count)], 1)
    arm = linkage.center[:, None] - linkage.point
    w, cov = transport(g, arm), transport_cov(each, arm)
    X, turned = cross_matrix(w[..., :3]), cross_matrix(w[..., 3:])
    cov[..., 3:, 3:] += X @ linkage.point_cov @ X.mT + turned @ linkage.tilt @ turned.mT
    return w[..., :3].copy(), w[..., 3:].copy(), cov


def pose_cov(solution: Solution | None, time: int) -> Array:
    """Covariance (time, 6, 6) of the poses of a part: smoothed, or of every frame by itself."""
    if solution is None:
        return np.zeros((time, 6, 6))
    cov = solution.state.pose_cov
    return cov if np.isfinite(cov).any() else solution.kinematics.pose.cov


def rotation_of(estimate: Estimate, solution: Solution | None) -> Array:
    """The rotation (time, 3, 3) that the shapes of a part are seen from: that of its pose."""
    if solution is not None and np.isfinite(solution.state.rotation).any():
        return solution.state.rotation
    return rotations(estimate.orientation)
