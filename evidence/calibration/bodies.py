"""The body that moves, its markers, and what its user says of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from evidence.calibration import distributions as of
from evidence.calibration.distributions import Drawn
from forceid.records import Array, Body


@dataclass(frozen=True)
class Moved:
    """What moves: mass kg, second (3, 3) kg m2, sum of m X X about the mass center, where X is zero.

    markers (marker, 3) m; node_mass (marker,) kg where all mass is at markers; size m; swing Hz, loss and
    strain of a body that deforms, None of a rigid one.
    """

    mass: float
    second: Array
    markers: Array
    node_mass: Array | None
    size: float
    swing: float | None = None
    loss: float = 0.0
    strain: float = 0.0

    @property
    def inertia(self) -> Array:
        """Inertia (3, 3) kg m2 about the mass center."""
        return np.asarray(np.trace(self.second) * np.eye(3) - self.second)


def drawn_body(drawn: Drawn, rng: np.random.Generator) -> Moved:
    """A body; where masses of nodes are told, all its mass is at its markers."""
    edges = np.array([1.0, *rng.uniform(*(of.SOFT_EDGES if drawn.soft else of.EDGES), 2)]) * drawn.size
    mass = of.log_even(rng, of.DENSITIES) * float(np.prod(edges))
    turn = Rotation.random(random_state=rng).as_matrix()
    markers = placed(drawn, edges, rng) @ turn.T
    spread = turn @ np.diag(mass * edges**2 / 12 * rng.uniform(0.5, 1.5, 3)) @ turn.T
    center, node_mass = rng.uniform(-0.15, 0.15, 3) * edges @ turn.T, None
    if drawn.told == "masses of nodes":
        share = rng.uniform(0.5, 1.5, len(markers))
        node_mass = mass * share / share.sum()
        center = node_mass @ markers / mass
        spread = np.einsum("n,na,nb->ab", node_mass, markers - center, markers - center)
    elastic: dict[str, float] = {}
    if drawn.soft:
        swing = min(of.log_even(rng, of.SWINGS), 0.1 * drawn.rate)
        elastic = {
            "swing": swing, "loss": rng.uniform(*of.LOSSES), "strain": of.log_even(rng, of.STRAINS)
        }  # fmt: skip
    return Moved(mass, spread, markers - center, node_mass, drawn.size, **elastic)


def placed(drawn: Drawn, edges: Array, rng: np.random.Generator) -> Array:
    """Markers (marker, 3) in a box of these edges, about its middle; three of them never fall on a line."""
    x = rng.uniform(-0.5, 0.5, (drawn.markers, 3)) * edges
    if drawn.place == "one face":
        face = int(rng.integers(3))
        x[:, face] = 0.5 * edges[face] + rng.uniform(*of.FLAT) * drawn.size * rng.uniform(0, 1, len(x))
    if drawn.place == "near a line":
        x = np.outer(rng.uniform(-0.5, 0.5, len(x)), [edges[0], 0.0, 0.0])
        x += of.log_even(rng, of.THIN) * drawn.size * rng.uniform(-1, 1, x.shape) * [0, 1, 1]
        return x
    flat = np.linalg.svd(x - x.mean(0), compute_uv=False)
    return x if flat[1] > 0.1 * flat[0] else placed(drawn, edges, rng)


def told_body(drawn: Drawn, body: Moved, rng: np.random.Generator) -> tuple[Body, dict[str, Any]]:
    """The body as its user tells it, in axes and from an origin of his, and his settings."""
    names = tuple(f"m{k}" for k in range(len(body.markers)))
    origin = rng.uniform(-1, 1, 3) * body.size
    x = body.markers + origin
    if body.node_mass is not None:
        return Body(names, x, body.node_mass), {}
    mass, center, J = body.mass, origin, body.inertia
    settings: dict[str, Any] = {}
    if drawn.told.startswith("wrong"):
        mass = mass * (1 + of.MASS_OFF * rng.standard_normal())
        center = center + of.CENTER_OFF * body.size * rng.standard_normal(3)
        size, axes = np.linalg.eigh(body.second)
        second = (axes * (size * (1 + of.INERTIA_OFF * rng.standard_normal(3)))) @ axes.T
        J = np.trace(second) * np.eye(3) - second
        if drawn.told != "wrong":
            off = {"mass": of.MASS_OFF, "mass_center": of.CENTER_OFF * body.size, "inertia": of.INERTIA_OFF}
            settings = {"body_std": off}
    return Body(names, x, total_mass=mass, mass_center=center, inertia=J), settings
