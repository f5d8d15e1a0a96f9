"""Spinning block: a soft hyperelastic cuboid, thrown spinning, under known forces and first moments.

It deforms affinely: eight corners carry its mass and the markers. The spin stretches it, the throw sets it
swinging about that stretch, and nothing damps it.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field, PositiveFloat

from forceid.records import Array
from forceid.scenes.affine_body import AffineParameters, AffineThrow, fly_affine
from forceid.scenes.mechanics import KnownFlight

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


class Parameters(AffineParameters):
    """mass kg, in equal shares on the corners of a block of `size` m. Mooney-Rivlin constants a, b, c J of
    the whole block: W = a I1 + b I2 + c J^2 - d log J, with the d that leaves the block free of stress.
    """

    mass: PositiveFloat = 0.5
    size: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = (0.24, 0.18, 0.14)
    a: PositiveFloat = 2.5
    b: float = Field(default=0.5, ge=0.0)
    c: float = Field(default=2.0, ge=0.0)


def gradient(parameters: Parameters, F: Array) -> Array:
    """dW/dF (3, 3) J at F (3, 3)."""
    p = parameters
    d = 2 * p.a + 4 * p.b + 2 * p.c
    C = F.T @ F
    volume = 2 * p.c * np.linalg.det(F) ** 2 - d
    return np.asarray(2 * p.a * F + 2 * p.b * (np.trace(C) * F - F @ C) + volume * np.linalg.inv(F).T)


def throw(parameters: Parameters) -> AffineThrow:
    """The block as it is thrown, free of stress."""
    p, rest = parameters, CORNERS * np.array(parameters.size)
    return AffineThrow(np.full(8, p.mass / 8), rest, lambda F: gradient(p, F), p, np.zeros((3, 3)))


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The thrown block at `time` (time,) s."""
    return fly_affine(throw(parameters), tuple(f"corner_{k + 1}" for k in range(8)), time)
