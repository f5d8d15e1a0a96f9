"""Planar boomerang of the lecture: three masses, two axial springs and a hinge, tumbling in a vertical plane.

Numbers of principal equations 5.1. The linear stiffness of the lecture turns with the axes at rest and so
pushes a turned body; here the springs are central forces and the hinge has the energy
1/2 k_theta (angle - rest angle)^2 of the angle between the arms. Both are indifferent to rotation, hence
their resultant is zero at any angle, and at rest they linearize to the lecture's matrix with hinge.
"""

from __future__ import annotations

import numpy as np

from forceid.records import Array, Body
from forceid.scenes.mechanics import KnownFlight, deforming_truth, integrate_nodes
from forceid.scenes.springs import Springs, connect, spring_force
from forceid.sections import Section

NODES = ("tip_1", "elbow", "tip_3")
MASS = np.array([0.03, 0.05, 0.04])
REST = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, -0.25]])
REST_ANGLE = -np.pi / 2.0

PlanarVector = tuple[float, float]


class Parameters(Section):
    """arm_stiffness N/m of the arms 1-2 and 2-3, hinge_stiffness N m/rad, damping_time s (dashpot over
    stiffness). load N: amplitudes on the three nodes, world x and y, times sin(2 pi load_frequency t).
    gravity m/s2 in the plane; at t = 0: velocity m/s of the mass center and spin rad/s.
    """

    arm_stiffness: PlanarVector = (2000.0, 1500.0)
    hinge_stiffness: float = 40.0
    damping_time: float = 1e-3
    load: tuple[PlanarVector, PlanarVector, PlanarVector] = ((0.4, -0.2), (0.1, 0.7), (-0.3, 0.5))
    load_frequency: float = 2.0
    gravity: PlanarVector = (0.0, -9.81)
    velocity: PlanarVector = (3.0, 4.0)
    spin: float = 8.0 * np.pi


def arms(parameters: Parameters) -> Springs:
    """The two axial springs."""
    return connect(REST, [[0, 1], [1, 2]], parameters.arm_stiffness, parameters.damping_time)


def hinge_angle(x: Array) -> tuple[float, Array]:
    """Angle (rad) from arm 1-2 to arm 2-3 and its gradient (node, 2) rad/m, at positions x (node, 2) m."""
    d12, d23 = x[1] - x[0], x[2] - x[1]
    t1 = np.array([-d12[1], d12[0]]) / (d12 @ d12)
    t2 = np.array([-d23[1], d23[0]]) / (d23 @ d23)
    angle = np.arctan2(d12[0] * d23[1] - d12[1] * d23[0], d12 @ d23)
    return float(angle), np.array([t1, -t1 - t2, t2])


def internal_force(parameters: Parameters, network: Springs, x: Array, v: Array) -> Array:
    """Forces (node, 2) N of arms (`network`) and hinge at positions x and velocities v (node, 2)."""
    angle, gradient = hinge_angle(x)
    bend = angle - REST_ANGLE + parameters.damping_time * (gradient * v).sum()
    return np.asarray(spring_force(network, x, v) - parameters.hinge_stiffness * bend * gradient)


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The thrown boomerang at `time` (time,) s, embedded in the plane z = 0 of the three-axis layout."""
    p, network = parameters, arms(parameters)
    amplitude, gravity = np.array(p.load), np.array(p.gravity)
    w = 2.0 * np.pi * p.load_frequency

    def acceleration(t: float, x: Array, v: Array) -> Array:
        force = internal_force(p, network, x, v) + amplitude * np.sin(w * t)
        return np.asarray(force / MASS[:, None] + gravity)

    r = REST - MASS @ REST / MASS.sum()
    v0 = np.array(p.velocity) + p.spin * np.column_stack([-r[:, 1], r[:, 0]])
    x, v = integrate_nodes(acceleration, REST, v0, time)
    load = amplitude * np.sin(w * time)[:, None, None]
    x, v, load, rest = (np.pad(a, [(0, 0)] * (a.ndim - 1) + [(0, 1)]) for a in (x, v, load, REST))
    body = Body(node=NODES, position=rest, mass=MASS)
    return KnownFlight(body, x, np.array([*p.gravity, 0.0]), deforming_truth(MASS, rest, x, v, load))
