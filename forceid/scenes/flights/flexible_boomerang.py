"""Flexible boomerang: 15 point masses on 63 springs, thrown at 20 m/s and 10 rev/s.

Source: principal equations 5.7, whose table of forces, moments and momenta this scene reproduces.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.config import Vector
from forceid.records import Array, Body
from forceid.scenes.mechanics import KnownFlight, center_of, deforming_truth, integrate_nodes
from forceid.scenes.springs import Springs, connect, spring_force, spring_stiffness
from forceid.sections import Section

NODES = tuple(
    [f"hub_{i}" for i in (1, 2, 3)]
    + [f"arm_{arm}_{station}_{edge}" for arm in "ab" for station in (1, 2, 3) for edge in ("lead", "trail")]
)
MASS = np.array([0.008, 0.007, 0.007, *2 * (0.0062, 0.0058, 0.0058, 0.0054, 0.0066, 0.0062)])
AREA = np.array([0.0012] * 3 + [0.0014] * 12)
HUB_TO_ARM = 0.2
LEVI_CIVITA = np.cross(np.eye(3)[:, None], np.eye(3)).transpose(2, 0, 1)


class Parameters(Section):
    """axial_stiffness N (EA of a spring), damping_time s (dashpot over stiffness), lift and drag 1,
    air_density kg/m3, lift_ripple 1 (scales both sinusoids of the lift), gravity m/s2 world axes; at
    t = 0: center m, velocity m/s, spin rad/s in body axes. stiffness: whether /body holds the stiffness.
    """

    axial_stiffness: float = 2400.0
    damping_time: float = 4e-5
    lift: float = 0.5
    drag: float = 0.06
    air_density: float = 1.2
    lift_ripple: float = 1.0
    gravity: Vector = (0.0, 0.0, -9.81)
    center: Vector = (0.0, 0.0, 1.8)
    velocity: Vector = (20.0, 0.0, 2.0)
    spin: Vector = (0.5, -0.3, 20.0 * np.pi)
    stiffness: bool = True


def rest_shape() -> Array:
    """Undeformed nodes (node, 3) m about their mass center, reference axes."""
    hub = [[-0.02, 0.0, 0.0], [0.015, 0.03, 0.012], [0.015, -0.03, -0.012]]
    arms = []
    for angle in np.radians([55.0, -55.0]):
        along = np.array([np.cos(angle), np.sin(angle), 0.0])
        across = np.array([-np.sin(angle), np.cos(angle), 0.0])
        for station, height in ((0.09, 0.012), (0.17, -0.012), (0.25, 0.012)):
            offset = 0.018 * across + [0.0, 0.0, height]
            arms += [station * along + offset, station * along - offset]
    X = np.array([*hub, *arms])
    return X - center_of(MASS, X)


def springs(parameters: Parameters) -> Springs:
    """The springs: one between every two nodes closer than 0.2 m at rest, k = EA / length."""
    X = rest_shape()
    length = np.linalg.norm(X[:, None] - X, axis=-1)
    pairs = np.argwhere(np.triu(length < HUB_TO_ARM, k=1))
    return connect(X, pairs, parameters.axial_stiffness / length[tuple(pairs.T)], parameters.damping_time)


def aerodynamic_load(parameters: Parameters, t: float | Array, x: Array, v: Array) -> Array:
    """Lift and drag (..., node, 3) N at time t (...,) s, positions x and velocities v (..., node, 3)."""
    p = parameters
    arm_a = x[..., 3, :] + x[..., 4, :] - 2.0 * x[..., 0, :]
    arm_b = x[..., 9, :] + x[..., 10, :] - 2.0 * x[..., 0, :]
    up = np.einsum("abc,...b,...c->...a", LEVI_CIVITA, arm_b, arm_a)
    normal = up / np.sqrt((up * up).sum(-1))[..., None]
    climb = (v @ normal[..., None])[..., 0]
    speed_squared = (v * v).sum(-1)
    ripple = 0.3 * np.sin(14.0 * np.pi * t) + 0.2 * np.sin(36.0 * np.pi * t + 0.5)
    lift = p.lift * np.asarray(1.0 + p.lift_ripple * ripple)[..., None] * (speed_squared - climb**2)
    drag = p.drag * np.sqrt(speed_squared)
    dynamic = 0.5 * p.air_density * AREA[:, None]
    return np.asarray(dynamic * (lift[..., None] * normal[..., None, :] - drag[..., None] * v))


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The thrown boomerang at `time` (time,) s, with its exact aerodynamic wrench as truth."""
    x, v = trajectory(parameters, time)
    X = rest_shape()
    K = spring_stiffness(springs(parameters), X) if parameters.stiffness else None
    load = aerodynamic_load(parameters, time, x, v)
    body = Body(node=NODES, position=X, mass=MASS, stiffness=K)
    return KnownFlight(body, x, np.array(parameters.gravity), deforming_truth(MASS, X, x, v, load))


def trajectory(parameters: Parameters, time: Array) -> tuple[Array, Array]:
    """Positions and velocities of the nodes, each (time, node, 3), world axes."""
    network, gravity = springs(parameters), np.array(parameters.gravity)
    R0 = Rotation.from_euler("XZ", [np.radians(70.0), 0.3]).as_matrix()
    arm = rest_shape() @ R0.T

    def acceleration(t: float, x: Array, v: Array) -> Array:
        force = spring_force(network, x, v) + aerodynamic_load(parameters, t, x, v)
        return np.asarray(force / MASS[:, None] + gravity)

    v0 = np.array(parameters.velocity) + np.cross(R0 @ parameters.spin, arm)
    return integrate_nodes(acceleration, np.array(parameters.center) + arm, v0, time)
