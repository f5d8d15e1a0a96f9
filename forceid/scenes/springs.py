"""Networks of axial springs with dashpots between point masses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forceid.records import Array


@dataclass(frozen=True)
class Springs:
    """Axial springs with dashpots between pairs of nodes: central forces, so their resultant is zero.

    incidence (spring, node) -1 at the first node, +1 at the second; stiffness (spring,) N/m;
    rest_length (spring,) m; damping (spring,) N s/m.
    """

    incidence: Array
    stiffness: Array
    rest_length: Array
    damping: Array


def connect(rest: Array, pairs: ArrayLike, stiffness: ArrayLike, damping_time: float) -> Springs:
    """Springs between `pairs` of nodes, free of stress at `rest` (node, axis) m.

    stiffness (spring,) N/m; the dashpot of a spring is `damping_time` (s) times its stiffness.
    """
    first, second = np.asarray(pairs).T
    incidence = np.zeros((len(first), len(rest)))
    springs = np.arange(len(first))
    incidence[springs, first], incidence[springs, second] = -1.0, 1.0
    k = np.broadcast_to(np.asarray(stiffness, dtype=float), len(first))
    return Springs(incidence, k, np.linalg.norm(incidence @ rest, axis=1), damping_time * k)


def spring_force(springs: Springs, x: Array, v: Array) -> Array:
    """Nodal forces (node, axis) N of the springs at positions x and velocities v (node, axis)."""
    d = springs.incidence @ x
    length = np.sqrt((d * d).sum(1))
    along = d / length[:, None]
    rate = (along * (springs.incidence @ v)).sum(1)
    tension = springs.stiffness * (length - springs.rest_length) + springs.damping * rate
    return np.asarray(-springs.incidence.T @ (tension[:, None] * along))


def spring_stiffness(springs: Springs, rest: Array) -> Array:
    """Stiffness matrix (dof, dof) N/m linearized at the stress-free shape, degrees of freedom node-major."""
    along = springs.incidence @ rest / springs.rest_length[:, None]
    strain = (springs.incidence[:, :, None] * along[:, None, :]).reshape(len(along), -1)
    return np.asarray(strain.T @ (springs.stiffness[:, None] * strain))
