"""Spinner: a rigid ring of markers in fast spin, where centripetal acceleration traps naive averages.

Six markers on a radius of 0.3 m at 10 rev/s feel 1184 m/s2. It cancels in the sum over the ring, and
leaves a false force as soon as one marker is missing. A load at a multiple of the spin can be added: the
frequency that integrator priors miss. Closed form: no integration error.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from forceid.config import Vector
from forceid.records import Array, Body
from forceid.scenes.mechanics import Frequencies, KnownFlight, harmonic_flight, inertia_tensor
from forceid.scenes.rigid import rigid_positions
from forceid.sections import Section


class Parameters(Section):
    """markers, radius m, mass kg (equal shares), spin rev/s about the ring's axis z. load N: amplitudes of
    a slow force at load_frequency Hz along world x, y, z; harmonic_load N at `harmonic` times the spin;
    axial_moment N m: amplitude at moment_frequency Hz about z. gravity m/s2; at t = 0: center, velocity.
    """

    markers: int = Field(default=6, ge=3)
    radius: float = Field(default=0.3, gt=0.0)
    mass: float = Field(default=0.13, gt=0.0)
    spin: float = Field(default=10.0, gt=0.0)
    load: Vector = (1.0, 0.8, 0.6)
    load_frequency: Frequencies = (0.7, 1.1, 1.7)
    harmonic_load: Vector = (0.0, 0.0, 0.0)
    harmonic: float = Field(default=2.0, gt=0.0)
    axial_moment: float = 0.0
    moment_frequency: float = Field(default=1.0, gt=0.0)
    gravity: Vector = (0.0, 0.0, -9.81)
    center: Vector = (0.0, 0.0, 1.0)
    velocity: Vector = (0.0, 0.0, 5.0)


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The spinning ring at `time` (time,) s."""
    p = parameters
    place = 2.0 * np.pi * np.arange(p.markers) / p.markers
    X = p.radius * np.column_stack([np.cos(place), np.sin(place), np.zeros(p.markers)])
    mass = np.full(p.markers, p.mass / p.markers)
    J = inertia_tensor(mass, X)
    amplitude = np.array([p.load, p.harmonic_load])
    frequency = np.array([p.load_frequency, (p.harmonic * p.spin,) * 3])
    start, gravity = (np.array(p.center), np.array(p.velocity)), np.array(p.gravity)
    w = 2.0 * np.pi * p.moment_frequency
    rate = 2.0 * np.pi * p.spin + p.axial_moment / (J[2, 2] * w) * (1.0 - np.cos(w * time))
    angle = 2.0 * np.pi * p.spin * time + p.axial_moment / (J[2, 2] * w**2) * (w * time - np.sin(w * time))
    about_z = np.array([0.0, 0.0, 1.0])
    truth = harmonic_flight(p.mass, amplitude, frequency, start, gravity, time) | {
        "moment": p.axial_moment * np.sin(w * time)[:, None] * about_z,
        "orientation": Rotation.from_rotvec(angle[:, None] * about_z).as_quat(canonical=True),
        "angular_velocity": rate[:, None] * about_z,
        "angular_momentum": J[2, 2] * rate[:, None] * about_z,
    }
    body = Body(node=tuple(f"marker_{i + 1}" for i in range(p.markers)), position=X, mass=mass)
    return KnownFlight(body, rigid_positions(truth, X), gravity, truth)
