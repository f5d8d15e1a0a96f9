"""Bodies that move affinely whose motion is known without the code under test.

On springs F'' = -k/mu F, which has closed form; of Mooney-Rivlin material by DOP853 near rounding, on forces
that are written down here. Source: pseudo-rigid bodies, sections 1, 3, 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from evidence.vectors import EYE
from forceid.records import Array

TIGHT = 1e-13


@dataclass(frozen=True)
class DeformedFrames:
    """Deformations F and rates dF (frame, 3, 3), in time steps of `step` s; factors: of bipolar frames."""

    F: Array
    dF: Array
    step: float = 1.0


@dataclass(frozen=True)
class Throw:
    """A free body: second moment E (3, 3), constants of its material, start, instants (time,) s, step s.

    material: (a, b, c, d) of Mooney-Rivlin, or (k,) of springs; held: whether det F = 1 is imposed.
    """

    E: Array
    material: tuple[float, ...]
    F0: Array
    dF0: Array
    time: Array
    step: float | None = None
    held: bool = False

    def push(self, F: Array) -> Array:
        """dW/dF (3, 3)."""
        if len(self.material) == 1:
            return self.material[0] * F
        a, b, c, d = self.material
        C, J = F.T @ F, np.linalg.det(F)
        return np.asarray(
            2 * a * F + 2 * b * (np.trace(C) * F - F @ C) + (2 * c * J**2 - d) * np.linalg.inv(F).T
        )

    def acceleration(self, F: Array, V: Array) -> Array:
        """F'' (3, 3), with the multiplier of det F = 1 where that is imposed."""
        inverse = np.linalg.inv(self.E)
        A = -self.push(F) @ inverse
        if not self.held:
            return A
        G = np.linalg.inv(F)
        Y, normal = G @ V, np.linalg.det(F) * G.T @ inverse
        return np.asarray(A + (np.trace(Y @ Y) - np.trace(G @ A)) / np.trace(G @ normal) * normal)

    def rates(self, _: float, y: Array) -> Array:
        """Rate of the state (18,), for solve_ivp."""
        F, V = y.reshape(2, 3, 3)
        return np.concatenate([y[9:], self.acceleration(F, V).ravel()])

    @property
    def start(self) -> Array:
        """State (18,) at time[0]."""
        return np.concatenate([self.F0.ravel(), self.dF0.ravel()])


@dataclass(frozen=True)
class LinearSprings:
    """W = k |F|^2 / 2, as a material: F'' = -k F / mu has closed form, and no barrier at det F = 0."""

    k: float

    def energy(self, F: Array) -> Array:
        """W (...,)."""
        return np.asarray(0.5 * self.k * (F * F).sum((-2, -1)))

    def gradient(self, F: Array) -> Array:
        """dW/dF (..., 3, 3)."""
        return self.k * F

    def hessian(self, F: Array, H: Array) -> Array:
        """Along H, k H."""
        return np.asarray(self.k * np.broadcast_to(H, np.broadcast_shapes(F.shape, H.shape)))


def random_rotations(rng: np.random.Generator, count: int) -> Array:
    """Rotations (count, 3, 3) at random."""
    return np.asarray(Rotation.random(count, random_state=rng).as_matrix())


def natural_constants(a: float, b: float, c: float) -> tuple[float, ...]:
    """Constants of a Mooney-Rivlin material without stress at F = I."""
    return a, b, c, 2 * a + 4 * b + 2 * c


BALL, BLOCK = 1.7 * EYE, np.diag([1.0, 1.5, 2.2])  # second moments, kg m2
SOFT = natural_constants(0.6, 0.25, 0.4)


def unstrained(rng: np.random.Generator, size: float) -> tuple[Array, Array]:
    """F and F' (3, 3) of a start with det F = 1 and no change of it."""
    F = EYE + size * rng.standard_normal((3, 3))
    F /= np.cbrt(np.linalg.det(F))
    V = F @ (0.5 * rng.standard_normal((3, 3)))
    return F, V - np.trace(np.linalg.solve(F, V)) / 3 * F


def followed(throw: Throw, tolerance: float = TIGHT) -> tuple[Array, Array]:
    """F and F' (time, 3, 3) of an elastic body by DOP853 near rounding."""
    options: dict[str, Any] = {"rtol": tolerance, "atol": 0.1 * tolerance, "t_eval": throw.time}
    ends = float(throw.time[0]), float(throw.time[-1])
    with np.errstate(all="ignore"):  # a first step that goes too far is rejected
        y = np.asarray(solve_ivp(throw.rates, ends, throw.start, "DOP853", **options).y.T)
    y = y.reshape(-1, 2, 3, 3)
    return y[:, 0], y[:, 1]


def sprung(throw: Throw) -> tuple[Array, Array]:
    """F and F' (time, 3, 3) of a ball on springs, F'' = -k/mu F, in closed form; NaN from det F = 0 on."""
    w = np.sqrt(throw.material[0] / throw.E[0, 0])
    t = (throw.time - throw.time[0])[:, None, None]
    F = throw.F0 * np.cos(w * t) + throw.dF0 / w * np.sin(w * t)
    V = throw.dF0 * np.cos(w * t) - throw.F0 * w * np.sin(w * t)
    ended = np.logical_or.accumulate(np.linalg.det(F) <= 0)
    F[ended] = V[ended] = np.nan
    return F, V
