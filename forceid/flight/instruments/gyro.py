"""A gyro: angular velocity in its own axes."""

from __future__ import annotations

import numpy as np

from forceid.flight.instruments.moved import InBody, Slopes
from forceid.flight.instruments.protocol import BentMount, Instrument
from forceid.motion import apply
from forceid.principal import cross_matrix as skew
from forceid.records import Array


def read(here: InBody, S: Array, r: Array, steady: Array) -> tuple[Array, Slopes]:
    """S^T omega, wherever on the body."""
    return here.omega @ S, {v: S.T @ d for v, d in here.d_omega.items()}


def bend(here: InBody, on: BentMount) -> tuple[Array, Array, Array, float]:
    """On a body that bends: omega + Psi q' in tilted axes, to second order in the tilt."""
    tilt, p_rate = on.q @ on.tilt.T, on.rate @ on.tilt.T
    spun = here.omega + p_rate + 0.5 * np.cross(tilt, p_rate)
    by_q = on.back @ (skew(spun - 0.5 * p_rate) @ on.tilt + on.d_omega[0])
    by_rate = on.back @ (on.tilt + 0.5 * skew(tilt) @ on.tilt + on.d_omega[1])
    return apply(on.back, spun) - here.omega @ on.S, by_q, by_rate, 0.0


GYRO = Instrument(
    "angular_velocity", "rad/s", "gyros", "gyro", offset=0.35,  # 20 degrees a second
    read=read, bend=bend, tells="moment",
)  # fmt: skip
