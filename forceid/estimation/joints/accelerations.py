"""What joints keep, differentiated twice: rows on forces and moments.

A joint that keeps two parts at one place keeps their accelerations there, c'' + alpha x r + w x (w x r),
alike; one that keeps two directions at right angles does so too. With c'' = F/m + g and J alpha = T - w x H
these are rows on the wrenches, and on rotation and angular momentum, about the references of both parts;
their slopes are central differences. Source: principal equations 2.8, 4b, 4f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.estimation.joints.constraints import Constraints, kept, turns_of
from forceid.estimation.joints.parts import Joint, Part
from forceid.partition.coupling.resultants import GROUND
from forceid.records import Array
from forceid.rounding import CENTRAL_STEP


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
