"""Flight of a rigid body under a law of force and moment, to 1e-13."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.records import Array
from forceid.scenes.mechanics import solve_ode


@dataclass(frozen=True)
class RigidState:
    """One instant of a rigid body: center m, velocity m/s, R body to world, omega rad/s; world axes."""

    center: Array
    velocity: Array
    R: Array
    omega: Array


WrenchLaw = Callable[[float, RigidState], tuple[Array, Array]]


def fly_rigid(
    mass: float, inertia: Array, wrench: WrenchLaw, start: RigidState, gravity: Array, time: Array
) -> dict[str, Array]:
    """Exact flight of a rigid body under `wrench` (force N, moment N m about the mass center, world axes).

    inertia (3, 3) kg m2 in body axes. The state carries the angular momentum in world axes, so that no
    moment leaves it exactly constant. Returns force, moment, center, velocity, orientation,
    angular_velocity and angular_momentum, each (time, ...).
    """
    J_inverse = np.linalg.inv(inertia)

    def unpack(y: Array) -> RigidState:
        R = y[6:15].reshape(3, 3)
        return RigidState(y[:3], y[3:6], R, R @ (J_inverse @ (R.T @ y[15:])))

    def rate(t: float, y: Array) -> Array:
        now = unpack(y)
        force, moment = wrench(t, now)
        R_dot = np.cross(now.omega, now.R, axisb=0, axisc=0)
        return np.concatenate([now.velocity, force / mass + gravity, R_dot.ravel(), moment])

    H0 = start.R @ inertia @ start.R.T @ start.omega
    state0 = np.concatenate([start.center, start.velocity, start.R.ravel(), H0])
    states = solve_ode(rate, state0, time, 1e-13)
    instants = [unpack(y) for y in states]
    wrenches = [wrench(t, now) for t, now in zip(time, instants, strict=True)]
    return {
        "force": np.array([force for force, _ in wrenches]),
        "moment": np.array([moment for _, moment in wrenches]),
        "center": states[:, :3],
        "velocity": states[:, 3:6],
        "orientation": Rotation.from_matrix([now.R for now in instants]).as_quat(canonical=True),
        "angular_velocity": np.array([now.omega for now in instants]),
        "angular_momentum": states[:, 15:],
    }


def rigid_positions(truth: dict[str, Array], X: Array) -> Array:
    """World positions (time, node, 3) m of points of a rigid body, X (node, 3) m from its mass center."""
    R = Rotation.from_quat(truth["orientation"]).as_matrix()
    return np.asarray(truth["center"][:, None] + np.einsum("tab,nb->tna", R, X))
