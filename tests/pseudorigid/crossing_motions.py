"""Motions whose singular values meet, or nearly, and what `bipolar_path` makes of them.

Source: pseudo-rigid bodies 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from forceid.motion.pose import exp
from forceid.records import Array

NEAREST, FARTHEST = 1e-8, 20.0  # closest approaches that are drawn, of the change from frame to frame


def crossing(t: ArrayLike) -> Array:
    """F (time, 3, 3) = R_z(t) diag(1 + t/2, 1 - t/2, 1) R_z(-2 t): three values cross at t = 0.

    Its factors are these for all small t: omega = e3, lam = -2 e3.

    >>> crossing([0.0])[0].tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    t = np.asarray(t, dtype=float)
    e3 = np.array([0.0, 0.0, 1.0])
    D = np.stack([1 + t / 2, 1 - t / 2, np.ones_like(t)], -1)
    return np.asarray(exp(t[:, None] * e3) * D[:, None] @ exp(-2 * t[:, None] * e3))


def smooth_without_limit(t: ArrayLike) -> Array:
    """F (time, 3, 3), infinitely often differentiable, whose L and R have no limit at t = 0.

    I + exp(-1/t^2)/4 [[cos 2/t, sin 2/t], [sin 2/t, -cos 2/t]] + 1.

    >>> bool((smooth_without_limit([0.0])[0] == np.eye(3)).all())
    True
    """
    t = np.asarray(t, dtype=float)
    s = np.where(np.abs(t) > 0.03, t, 0.03)  # where exp(-1/t^2) is zero in double precision
    size, angle = 0.25 * np.exp(-1 / s**2) * (np.abs(t) > 0.03), 2 / s
    F = np.tile(np.eye(3), (len(t), 1, 1))
    F[:, 0, 0] += size * np.cos(angle)
    F[:, 1, 1] -= size * np.cos(angle)
    F[:, 0, 1] = F[:, 1, 0] = size * np.sin(angle)
    return F


def near_crossings(count: int, rng: np.random.Generator, frames: int = 48) -> tuple[Array, Array]:
    """Random motions F (path, time, 3, 3) of a unit of time in which two values nearly meet, and their miss.

    miss (path,): closest approach over the change of the gap from frame to frame, drawn evenly in its
    logarithm. The bodies spin and their axes turn in them; values are of the order of one.
    """
    step = 1.0 / (frames - 1)
    t = np.linspace(-0.5, 0.5, frames) + rng.uniform(-0.5, 0.5, (count, 1)) * step
    miss = np.exp(rng.uniform(np.log(NEAREST), np.log(FARTHEST), count))
    speed = rng.uniform(0.2, 0.6, (count, 1)) * rng.choice([-1, 1], (count, 1))  # half of the gap's rate
    S = np.zeros((count, frames, 3, 3))
    S[..., 0, 0] = 1 + speed * t
    S[..., 1, 1] = 1 - speed * t
    S[..., 2, 2] = rng.choice([0.4, 2.2], (count, 1))
    S[..., 0, 1] = S[..., 1, 0] = miss[:, None] * np.abs(speed) * step
    bend = rng.uniform(-0.1, 0.1, (count, 1, 3, 3))
    S += (bend + bend.swapaxes(-1, -2)) * (t**2)[..., None, None]
    spin, base = rng.uniform(-1, 1, (2, 2, count, 1, 3))
    turns = exp((base + spin * t[..., None]).reshape(-1, 3)).reshape(2, count, frames, 3, 3)
    return turns[0] @ S @ turns[1], miss
