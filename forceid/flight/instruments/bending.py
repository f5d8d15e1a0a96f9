"""What sensors read of the modes of the body that they are fixed to.

A sensor at X + Phi q, tilted by Psi q against the body, has the axes exp([Psi q]x) S, with
q'' = -w^2 q - 2 b q' + f of the mode's chain. An amplitude also changes the inertia, and with it omega and
omega' at a given H and T. Source: principal equations 4d, 4f.
"""

from __future__ import annotations

import numpy as np

from forceid.flight.instruments.moved import Moved, in_body
from forceid.flight.instruments.protocol import BentMount
from forceid.flight.instruments.sensors import Sensors
from forceid.flight.modes import FlyingModes
from forceid.motion import exp
from forceid.records import Array


def bending(sensors: Sensors, moved: Moved, modes: FlyingModes, steady: Array) -> tuple[Array, Array]:
    """What the modes add to the channels used (time, channel), and its slopes (time, channel, state).

    Slopes are by the states of the chains of the modes, along whose path both are taken.
    """
    assert modes.mounting is not None
    q, rate, second = modes.amplitude, modes.rate, modes.acceleration
    w2, b = np.zeros((2, q.shape[1]))  # of followers, which swing as their leaders do
    w2[: len(modes.prior.std)], b[: len(modes.prior.std)] = modes.prior.frequency**2, modes.prior.damping
    here = in_body(moved)
    J_inv, omega = here.J_inv, here.omega
    dJ, dh, dh_rate = modes.products.slopes(q, rate)
    dJ_rate = 2 * np.einsum("tl,klij->tkij", rate, modes.products.inertia[1:, 1:])
    # by q and by q' of every mode, as columns
    d_omega = (-J_inv @ (np.einsum("tkij,tj->tik", dJ, omega) + dh.swapaxes(1, 2)), -J_inv @ dh_rate.mT)
    swung = J_inv @ here.turned
    d_alpha = (
        swung @ d_omega[0]
        - J_inv @ (np.einsum("tkij,tj->tik", dJ, here.alpha) + np.einsum("tkij,tj->tik", dJ_rate, omega)),
        swung @ d_omega[1] - J_inv @ np.einsum("tkij,tj->tik", dJ, omega),
    )
    kinds, count = len(sensors.instruments), len(sensors.rotation)
    y, rows = np.zeros((len(q), kinds, count, 3)), np.zeros((len(q), kinds, count, 3, modes.path.shape[1]))
    for s in range(count):
        S, r = sensors.rotation[s], sensors.position[s]
        Phi, Psi = modes.mounting[0][s].T, modes.mounting[1][s].T
        back = (exp(q @ Psi.T) @ S).swapaxes(1, 2)
        for i, instrument in enumerate(sensors.instruments):
            own = steady[: len(sensors.owner)][sensors.owner == i]
            mount = BentMount(S, r, Phi, Psi, q, rate, second, back, w2, b, d_omega, d_alpha, own)
            y[:, i, s], *slopes = instrument.bend(here, mount)
            rows[:, i, s] = modes.by_states(slice(None), *np.broadcast_arrays(*slopes))
    used = sensors.used
    return y.reshape(len(q), -1)[:, used], rows.reshape(len(q), len(used), -1)[:, used]
