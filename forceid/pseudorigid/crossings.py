"""Motions whose singular values meet, or nearly, and what `bipolar_path` makes of them.

Source: pseudo-rigid bodies 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forceid.motion.pose import exp
from forceid.pseudorigid.bipolar_path import bipolar_path, turn_of_bases
from forceid.records import Array, Flags

NEAREST, FARTHEST = 1e-8, 20.0  # closest approaches that are drawn, of the change from frame to frame


@dataclass(frozen=True)
class CrossingSurvey:
    """Paths past a coalescence. miss (path,): closest approach of two values over their change in a frame.

    flagged (path,): whether any frame is not continuous. turn (path,) rad: largest turn of both bases from
    frame to frame, flagged frames left out. jump (path,): largest change of D over that of F. residual
    (path,): largest |F - L D R| / |F| where all is defined; excess (path,): in clusters, over the gap.
    """

    miss: Array
    flagged: Flags
    turn: Array
    jump: Array
    residual: Array
    excess: Array


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


def survey(count: int, rng: np.random.Generator, frames: int = 48) -> CrossingSurvey:
    """What `bipolar_path` makes of `count` random near-crossings.

    >>> found = survey(20, np.random.default_rng(0))
    >>> bool((found.residual < 1e-13).all()), bool((found.jump < 1.01).all())
    (True, True)
    """
    F, miss = near_crossings(count, rng, frames)
    path = bipolar_path(F)
    L, D, R = path
    turn = np.where(path.continuous, np.linalg.norm(turn_of_bases(L, R), axis=-1), 0.0).max(1)
    change = np.linalg.norm(np.diff(F, axis=1), axis=(-2, -1))
    jump = (np.linalg.norm(np.diff(D, axis=1), axis=-1) / change).max(1)
    left = np.linalg.norm(F - L * D[..., None, :] @ R, axis=(-2, -1))
    exact = path.defined.all(-1)
    residual = np.where(exact, left / np.linalg.norm(F, axis=(-2, -1)), 0.0).max(1)
    gap = -np.diff(np.linalg.svd(F, compute_uv=False), axis=-1).min(-1)
    excess = np.where(exact, 0.0, left / np.maximum(gap, 1e-300)).max(1)
    return CrossingSurvey(miss, np.asarray(~path.continuous.all(1)), turn, jump, residual, excess)
