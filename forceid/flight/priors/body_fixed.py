"""A load that keeps to axes of the body: its states in world axes, turned from sample to sample.

A thrust, a leak, a fin is slow in the axes of the body only. Source: principal equations 4f.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.spatial.transform import Rotation

from forceid.records import Array

GAUSS = 0.5 + 0.5 * np.array(leggauss(3)[0]), 0.5 * np.array(leggauss(3)[1])  # points, weights on 0 to 1


def fix_to_body(
    F: Array, Q: Array, P0: Array, n: int, step: Array, rotation: Array, axes: Array
) -> tuple[Array, Array, Array]:
    """A chain of n states whose load keeps to axes (3, 3) of a body, with all of its states in world axes.

    The load's states turn with the body; what they add to the integrals Y and H over a step is turned by the
    mean rotation of the step, weighted for Y as a push early in it counts more.
    """
    at = rotation @ axes
    early, mean = (turn @ axes for turn in swept(step, rotation))
    begin, end = (np.tile(np.eye(F.shape[1]), (len(F), 1, 1)) for _ in range(2))
    start = np.eye(F.shape[1])
    for i in range(6, n, 3):
        load = slice(i, i + 3)
        begin[:, load, load], end[:, load, load], start[load, load] = at[:-1], at[1:], at[0]
    free = F[:, :6, :6].copy()
    end[:, :3, :3], end[:, 3:6, 3:6] = early, mean
    F = end @ F @ begin.swapaxes(1, 2)
    F[:, :6, :6] = free
    return F, end @ Q @ end.swapaxes(1, 2), start @ P0 @ start.T


def swept(step: Array, rotation: Array) -> tuple[Array, Array]:
    """Mean rotations (time - 1, 3, 3) over each step (s), weighted as a push counts for Y, and for H.

    A spin that changes evenly from step to step bends the way between two rotations.
    """
    turn = Rotation.from_matrix(rotation[1:] @ rotation[:-1].swapaxes(1, 2)).as_rotvec()
    bend = np.zeros_like(turn)
    if len(step) > 1:
        middle = np.cumsum(step) - 0.5 * step
        bend = 0.5 * step[:, None] ** 2 * np.gradient(turn / step[:, None], middle, axis=0)
    by = np.stack([Rotation.from_rotvec(u * turn - u * (1 - u) * bend).as_matrix() for u in GAUSS[0]])
    weights = 2 * (1 - GAUSS[0]) * GAUSS[1], GAUSS[1]
    early, mean = (np.einsum("u,utab->tab", w, by) @ rotation[:-1] for w in weights)
    return early, mean
