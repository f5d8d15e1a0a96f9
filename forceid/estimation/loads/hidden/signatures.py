"""What channels of loads see of a mass center and an inertia that are told wrong, and of their rivals.

Source: principal equations 2.4, 2.6.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import null_space

from forceid.estimation.body.inertia import Inertia, second_moment
from forceid.estimation.body.kinematics import Kinematics, mapped, shape_at
from forceid.estimation.verdict.body_errors import SYMMETRIC
from forceid.estimation.verdict.sensitivity import length
from forceid.records import Array

BALANCED = 0.01  # of the length of a body: as near its mass center is found by balancing it on an edge


def balanced(inertia: Inertia) -> float:
    """How far off, m, the mass center of a body may well be told: of the length of a rod of its gyration."""
    return BALANCED * float(np.sqrt(12)) * inertia.gyration


def deforming_map(kin: Kinematics, amplitude: Array) -> Array:
    """What a body carries along with its axes (time, 3, 3): its map from the mean shape where that is affine.

    amplitude (time, mode): of its shapes. Of others the identity.
    """
    if kin.model != "affine":
        return np.tile(np.eye(3), (len(kin.time), 1, 1))
    return mapped(kin.shape, shape_at(kin, amplitude))


def by_center(
    time: Array,
    F: Array,
    state: tuple[Array, Array, Array, Array],
    mass: float,
    turning: Sequence[float] = (),
) -> Array:
    """What the channel of a force (time, 3, 27 + 6 each) sees of a mass center told wrong, and its rivals.

    Of each unit, along axes of the body: a place in what it carries, F (time, 3, 3); a force that keeps to
    the body, as of a spring; its rate over the spin, as of a dashpot; a force along one axis that goes with
    the moment about another, over its size, as of a blow beside the center; and one that goes with velocity
    along another and speed, as of air; and of each frequency Hz at which a moment turns it, the two phases
    of a force along each axis of the world, as of a shaker, which makes both. state: rotation (time, 3, 3),
    spin, moment, velocity (time, 3).
    """
    R, omega, moment, velocity = state
    speed = np.linalg.norm(velocity, axis=1)[:, None]
    each = [np.einsum("tba,tb->ta", R, one) for one in (moment, velocity * speed)]
    about = [(one / (length(one) or 1.0))[:, None, None] for one in each]
    forces = np.concatenate([R, *((R[..., None] * one).reshape(len(R), 3, 9) for one in about)], 2)
    once = cumulative_trapezoid(forces, time, axis=0, initial=0) / mass
    twice = cumulative_trapezoid(once, time, axis=0, initial=0)
    damped = once[..., :3] / max(length(omega), 1 / float(np.ptp(time)))
    return np.concatenate([F, twice[..., :3], damped, twice[..., 3:], swung_at(time, turning) / mass], 2)


def swung_at(time: Array, frequencies: Sequence[float]) -> Array:
    """The second integrals (time, 3, 6 each) of loads that swing at frequencies in Hz: of each the two phases
    along each axis of the world.
    """
    w = 2 * np.pi * np.array(frequencies)
    phases = np.stack([np.cos(time[:, None] * w), np.sin(time[:, None] * w)], 2) / (w**2)[:, None]
    return np.asarray((phases.reshape(len(time), 1, -1, 1) * np.eye(3)[:, None]).reshape(len(time), 3, -1))


def by_inertia(time: Array, F: Array, rate: Array, inertia: Array, turning: Sequence[float] = ()) -> Array:
    """What the channel of a moment (time, 3, 6 + 6 each) sees of an inertia told too large, by its columns of
    `parts`, and of a moment that swings at each frequency Hz.

    F, rate (time, 3, 3): of what the body carries, world axes, and its rate; inertia (3, 3) kg m2, body axes.
    The angular momentum of a second moment E is the axial part of F E F'^T.
    """
    H = []
    for wrong in parts(inertia):
        each = F @ second_moment(wrong) @ rate.mT
        H.append(np.stack([each[:, a, b] - each[:, b, a] for a, b in ((1, 2), (2, 0), (0, 1))], 1))
    made = cumulative_trapezoid(np.stack(H, -1), time, axis=0, initial=0)
    return np.concatenate([made, swung_at(time, turning)], 2)


def of_parts(inertia: Array, amounts: Array) -> Array:
    """The inertia (3, 3) that amounts (column,) of the first `parts` of another one make."""
    return np.tensordot(amounts, parts(inertia)[: len(amounts)], 1)


def parts(inertia: Array) -> Array:
    """Parts (6, 3, 3) of an inertia (3, 3), all of one size beside its diagonal, the last along itself."""
    scale, entries = np.sqrt(np.diagonal(inertia)), np.zeros((len(SYMMETRIC), 3, 3))
    for entry, (i, j) in zip(entries, SYMMETRIC, strict=True):
        entry[i, j] = entry[j, i] = scale[i] * scale[j]
    own = np.array([inertia[i, j] / (scale[i] * scale[j]) for i, j in SYMMETRIC])
    own = own[:, None] / np.linalg.norm(own)
    return np.asarray(np.einsum("kp,kij->pij", np.concatenate([null_space(own.T), own], 1), entries))
