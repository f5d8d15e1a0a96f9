"""The motion of a line: its direction from points on it, and rotations that follow it without spin."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from forceid.motion import seen_together
from forceid.principal import cross_matrix
from forceid.records import Array, Flags

BETWEEN = 4  # steps from frame to frame in which a line is followed: what it sweeps aside turns the rest
LOOSE = 0.3  # rad: a direction known less well than this is none


def directions(
    position: Array, along: Array, usable: Flags, weight: Array | None, noise_std: float
) -> tuple[Array, Array]:
    """Unit directions (time, 3) of a line from points on it, NaN where unseen; variance (time,) rad2 of each.

    position (time, node, 3), NaN = not seen; along (node,) m: place of each on the line; usable (node,):
    those that lie on it. weight (node,), of zero sum: that of the angular momentum of masses on the line, M
    along; it is taken where all that it weighs is seen, for such a direction is right however the line
    bends. Else least squares. The variance is about either axis across.

    >>> n, var = directions(np.array([[[0.0, 1, 0], [0, 3, 0]]]), np.r_[0.0, 2], np.ones(2, bool), None, 1e-3)
    >>> n[0].tolist(), round(float(var[0]), 9)
    ([0.0, 1.0, 0.0], 5e-07)
    """
    n, var = np.full((len(position), 3), np.nan), np.full(len(position), np.nan)
    patterns, which = seen_together(position)
    for i, pattern in enumerate(patterns):
        at, kept = which == i, pattern & usable
        if weight is not None and not (weight != 0)[~pattern].any():
            a = weight
        elif kept.any():
            a = np.where(kept, along - along[kept].mean(), 0.0)
        else:
            continue
        size, spread = float(a @ along), noise_std * float(np.linalg.norm(a))
        if not size > 0 or spread > LOOSE * size:
            continue
        used = a != 0
        v = np.einsum("n,tna->ta", a[used], position[at][:, used])
        n[at] = v / np.linalg.norm(v, axis=1, keepdims=True)
        var[at] = (spread / size) ** 2
    return n, var


def without_spin(time: Array, direction: Array, axis: Array) -> Array:
    """Rotations (time, 3, 3) that take `axis` (3,) to each direction (time, 3) and never spin about it.

    Parallel transport along the directions, a spline between them; NaN where the direction is.

    >>> n = np.array([[1.0, 0, 0], [0, 1, 0]])
    >>> bool(np.allclose(without_spin(np.arange(2.0), n, n[0]) @ n[0], n))
    True
    """
    R = np.full((len(time), 3, 3), np.nan)
    seen = np.isfinite(direction).all(1)
    t, n = time[seen], direction[seen]
    if not len(t):
        return R
    steps = np.zeros((0, 3, 3))
    if len(t) > 1:
        parts = np.linspace(0.0, 1.0, BETWEEN + 1)
        path = CubicSpline(t, n)(t[:-1, None] + np.diff(t)[:, None] * parts)
        path[:, -1], path[:, 0] = n[1:], n[:-1]
        path /= np.maximum(np.linalg.norm(path, axis=2, keepdims=True), 1e-300)
        steps = shortest(path[:, 0], path[:, 1])
        for k in range(1, BETWEEN):
            steps = shortest(path[:, k], path[:, k + 1]) @ steps
    found = [shortest(axis[None], n[:1])[0]]
    for step in steps:
        found.append(step @ found[-1])
    R[seen] = found
    return R


def shortest(a: Array, b: Array) -> Array:
    """The rotations (n, 3, 3) by the least angle that take unit vectors a (n, 3) to b; none is opposite.

    >>> shortest(np.eye(3)[:1], np.eye(3)[1:2])[0].round(12).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    v = cross_matrix(np.cross(a, b))
    c = np.einsum("ni,ni->n", a, b)
    return np.asarray(np.eye(3) + v + v @ v / np.maximum(1 + c, 1e-12)[:, None, None])
