"""Flight of a body that deforms affinely, x = c + F X: own equations of motion, to 1e-12.

F'' E = -dW/dF + N and m c'' = f + m g, with the second moment E = sum m X X^T of its masses and the first
moments N = sum f X^T of the forces on it. Source: pseudo-rigid bodies, section 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.records import Array, Body
from forceid.scenes.drawn_loads import draw_periodic, waves
from forceid.scenes.mechanics import KnownFlight, deforming_truth, solve_ode

AFFINE_TOLERANCE = 1e-12


@dataclass(frozen=True)
class AffineThrow:
    """An affine body as it is thrown.

    mass (node,) kg; rest (node, 3) m about the mass center; gradient: dW/dF (3, 3) J of F (3, 3); force and
    first_moment: standard deviations N and N m of every component of the drawn loads, Matern of order 2,
    flat below frequency Hz, from `seed`; at t = 0: center m, velocity m/s, R (3, 3), spin rad/s in world
    axes, and the rate of the stretch (3, 3) 1/s, body axes.
    """

    mass: Array
    rest: Array
    gradient: Callable[[Array], Array]
    gravity: Array
    center: Array
    velocity: Array
    R: Array
    spin: Array
    stretch_rate: Array
    force: float = 0.0
    first_moment: float = 0.0
    frequency: float = 3.0
    seed: int = 0

    @property
    def second_moment(self) -> Array:
        """E (3, 3) kg m2, reference axes."""
        return np.asarray((self.mass * self.rest.T) @ self.rest)

    def loads(self, time: Array) -> tuple[Array, Array]:
        """Applied force f (time, 3) N and N (time, 3, 3) N m, rows in world, columns in reference axes."""
        std = [self.force] * 3 + [self.first_moment] * 9
        drawn = waves(time, *draw_periodic(std, 2 * np.pi * self.frequency, np.random.default_rng(self.seed)))
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
    E_inverse, mass = np.linalg.inv(throw.second_moment), throw.mass.sum()

    def rate(t: float, y: Array) -> Array:
        f, N = (load[0] for load in throw.loads(np.array([t])))
        ddF = (N - throw.gradient(y[6:15].reshape(3, 3))) @ E_inverse
        return np.concatenate([y[3:6], f / mass + throw.gravity, y[15:], ddF.ravel()])

    dF = np.cross(throw.spin, throw.R, axisb=0, axisc=0) + throw.R @ throw.stretch_rate
    start = np.concatenate([throw.center, throw.velocity, throw.R.ravel(), dF.ravel()])
    y = solve_ode(rate, start, time, AFFINE_TOLERANCE)
    return AffineMotion(y[:, :3], y[:, 3:6], y[:, 6:15].reshape(-1, 3, 3), y[:, 15:].reshape(-1, 3, 3))


def fly_affine(throw: AffineThrow, node: tuple[str, ...], time: Array) -> KnownFlight:
    """The flight at `time` (time,) s, with what acted on the body as truth.

    Beside force and moment, first_moment F'' E F^T, of all forces that act on the body, and
    applied_first_moment N F^T, without the stress in it; both (time, 3, 3) N m, about the mass center, world
    axes, row: of the force, column: of its arm. Half of their difference from their transpose is the moment.
    """
    motion = affine_motion(throw, time)
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
    return KnownFlight(Body(node=node, position=throw.rest, mass=throw.mass), x, throw.gravity, truth)


def rotation_of(turn: tuple[float, float, float]) -> Array:
    """Rotation matrix (3, 3) of a rotation vector."""
    return np.asarray(Rotation.from_rotvec(turn).as_matrix())
