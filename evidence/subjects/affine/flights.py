"""Motion of an affine body in closed form: F = R_z(spin t) S(t), S and the center sums of tones.

F'' and c'' are written down, and with them the force on every mass. Source: pseudo-rigid bodies, section 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.vectors import EYE, hat
from forceid.records import Array

SWING = 0.06
DRIFT = 0.02  # m, of the center
TONE = (0.8, 3.0)  # Hz
COUNT = 6


@dataclass(frozen=True)
class Tones:
    """A motion: center and its second rate fall (time, 3), F and ddF (time, 3, 3)."""

    time: Array
    center: Array
    fall: Array
    F: Array
    ddF: Array


def toned(time: Array, rng: np.random.Generator, swing: float = SWING) -> Tones:
    """A draw. swing: of F, all tones together."""
    w = 2 * np.pi * rng.uniform(*TONE, COUNT)
    phase = rng.uniform(0, 2 * np.pi, COUNT)
    amount = rng.standard_normal((COUNT, 12)) / np.sqrt(COUNT)
    spin = rng.uniform(6, 10)
    waves: list[Callable[[Array], Array]] = [np.cos, lambda x: -np.sin(x), lambda x: -np.cos(x)]
    values = [(wave(np.outer(time, w) + phase) * w**k) @ amount for k, wave in enumerate(waves)]
    S = [swing * v[:, 3:].reshape(-1, 3, 3) for v in values]
    S[0] = S[0] + EYE
    R = np.asarray(Rotation.from_rotvec(np.outer(spin * time, EYE[2])).as_matrix())
    Z = spin * hat(EYE[2])
    ddF = R @ (Z @ Z @ S[0] + 2 * Z @ S[1] + S[2])
    center = DRIFT * values[0][:, :3] + [0.3, 0.1, 1.5]
    return Tones(time, center, DRIFT * values[2][:, :3], R @ S[0], ddF)
