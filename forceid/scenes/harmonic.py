"""Flight of a mass center under sinusoidal forces, in closed form."""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat

from forceid.records import Array

Frequencies = tuple[PositiveFloat, PositiveFloat, PositiveFloat]


def harmonic_flight(
    mass: float, amplitude: Array, frequency: Array, start: tuple[Array, Array], gravity: Array, time: Array
) -> dict[str, Array]:
    """Closed-form flight of a mass center under forces amplitude * sin(2 pi frequency t) along each axis.

    amplitude (line, 3) N and frequency (line, 3) Hz, world axes; start: center (3,) m and velocity (3,)
    m/s at t = 0. Returns force, center and velocity, each (time, 3).

    >>> t = np.array([0.0, 1.0])
    >>> push = np.array([[2.0, 0.0, 0.0]]), np.ones((1, 3))
    >>> flight = harmonic_flight(1.0, *push, (np.zeros(3), np.zeros(3)), np.zeros(3), t)
    >>> bool(np.isclose(flight["center"][1, 0], 2.0 / (2.0 * np.pi)))
    True
    """
    w = 2.0 * np.pi * frequency
    phase = time[:, None, None] * w
    t = time[:, None]
    center, velocity = start
    return {
        "force": (amplitude * np.sin(phase)).sum(1),
        "velocity": velocity + gravity * t + (amplitude / (mass * w) * (1.0 - np.cos(phase))).sum(1),
        "center": center
        + velocity * t
        + 0.5 * gravity * t**2
        + (amplitude / (mass * w**2) * (phase - np.sin(phase))).sum(1),
    }
