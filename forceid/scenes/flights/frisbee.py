r"""Frisbee: a rigid disc with lift, drag and the four aerodynamic moments of Hummel's flight model.

Disc axes: z_hat is the disc normal, out of its upper side; x_hat the direction of the velocity projected
on the disc; y_hat = z_hat x x_hat points left. Angular velocities w_x, w_y, w_z are the components of the
body's angular velocity along them, in rad/s. With q = rho v^2 / 2, area A, diameter D = 2 sqrt(A / pi) and
the angle of attack alpha = -atan(v.z_hat / v.x_hat), positive when the air strikes the lower side:

    lift   q A (PL0 + PLa alpha)                  along v_hat x y_hat
    drag   q A (PD0 + PDa (alpha - alpha0)^2)     along -v_hat
    roll   q A D (PTxwx w_x + PTxwz w_z)          about  x_hat
    pitch  q A D (PTy0 + PTya alpha)              about -y_hat, so positive lifts the nose
           q A D PTywy w_y                        about  y_hat, a damping
    spin   q A D PTzwz w_z                        about  z_hat

Hummel (2003, CoefUsed = 1 of her simulation) takes y to the right and z down: the pitch coefficients keep
her sign, nose up, and PTxwz, which couples an axis that turns round with one that does not, changes it.
Two scalings differ from hers: PTxwz lacks her factor sqrt(D / g) = 0.17 s, so that this disc rears up sooner
than hers, and PTzwz carries the factor q A D (0.98 N m at 10 m/s), which hers does not.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from forceid.config import Vector
from forceid.records import Array, Body
from forceid.scenes.mechanics import KnownFlight
from forceid.scenes.rigid import RigidState, fly_rigid, rigid_positions
from forceid.sections import Section


class Coefficients(Section):
    """Aerodynamic coefficients: PL*, PD*, PTy0 1; PTya 1/rad; PT*w* s/rad; alpha0 deg."""

    PL0: float = 0.33
    PLa: float = 1.9
    PD0: float = 0.18
    PDa: float = 0.69
    PTxwx: float = -0.013
    PTxwz: float = -0.0017
    PTy0: float = -0.082
    PTya: float = 0.43
    PTywy: float = -0.014
    PTzwz: float = -3.4e-5
    alpha0: float = 4.0


class Parameters(Section):
    """mass kg, area m2, inertia_xx and inertia_zz kg m2, air_density kg/m3, gravity m/s2 in world axes.
    At t = 0: center m, speed m/s along world x, nose_up and bank deg (left side up positive), spin
    rad/s about the upward normal. markers: number on the rim; three more sit on the top.
    """

    mass: float = Field(default=0.175, gt=0.0)
    area: float = Field(default=0.058556, gt=0.0)
    inertia_xx: float = Field(default=0.001219, gt=0.0)
    inertia_zz: float = Field(default=0.002352, gt=0.0)
    air_density: float = 1.225
    gravity: Vector = (0.0, 0.0, -9.81)
    center: Vector = (0.0, 0.0, 1.2)
    speed: float = Field(default=10.0, gt=0.0)
    nose_up: float = 8.0
    bank: float = 0.0
    spin: float = 62.0
    markers: int = Field(default=6, ge=3)
    coefficients: Coefficients = Coefficients()

    @property
    def diameter(self) -> float:
        """Diameter (m) of the disc of the given area."""
        return float(2.0 * np.sqrt(self.area / np.pi))


def aerodynamic_wrench(parameters: Parameters, now: RigidState) -> tuple[Array, Array]:
    """Force (3,) N and moment (3,) N m about the mass center, world axes, at one instant."""
    k, v, z_hat = parameters.coefficients, now.velocity, now.R[:, 2]
    climb = v @ z_hat
    in_plane = v - climb * z_hat
    glide = np.sqrt(in_plane @ in_plane)
    x_hat = in_plane / glide
    y_hat = np.cross(z_hat, x_hat)
    v_hat = v / np.sqrt(v @ v)
    alpha = -np.arctan2(climb, glide)
    w_x, w_y, w_z = x_hat @ now.omega, y_hat @ now.omega, z_hat @ now.omega
    qA = 0.5 * parameters.air_density * (v @ v) * parameters.area
    lift = k.PL0 + k.PLa * alpha
    drag = k.PD0 + k.PDa * (alpha - np.radians(k.alpha0)) ** 2
    roll = k.PTxwx * w_x + k.PTxwz * w_z
    pitch = k.PTywy * w_y - (k.PTy0 + k.PTya * alpha)
    force = qA * (lift * np.cross(v_hat, y_hat) - drag * v_hat)
    moment = qA * parameters.diameter * (roll * x_hat + pitch * y_hat + k.PTzwz * w_z * z_hat)
    return force, moment


def marker_positions(parameters: Parameters) -> Array:
    """Markers (node, 3) m about the mass center: evenly on the rim, three on the raised top, body axes."""
    rim = 2.0 * np.pi * np.arange(parameters.markers) / parameters.markers
    top = 2.0 * np.pi * np.array([0.1, 0.4, 0.8])
    radius = 0.5 * parameters.diameter
    on_rim = np.column_stack([radius * np.cos(rim), radius * np.sin(rim), np.full(len(rim), -0.01)])
    on_top = np.column_stack([0.4 * radius * np.cos(top), 0.4 * radius * np.sin(top), np.full(3, 0.02)])
    return np.vstack([on_rim, on_top])


def launch(parameters: Parameters) -> RigidState:
    """The state at t = 0."""
    p = parameters
    bank = Rotation.from_rotvec([np.radians(p.bank), 0.0, 0.0])
    R0 = (Rotation.from_rotvec([0.0, -np.radians(p.nose_up), 0.0]) * bank).as_matrix()
    return RigidState(np.array(p.center), np.array([p.speed, 0.0, 0.0]), R0, p.spin * R0[:, 2])


def fly(parameters: Parameters, time: Array) -> KnownFlight:
    """The flying disc at `time` (time,) s."""
    p = parameters
    X, gravity = marker_positions(p), np.array(p.gravity)
    J = np.diag([p.inertia_xx, p.inertia_xx, p.inertia_zz])
    truth = fly_rigid(p.mass, J, lambda t, now: aerodynamic_wrench(p, now), launch(p), gravity, time)
    node = tuple([f"rim_{i + 1}" for i in range(p.markers)] + [f"top_{i}" for i in (1, 2, 3)])
    body = Body(node=node, position=X, total_mass=p.mass, mass_center=np.zeros(3), inertia=J)
    return KnownFlight(body, rigid_positions(truth, X), gravity, truth)
