"""An accelerometer: acceleration less gravity at its place, in its own axes.

    a = F / m + omega' x r + omega x (omega x r)

F leaves weight out, so F / m is the specific force of the mass center.
"""

from __future__ import annotations

import numpy as np

from forceid.flight.instruments.moved import MOVERS, InBody, Slopes
from forceid.flight.instruments.protocol import BentMount, Instrument
from forceid.motion import apply
from forceid.principal import cross_matrix as skew
from forceid.records import Array


def read(here: InBody, S: Array, r: Array, steady: Array) -> tuple[Array, Slopes]:
    """S^T a, at r from the mass center."""
    swept = np.cross(here.omega, r)
    y = (here.F / here.mass + np.cross(here.alpha, r) + np.cross(here.omega, swept)) @ S
    by_omega = -skew(swept) - here.lags @ skew(r)
    return y, {
        v: S.T @ (here.d_F[v] / here.mass - skew(r) @ here.d_alpha[v] + by_omega @ here.d_omega[v])
        for v in MOVERS
    }


def bend(here: InBody, on: BentMount) -> tuple[Array, Array, Array, Array]:
    """On a body that bends, at u = Phi q beside its place, in tilted axes, beside what a rigid body shows it:

    a + omega' x u + omega x (omega x u) + 2 omega x u' + u''
    """
    omega, alpha, r, Phi = here.omega, here.alpha, on.r, on.shift
    u, u_rate = on.q @ Phi.T, on.rate @ Phi.T
    still = here.F / here.mass + np.cross(alpha, r) + np.cross(omega, np.cross(omega, r))
    a = still + np.cross(alpha, u) + np.cross(omega, np.cross(omega, u) + 2 * u_rate) + on.second @ Phi.T
    at = r + u
    by_omega = -skew(np.cross(omega, at) + 2 * u_rate) - here.lags @ skew(at)
    carried = skew(alpha) + here.lags @ here.lags
    by_q = skew(a) @ on.tilt + carried @ Phi - Phi * on.w2
    by_q = on.back @ (by_q - skew(at) @ on.d_alpha[0] + by_omega @ on.d_omega[0])
    by_rate = 2 * here.lags @ Phi - 2 * Phi * on.b
    by_rate = on.back @ (by_rate - skew(at) @ on.d_alpha[1] + by_omega @ on.d_omega[1])
    return apply(on.back, a) - still @ on.S, by_q, by_rate, on.back @ Phi


ACCELEROMETER = Instrument(
    "specific_force", "m/s2", "accelerometers", "accelerometer", offset=0.8,  # 80 thousandths of gravity
    read=read, bend=bend, tells="force",
)  # fmt: skip
