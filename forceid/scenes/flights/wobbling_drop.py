"""Wobbling drop: a soft ball whose skin pulls it round, struck so that it swings, under known loads.

Its energy is surface tension times the area of the ellipsoid, and a bulk that gives way a little: det F is
free. Twelve equal masses with markers, the corners of an icosahedron, make its second moment isotropic.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field, PositiveFloat

from forceid.config import Vector
from forceid.records import Array
from forceid.scenes.affine_body import AffineParameters, AffineThrow, fly_affine
from forceid.scenes.mechanics import KnownFlight

GOLDEN = 0.5 * (1 + np.sqrt(5.0))
CORNERS = np.array(
    [np.roll([0.0, s, t * GOLDEN], k) for k in range(3) for s in (-1, 1) for t in (-1, 1)]
) / np.sqrt(1 + GOLDEN**2)
POWER = 1.6075  # of Knud Thomsen's formula for the area of an ellipsoid, good to 1 %


class Parameters(AffineParameters):
    """mass kg in equal shares on twelve points at `radius` m. tension J: surface energy of the round drop;
    bulk J: W = tension area + bulk / 2 (J - 1)^2 less the pressure that the skin puts on the round drop.
    strike 1/s: rate at t = 0 at which the drop lengthens along its x, and half as fast narrows across.
    """

    mass: PositiveFloat = 0.3
    radius: PositiveFloat = 0.1
    tension: PositiveFloat = 4.0
    bulk: PositiveFloat = 3.0
    strike: float = 4.0
    force: float = Field(default=0.5, ge=0.0)
    first_moment: float = Field(default=0.03, ge=0.0)
    drawn_frequency: PositiveFloat = 2.5
    drawn_seed: int = Field(default=1, ge=0)
    velocity: Vector = (0.5, 0.3, 5.0)
    turn: Vector = (0.0, 0.0, 0.0)
    spin: Vector = (0.5, 0.3, 5.0)


def area(D: Array) -> tuple[float, Array]:
    """Area of the ellipsoid with semi-axes D (3,) over that of the unit ball, and its derivative (3,)."""
    pairs = np.array([D[1] * D[2], D[2] * D[0], D[0] * D[1]]) ** POWER
    mean = float(pairs.mean())
    # pair k leaves out axis k, so every axis is in two of them
    return mean ** (1 / POWER), mean ** (1 / POWER - 1) * (pairs.sum() - pairs) / (3 * D)


def gradient(parameters: Parameters, F: Array) -> Array:
    """dW/dF (3, 3) J at F (3, 3)."""
    p = parameters
    L, D, R = np.linalg.svd(F)
    J = float(D.prod())
    g = p.tension * area(D)[1] + (p.bulk * (J - 1) - 2 / 3 * p.tension) * J / D
    return np.asarray((L * g) @ R)


def throw(parameters: Parameters) -> AffineThrow:
    """The round drop as it is struck."""
    p, rate = parameters, parameters.strike * np.diag([1.0, -0.5, -0.5])
    return AffineThrow(np.full(12, p.mass / 12), p.radius * CORNERS, lambda F: gradient(p, F), p, rate)


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The struck drop at `time` (time,) s."""
    return fly_affine(throw(parameters), tuple(f"marker_{k + 1}" for k in range(12)), time)
