"""Spinning block: a soft hyperelastic cuboid, thrown spinning, under known forces and first moments.

It deforms affinely: eight corners carry its mass and the markers. The spin stretches it, the throw sets it
swinging about that stretch, and nothing damps it.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field, PositiveFloat

from forceid.config import Section, Vector
from forceid.records import Array
from forceid.scenes.affine_body import AffineThrow, fly_affine, rotation_of
from forceid.scenes.mechanics import KnownFlight

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


class Parameters(Section):
    """mass kg, in equal shares on the corners of a block of `size` m. Mooney-Rivlin constants a, b, c J of
    the whole block: W = a I1 + b I2 + c J^2 - d log J, with the d that leaves the block free of stress.
    force N and first_moment N m: standard deviation of each component of the drawn loads, rows of the moments
    in world, columns in reference axes; flat below drawn_frequency Hz, from drawn_seed. gravity m/s2; at
    t = 0: center m, velocity m/s, turn rad (rotation vector), spin rad/s in body axes.
    """

    mass: PositiveFloat = 0.5
    size: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = (0.24, 0.18, 0.14)
    a: PositiveFloat = 2.5
    b: float = Field(default=0.5, ge=0.0)
    c: float = Field(default=2.0, ge=0.0)
    force: float = Field(default=1.0, ge=0.0)
    first_moment: float = Field(default=0.25, ge=0.0)
    drawn_frequency: PositiveFloat = 3.0
    drawn_seed: int = Field(default=0, ge=0)
    gravity: Vector = (0.0, 0.0, -9.81)
    center: Vector = (0.0, 0.0, 1.5)
    velocity: Vector = (2.0, 0.5, 4.0)
    turn: Vector = (0.3, -0.4, 0.2)
    spin: Vector = (1.5, 1.0, 9.0)


def gradient(parameters: Parameters, F: Array) -> Array:
    """dW/dF (3, 3) J at F (3, 3)."""
    p = parameters
    d = 2 * p.a + 4 * p.b + 2 * p.c
    C = F.T @ F
    volume = 2 * p.c * np.linalg.det(F) ** 2 - d
    return np.asarray(2 * p.a * F + 2 * p.b * (np.trace(C) * F - F @ C) + volume * np.linalg.inv(F).T)


def throw(parameters: Parameters) -> AffineThrow:
    """The block as it is thrown, free of stress."""
    p, R = parameters, rotation_of(parameters.turn)
    return AffineThrow(
        np.full(8, p.mass / 8), CORNERS * np.array(p.size), lambda F: gradient(p, F), np.array(p.gravity),
        np.array(p.center), np.array(p.velocity), R, R @ np.array(p.spin), np.zeros((3, 3)),
        p.force, p.first_moment, p.drawn_frequency, p.drawn_seed,
    )  # fmt: skip


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The thrown block at `time` (time,) s."""
    return fly_affine(throw(parameters), tuple(f"corner_{k + 1}" for k in range(8)), time)
