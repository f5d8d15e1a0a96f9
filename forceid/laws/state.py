"""Where a body is and how it moves, as laws of what pushes it go by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.aero import cross
from forceid.records import Array, Flags


@dataclass(frozen=True)
class State:
    """Of a body at once or along paths, world axes: center (..., 3) m, velocity (..., 3) m/s, velocity
    against the air (..., 3), R (..., 3, 3), body to world, angular velocity (..., 3) rad/s and angular
    momentum (..., 3) kg m2/s; mass kg, inverse of the inertia (..., 3, 3) 1/(kg m2), gravity (3,) m/s2.

    step s: of integration; what would end within it does. touching (..., point): places on the ground, or
    None for none.
    """

    center: Array
    velocity: Array
    air: Array
    R: Array
    omega: Array
    momentum: Array
    mass: float
    inverse: Array
    gravity: Array
    step: float
    touching: Flags | None

    def accelerated(self, force: Array, moment: Array) -> tuple[Array, Array]:
        """Acceleration (..., 3) m/s2 of the center and of the turn, rad/s2, under a force and a moment."""
        left = moment - cross(self.omega, self.momentum)
        return force / self.mass + self.gravity, np.asarray((self.inverse @ left[..., None])[..., 0])
