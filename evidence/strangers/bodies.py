"""Bodies in the words of the simulator, and how they start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.records import Array


@dataclass(frozen=True)
class Solid:
    """A rigid body about its origin: half its size (3,) m, mass kg, center (3,) m, inertia (3, 3) kg m2."""

    half: Array
    mass: float
    center: Array
    inertia: Array

    @classmethod
    def of(cls, X: Array, mass: Array, half: Array) -> Solid:
        """That of mass points (node,) kg at places (node, 3) m."""
        center = mass @ X / mass.sum()
        E = np.einsum("n,na,nb->ab", mass, X - center, X - center)
        return cls(half, float(mass.sum()), center, np.trace(E) * np.eye(3) - E)

    @classmethod
    def drawn(cls, rng: np.random.Generator, half: Array, mass: float, off: float = 1.0) -> Solid:
        """One of lumps drawn in a box, so that it can exist; off: how far its center is, 0 to 1."""
        X, m = half * rng.uniform(-1, 1, (30, 3)), rng.dirichlet(np.full(30, 2.0))
        return cls.of(X - (1 - off) * (m @ X), mass * m, half)

    @property
    def inertial(self) -> str:
        """Its mass in the words of the simulator."""
        J = self.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        return f'<inertial pos="{words(self.center)}" mass="{self.mass}" fullinertia="{words(J)}"/>'

    def sites(self, rng: np.random.Generator, face: float = 0.3) -> str:
        """4 to 15 markers on its faces, on one of them with a probability."""
        X = self.half * rng.uniform(-1, 1, (int(rng.integers(4, 16)), 3))
        count = np.arange(len(X))
        axis = np.full(len(X), rng.integers(3)) if rng.random() < face else rng.integers(0, 3, len(X))
        side = np.ones(len(X)) if (axis == axis[0]).all() else rng.choice([-1.0, 1.0], len(X))
        X[count, axis] = (side * self.half[axis]).tolist()
        return sites(X)


def words(values: Any) -> str:
    """Numbers in a row."""
    return " ".join(f"{v:.12g}" for v in np.ravel(values))


def sites(X: Array) -> str:
    """Markers at places (marker, 3) m of a body."""
    return "".join(f'<site pos="{words(x)}"/>' for x in X)


def world(inside: str, joint: str = "<freejoint/>", beside: str = "", of: str = "") -> str:
    """A world of one body: what is inside and beside it, and attributes of it."""
    return f"<worldbody>{beside}<body name='body' {of}>{joint}{inside}</body></worldbody>"


def free_start(place: Any, turn: Rotation, velocity: Any, spin: Any) -> tuple[Array, Array]:
    """A start of a free body: place (3,) m, attitude, velocity (3,) m/s, spin (3,) rad/s in body axes."""
    return np.concatenate([place, turn.as_quat(scalar_first=True)]), np.concatenate([velocity, spin])


def flung(rng: np.random.Generator, speed: float, spin: Array, high: float = 0.0) -> tuple[Array, Array]:
    """A start high m above the floor, turned any way, at speed m/s any way, with spin (3,) rad/s."""
    turn = Rotation.random(random_state=rng)
    return free_start(np.append(rng.standard_normal(2), high), turn, speed * unit_direction(rng), spin)


def unit_direction(rng: np.random.Generator) -> Array:
    """A unit vector (3,)."""
    way = rng.standard_normal(3)
    return np.asarray(way / np.linalg.norm(way))
