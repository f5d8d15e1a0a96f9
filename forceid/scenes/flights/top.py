"""Torque-free top: a rigid body in free fall, its angular momentum constant in world axes.

The wrench is zero (weight excluded), which makes it the zero test of every method. Any inertia, any
markers: masses on the nodes, or a body known as a whole with markers that carry no mass.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from forceid.config import Vector
from forceid.errors import ConfigError
from forceid.records import Array, Body
from forceid.scenes.mechanics import KnownFlight, center_of, inertia_tensor
from forceid.scenes.rigid import RigidState, fly_rigid, rigid_positions
from forceid.sections import Section


class Parameters(Section):
    """position m: nodes in reference axes. Either mass kg of every node, or total_mass kg with mass_center
    m and inertia kg m2 (3 rows, about the mass center). At t = 0: center m, velocity m/s, turn rad
    (rotation vector body to world), spin rad/s in body axes. gravity m/s2 in world axes.
    """

    position: tuple[Vector, ...] = (
        (0.12, 0.0, 0.0),
        (-0.12, 0.0, 0.01),
        (0.0, 0.08, 0.0),
        (0.0, -0.08, 0.02),
        (0.01, 0.0, 0.05),
        (0.0, 0.02, -0.05),
    )
    mass: tuple[float, ...] = ()
    total_mass: float = Field(default=0.3, gt=0.0)
    mass_center: Vector = (0.0, 0.0, 0.0)
    inertia: tuple[Vector, Vector, Vector] = ((6e-4, 0.0, 0.0), (0.0, 1.1e-3, 0.0), (0.0, 0.0, 1.5e-3))
    gravity: Vector = (0.0, 0.0, -9.81)
    center: Vector = (0.0, 0.0, 1.0)
    velocity: Vector = (1.0, 0.3, 4.0)
    turn: Vector = (0.3, -0.2, 0.5)
    spin: Vector = (0.8, 18.0, 0.4)

    @model_validator(mode="after")
    def _one_mass_a_node(self) -> Parameters:
        if self.mass and len(self.mass) != len(self.position):
            raise ValueError(f"{len(self.mass)} masses for {len(self.position)} nodes")
        return self


def top_body(parameters: Parameters) -> Body:
    """The top as a motion file describes it."""
    p = parameters
    node, X = tuple(f"marker_{i + 1}" for i in range(len(p.position))), np.array(p.position)
    if p.mass:
        return Body(node=node, position=X, mass=np.array(p.mass))
    center, inertia = np.array(p.mass_center), np.array(p.inertia)
    return Body(node=node, position=X, total_mass=p.total_mass, mass_center=center, inertia=inertia)


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The tumbling top at `time` (time,) s. ConfigError: no rotation about some axis has any inertia."""
    p = parameters
    top, X, gravity = top_body(p), np.array(p.position), np.array(p.gravity)
    if p.mass:
        mass = np.array(p.mass)
        middle = center_of(mass, X)
        total, J = float(mass.sum()), inertia_tensor(mass, X - middle)
    else:
        total, middle, J = p.total_mass, np.array(p.mass_center), np.array(p.inertia)
    if np.linalg.matrix_rank(J) < 3:
        raise ConfigError("give an axis no inertia", "recipe: [parameters]", "add mass off the line of nodes")
    R0 = Rotation.from_rotvec(p.turn).as_matrix()
    start = RigidState(np.array(p.center), np.array(p.velocity), R0, R0 @ p.spin)
    truth = fly_rigid(total, J, lambda t, now: (np.zeros(3), np.zeros(3)), start, gravity, time)
    return KnownFlight(top, rigid_positions(truth, X - middle), gravity, truth)
