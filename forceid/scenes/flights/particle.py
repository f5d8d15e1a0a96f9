"""Particle: one marker, one mass, a force of one sine along each axis. The smallest scene, in closed form."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from forceid.config import Vector
from forceid.records import Array, Body
from forceid.scenes.mechanics import Frequencies, KnownFlight, harmonic_flight
from forceid.sections import Section


class Parameters(Section):
    """mass kg; load N: amplitudes along world x, y, z at load_frequency Hz; gravity m/s2; at t = 0:
    center m, velocity m/s.
    """

    mass: float = Field(default=0.1, gt=0.0)
    load: Vector = (0.5, 0.3, 0.2)
    load_frequency: Frequencies = (1.0, 1.7, 2.3)
    gravity: Vector = (0.0, 0.0, -9.81)
    center: Vector = (0.0, 0.0, 1.0)
    velocity: Vector = (2.0, 0.0, 5.0)


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The particle at `time` (time,) s; its truth has no orientation."""
    p = parameters
    gravity, start = np.array(p.gravity), (np.array(p.center), np.array(p.velocity))
    load, frequency = np.array([p.load]), np.array([p.load_frequency])
    truth = harmonic_flight(p.mass, load, frequency, start, gravity, time)
    truth["moment"] = np.zeros_like(truth["force"])
    body = Body(node=("particle",), position=np.zeros((1, 3)), mass=np.array([p.mass]))
    return KnownFlight(body, truth["center"][:, None], gravity, truth)
