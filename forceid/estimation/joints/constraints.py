"""What joints forbid the parts they hold: wrenches that do not balance, and motion they do not let.

The place of a joint is the same on both parts, c_2 + R_2 a_2 = c_1 + R_1 a_1, and directions that a joint
keeps at right angles stay so, R_1 u . R_2 e = 0. To first order about references of both parts, with rotation
errors theta on the left, these are rows on the poses. Where a joint is on each part and how its axes stand is
known roughly: constants of each joint, estimated beside, leave to the rows what changes. Shapes carry the
joint on a part that deforms.

What is kept stays so when it is differentiated twice: accelerations at a place, c'' + alpha x r + w x (w x
r), are alike on both parts. With c'' = F/m + g and J alpha = T - w x H these are rows on the wrenches, and on
rotation and angular momentum; their slopes are central differences. Source: principal equations 2.7, 2.8, 4b,
4f.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.estimation.joints.bending import Carried
from forceid.estimation.joints.parts import Joint, Part
from forceid.partition.coupling.resultants import GROUND
from forceid.principal import cross_matrix
from forceid.records import Array
from forceid.rounding import CENTRAL_STEP

PLACED, ALIGNED = 1e-3, 5e-3  # m, rad: to which place and axes of a joint are known
PLAY = 0.02  # of the noise of one frame, by which a joint may give


@dataclass(frozen=True)
class Constraints:
    """What parts cannot do to each other, as rows on their wrenches (time, row, part * 6) about their own
    centers, on their motion (time, row, part * 9), center (m), rotation error (rad) and angular momentum (kg
    m2/s), and on constants (time, row, constant): they add up to gap (time, row), to within the variances
    slack (time, row). spread (constant,): standard deviations of the constants before anything is seen;
    bends (row,): about how far bending of the parts moves each row, zero where nothing does. NaN rows are
    not used.
    """

    on_wrench: Array
    on_motion: Array
    offset: Array
    gap: Array
    slack: Array
    spread: Array
    bends: Array


def stacked_constraints(constraints: Sequence[Constraints], time: int, parts: int) -> Constraints:
    """All constraints on so many parts at so many times as one, without rows where there are none."""
    none = np.zeros((time, 0))
    constraints = constraints or [
        Constraints(
            np.zeros((time, 0, 6 * parts)), np.zeros((time, 0, 9 * parts)), none[..., None], none, none,
            np.zeros(0), np.zeros(0),
        )
    ]  # fmt: skip
    each = [len(t.spread) for t in constraints]
    at = np.cumsum([0, *each])
    offset = [
        np.pad(t.offset, ((0, 0), (0, 0), (start, at[-1] - start - n)))
        for t, start, n in zip(constraints, at, each, strict=False)
    ]
    names = ("on_wrench", "on_motion", "gap", "slack")
    rows = {name: np.concatenate([getattr(t, name) for t in constraints], 1) for name in names}
    return Constraints(
        offset=np.concatenate(offset, 1), spread=np.concatenate([t.spread for t in constraints]),
        bends=np.concatenate([t.bends for t in constraints]), **rows,
    )  # fmt: skip


def held_poses(
    joint: Joint,
    parts: Sequence[Part],
    on: Mapping[int, Carried],
    rotation: Sequence[Array],
    pose_cov: Sequence[Array],
    place: Array,
) -> Constraints:
    """What a joint keeps of the poses: three rows for its place, one for each pair of directions.

    on: where it is on the parts that it holds; rotation (time, 3, 3): references of all parts; pose_cov
    (time, 6, 6): of one frame of each; place (time, 3) m: where the joint is, for the ground.
    """
    turns = turns_of(joint, rotation)
    pairs = kept(joint)
    time, n = len(place), 3 + len(pairs)
    still = np.broadcast_to(np.nanmean(place, axis=0), place.shape)
    arms = {k: np.einsum("tab,tb->ta", turns[k], on[k].arm) for k in joint.moving}
    arm_a, arm_b = (arms.get(k, still) for k in (joint.before, joint.behind))
    R_a, R_b = turns[joint.before], turns[joint.behind]
    ends = ((joint.before, R_a, 0), (joint.behind, R_b, 1))
    u, e = (np.einsum("tab,kb->tka", R @ on[k].turn if k in on else R, pairs[:, i]) for k, R, i in ends)
    normal = np.cross(u, e)
    rows = np.zeros((time, n, len(parts), 9))
    for k in joint.moving:
        sign = 1 if k == joint.behind else -1
        rows[:, :3, k, :3], rows[:, :3, k, 3:6] = sign * np.eye(3), -sign * cross_matrix(arms[k])
        rows[:, 3:, k, 3:6] = -sign * normal
    gap = np.concatenate([arm_a - arm_b, -(u * e).sum(2)], 1)
    offset = np.zeros((time, n, 6 + len(pairs)))
    offset[:, :3, :3], offset[:, :3, 3:6] = R_a, -R_b
    offset[:, 3:, 6:] = np.eye(len(pairs))
    noise = sum(np.diagonal(pose_cov[k], axis1=1, axis2=2).reshape(time, 2, 3).mean(2) for k in joint.moving)
    slack = PLAY**2 * np.repeat(np.asarray(noise), [3, len(pairs)], axis=1)
    spread = np.repeat([PLACED, ALIGNED], [6, len(pairs)])
    on_wrench = np.zeros((time, n, 6 * len(parts)))
    return Constraints(on_wrench, rows.reshape(time, n, -1), offset, gap, slack, spread, np.zeros(n))


def turns_of(joint: Joint, rotation: Sequence[Array]) -> dict[int, Array]:
    """Rotations (time, 3, 3) of what a joint holds; the ground stands as the other part does halfway."""
    turns = {k: rotation[k] for k in joint.moving}
    (R, *_) = turns.values()
    return {GROUND: np.broadcast_to(R[len(R) // 2], R.shape)} | turns


def kept(joint: Joint) -> Array:
    """Pairs (pair, 2, 3) of directions on the part before and on that behind that stay at right angles."""
    if joint.kind == "ball" or (joint.kind == "hinge" and joint.axis is None):
        return np.zeros((0, 2, 3))
    if joint.kind == "hinge":
        assert joint.axis is not None
        return np.stack([[u, joint.axis] for u in np.linalg.svd(joint.axis[None])[2][1:]])
    x, y, z = np.eye(3)
    return np.array([[x, y], [y, z], [z, x]])


@dataclass(frozen=True)
class PartMotion:
    """A rigid part along its reference, world axes: rotation (time, 3, 3), H (time, 3) kg m2/s and T (time,
    3) N m about its center, mass kg, inertia (time, 3, 3) kg m2 and h (time, 3) kg m2/s of what turns inside,
    both in body axes, gravity (3,) m/s2.
    """

    rotation: Array
    H: Array
    T: Array
    mass: float
    inertia: Array
    h: Array
    gravity: Array


def moving(motion: PartMotion, theta: Array, H: Array, F: Array, T: Array) -> tuple[Array, ...]:
    """Rotation, acceleration of the center, angular velocity and acceleration, all by (time, 3)."""
    R = Rotation.from_rotvec(theta).as_matrix() @ motion.rotation
    J = R @ motion.inertia @ R.swapaxes(1, 2)
    turning = H[..., None] - R @ motion.h[..., None]  # of the body alone
    omega = np.asarray(np.linalg.solve(J, turning)[..., 0], float)
    alpha = np.asarray(np.linalg.solve(J, (T - np.cross(omega, H))[..., None])[..., 0], float)
    return R, F / motion.mass + motion.gravity, omega, alpha


def parting(joint: Joint, arms: tuple[Array, Array], a: tuple[Array, ...], b: tuple[Array, ...]) -> Array:
    """Accelerations (time, row) at which two moving parts leave what a joint keeps.

    arms (3,) m: from the centers to the joint, along the axes of the parts.
    """

    def at(arm: Array, R: Array, c: Array, w: Array, alpha: Array) -> Array:
        r = R @ arm
        return np.asarray(c + np.cross(alpha, r) + np.cross(w, np.cross(w, r)))

    (R_a, _, w_a, alpha_a), (R_b, _, w_b, alpha_b) = a, b
    rows = [at(arms[1], *b) - at(arms[0], *a)]
    for u, e in kept(joint):
        x, y = R_a @ u, R_b @ e
        dx, dy = np.cross(w_a, x), np.cross(w_b, y)
        ddx, ddy = np.cross(alpha_a, x) + np.cross(w_a, dx), np.cross(alpha_b, y) + np.cross(w_b, dy)
        rows.append((ddx * y + 2 * dx * dy + x * ddy).sum(1)[:, None])
    return np.concatenate(rows, 1)


def accelerated(
    joint: Joint, parts: Sequence[Part], motions: Sequence[PartMotion], slack: Array
) -> Constraints:
    """What a joint keeps of the accelerations, on wrenches and motion of the parts.

    slack (time, 2): variances of the accelerations of the place, and of the angles.
    """
    ends = joint.moving
    arm_a, arm_b = (
        joint.at - parts[k].center if k in ends else np.zeros(3) for k in (joint.before, joint.behind)
    )
    zero = np.zeros(motions[ends[0]].H.shape)
    base: dict[int, tuple[Array, ...]] = {k: (zero, motions[k].H, zero, motions[k].T) for k in ends}
    turns = turns_of(joint, [motion.rotation for motion in motions])
    still = turns[GROUND], zero, zero, zero

    def value(changed: dict[int, tuple[Array, ...]]) -> Array:
        a, b = (moving(motions[k], *changed[k]) if k in ends else still for k in (joint.before, joint.behind))
        return parting(joint, (arm_a, arm_b), a, b)

    gap = -value(base)
    time, n = gap.shape
    on_wrench, on_motion = np.zeros((time, n, len(parts), 6)), np.zeros((time, n, len(parts), 9))
    for k in ends:
        sizes = (1.0, largest_size(motions[k].H), motions[k].mass, largest_size(motions[k].T))
        columns = (on_motion, 3), (on_motion, 6), (on_wrench, 0), (on_wrench, 3)
        for i, (size, (rows, first)) in enumerate(zip(sizes, columns, strict=True)):
            for axis in range(3):
                step = CENTRAL_STEP * size * np.eye(3)[axis]
                beyond, before = (
                    value({**base, k: tuple(v + sign * step * (i == j) for j, v in enumerate(base[k]))})
                    for sign in (1, -1)
                )
                slope = (beyond - before) / (2 * CENTRAL_STEP * size)
                rows[:, :, k, first + axis] = slope
                gap += slope * base[k][i][:, axis, None]
    return Constraints(
        on_wrench.reshape(time, n, -1), on_motion.reshape(time, n, -1), np.zeros((time, n, 0)), gap,
        np.repeat(slack, [3, n - 3], axis=1), np.zeros(0), np.zeros(n),
    )  # fmt: skip


def largest_size(a: Array) -> float:
    """The largest size in an array, one where all of it is zero."""
    return float(np.abs(a).max()) or 1.0
