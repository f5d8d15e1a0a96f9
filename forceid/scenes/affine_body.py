"""Flight of a body that deforms affinely, x = c + F X: own equations of motion, to 1e-12.

F'' E = -dW/dF + N and m c'' = f + m g, with the second moment E = sum m X X^T of its masses and the first
moments N = sum f X^T of the forces on it. Source: pseudo-rigid bodies, section 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydantic import Field, PositiveFloat
from scipy.spatial.transform import Rotation

from forceid.config import Vector
from forceid.records import Array, Body
from forceid.scenes.drawn_loads import draw_periodic, waves
from forceid.scenes.mechanics import KnownFlight, deforming_truth, solve_ode
from forceid.sections import Section

AFFINE_TOLERANCE = 1e-12


class AffineParameters(Section):
    """force N and first_moment N m: deviation of each component of the drawn loads, Matern of order 2,
    rows of the moments in world, columns in reference axes; flat below drawn_frequency Hz, from drawn_seed.
    gravity m/s2; at t = 0: center m, velocity m/s, turn rad (rotation vector), spin rad/s in body axes.
    """

    force: float = Field(default=1.0, ge=0.0)
    first_moment: float = Field(default=0.25, ge=0.0)
    drawn_frequency: PositiveFloat = 3.0
    drawn_seed: int = Field(default=0, ge=0)
    gravity: Vector = (0.0, 0.0, -9.81)
    center: Vector = (0.0, 0.0, 1.5)
    velocity: Vector = (2.0, 0.5, 4.0)
    turn: Vector = (0.3, -0.4, 0.2)
    spin: Vector = (1.5, 1.0, 9.0)


@dataclass(frozen=True)
class AffineThrow:
    """An affine body as it is thrown.

    mass (node,) kg; rest (node, 3) m about the mass center; gradient: dW/dF (3, 3) J of F (3, 3); parameters:
    its loads and its start; stretch_rate (3, 3) 1/s at t = 0, body axes.
    """

    mass: Array
    rest: Array
    gradient: Callable[[Array], Array]
    parameters: AffineParameters
    stretch_rate: Array

    @property
    def second_moment(self) -> Array:
        """E (3, 3) kg m2, reference axes."""
        return np.asarray((self.mass * self.rest.T) @ self.rest)

    def loads(self, time: Array) -> tuple[Array, Array]:
        """Applied force f (time, 3) N and N (time, 3, 3) N m, rows in world, columns in reference axes."""
        p = self.parameters
        std, rate = [p.force] * 3 + [p.first_moment] * 9, 2 * np.pi * p.drawn_frequency
        drawn = waves(time, *draw_periodic(std, rate, np.random.default_rng(p.drawn_seed)))
        return drawn[:, :3], drawn[:, 3:].reshape(-1, 3, 3)


@dataclass(frozen=True)
class AffineMotion:
    """center, velocity (time, 3), F and dF (time, 3, 3)."""

    center: Array
    velocity: Array
    F: Array
    dF: Array


def affine_motion(throw: AffineThrow, time: Array) -> AffineMotion:
    """The motion at `time` (time,) s."""
    p, E_inverse, mass = throw.parameters, np.linalg.inv(throw.second_moment), throw.mass.sum()

    def rate(t: float, y: Array) -> Array:
        f, N = (load[0] for load in throw.loads(np.array([t])))
        ddF = (N - throw.gradient(y[6:15].reshape(3, 3))) @ E_inverse
        return np.concatenate([y[3:6], f / mass + p.gravity, y[15:], ddF.ravel()])

    R = Rotation.from_rotvec(p.turn).as_matrix()
    dF = np.cross(R @ p.spin, R, axisb=0, axisc=0) + R @ throw.stretch_rate
    start = np.concatenate([p.center, p.velocity, R.ravel(), dF.ravel()])
    y = solve_ode(rate, start, time, AFFINE_TOLERANCE)
    return AffineMotion(y[:, :3], y[:, 3:6], y[:, 6:15].reshape(-1, 3, 3), y[:, 15:].reshape(-1, 3, 3))


def fly_affine(throw: AffineThrow, node: tuple[str, ...], time: Array) -> KnownFlight:
    """The flight at `time` (time,) s, with what acted on the body as truth.

    Beside force and moment, first_moment F'' E F^T, of all forces that act on the body, and
    applied_first_moment N F^T, without the stress in it; both (time, 3, 3) N m, about the mass center, world
    axes, row: of the force, column: of its arm. Half of their difference from their transpose is the moment.
    """
    motion, gravity = affine_motion(throw, time), np.array(throw.parameters.gravity)
    f, N = throw.loads(time)
    stress = np.array([throw.gradient(F) for F in motion.F])
    x = motion.center[:, None] + np.einsum("tab,nb->tna", motion.F, throw.rest)
    v = motion.velocity[:, None] + np.einsum("tab,nb->tna", motion.dF, throw.rest)
    # any forces on the nodes with these resultants: what is left of them, the affine body does not feel
    arm = throw.rest @ np.linalg.inv(throw.second_moment)
    pull = f[:, None] / throw.mass.sum() + np.einsum("tab,nb->tna", N, arm)
    truth = deforming_truth(throw.mass, throw.rest, x, v, throw.mass[:, None] * pull) | {
        "first_moment": (N - stress) @ motion.F.mT,
        "applied_first_moment": N @ motion.F.mT,
    }
    return KnownFlight(Body(node=node, position=throw.rest, mass=throw.mass), x, gravity, truth)
