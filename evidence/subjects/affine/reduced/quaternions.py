"""Quaternions, scalar last, of rotations that are integrated, and their rates."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.principal import cross, cross_matrix
from forceid.records import Array


def rotation(q: Array) -> Array:
    """Rotation matrix (..., 3, 3) of quaternion q (..., 4), scalar last, of any length but 0.

    >>> rotation(np.array([0.0, 0, 2, 2])) @ np.array([1.0, 0, 0])
    array([0., 1., 0.])
    """
    v, w = q[..., :3], q[..., 3, None, None]
    vv = (v * v).sum(-1)[..., None, None]
    R = (w * w - vv) * np.eye(3) + 2 * v[..., :, None] * v[..., None, :] + 2 * w * cross_matrix(v)
    return np.asarray(R / (w * w + vv))


def quaternion(L: Array) -> Array:
    """Unit quaternion (..., 4), scalar last, of rotation matrix L (..., 3, 3)."""
    q = Rotation.from_matrix(L.reshape(-1, 3, 3)).as_quat()
    return np.asarray(q).reshape(*L.shape[:-2], 4)


def quaternion_rates(q: Array, omega: Array) -> Array:
    """Rates q' (..., 4) of L' = L [omega]x: q (..., 4) scalar last, omega (..., 3) rad/s, body axes.

    For R' = [lambda]x R, the rate on the other side, hand in the quaternion of R^T and -lambda.
    """
    v, w = q[..., :3], q[..., 3:]
    return 0.5 * np.concatenate([w * omega + cross(v, omega), -(v * omega).sum(-1, keepdims=True)], axis=-1)
