"""Modes that a body can have: shapes beside its rigid motions, no two alike, swings that die down."""

from __future__ import annotations

import numpy as np

from forceid.errors import DataError
from forceid.files.checks.numbers import NEARLY
from forceid.records import Array, Body


def check_modes(body: Body, where: str) -> None:
    """Frequencies and damping ratios in their range, shapes that are some and differ."""
    if body.mode_frequency is not None and (body.mode_frequency < 0).any():
        raise DataError(
            f"is {body.mode_frequency.min():g} Hz, expected zero or more",
            f"{where}/mode_frequency",
            "correct the frequency",
        )
    damping = body.mode_damping
    if damping is not None and ((damping < 0) | (damping > 1)).any():
        k = int(np.argmax(np.abs(damping - 0.5)))
        raise DataError(
            f"is {damping[k]:g} for mode {k}, expected 0 to 1, as a share of critical damping",
            f"{where}/mode_damping",
            "give the damping ratio, not percent and not a rate",
        )
    if body.mode_shape is not None and body.position is not None and len(body.mode_shape):
        check_shapes(body.mode_shape, body.position, f"{where}/mode_shape")


def check_shapes(shape: Array, position: Array, where: str) -> None:
    """Each shape deforms the body, and none is a sum of the others and a rigid motion."""
    arm = position - position.mean(0)
    arm = arm / (np.sqrt((arm**2).sum(1).mean()) or 1.0)
    turns = np.stack([np.cross(axis, arm) for axis in np.eye(3)])
    rigid = np.concatenate([np.tile(np.eye(3)[:, None], (1, len(arm), 1)), turns]).reshape(6, -1)
    own = shape.reshape(len(shape), -1)
    size = np.linalg.norm(own, axis=1)
    if not size.all():
        k = int(np.argmin(size))
        raise DataError(f"is zero for mode {k}, expected a shape", where, "leave that mode out")
    basis = orthonormal(rigid)
    left = own / size[:, None]
    left = left - left @ basis.T @ basis
    deforming = np.linalg.norm(left, axis=1)
    if (deforming < NEARLY).any():
        k = int(np.argmin(deforming))
        raise DataError(
            f"moves the nodes as a rigid body does in mode {k}, expected shapes that deform it",
            where,
            "leave out rigid modes: an estimate has them anyway",
        )
    for k in range(1, len(left)):
        beside = orthonormal(left[:k])
        if np.linalg.norm(left[k] - left[k] @ beside.T @ beside) < NEARLY * deforming[k]:
            raise DataError(
                f"is for mode {k} a sum of those before it and a rigid motion, expected shapes of their own",
                where,
                "leave that mode out",
            )


def orthonormal(rows: Array) -> Array:
    """Orthonormal rows that span the same."""
    _, s, v = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(v[s > NEARLY * s[0]])
