"""What gyros and accelerometers read of the modes of the body that they are fixed to.

In body axes a sensor at X + Phi q, tilted by Psi q against the body, reads beside what a rigid body shows it

    omega  + Psi q'
    a      + omega' x Phi q + omega x (omega x Phi q) + 2 omega x Phi q' + Phi q''

in its own axes, R exp([Psi q]x), with q'' = -w^2 q - 2 b q' + f of the mode's chain. An amplitude also
changes the inertia, and with it omega and omega' at a given H and T. Source: principal equations 4d, 4f.
"""

from __future__ import annotations

import numpy as np

from forceid.flight.attitude import apply
from forceid.flight.instruments.imu import Moved, Sensors
from forceid.flight.modes import FlyingModes
from forceid.flight.vibration import STATES
from forceid.motion.pose import exp
from forceid.principal import cross_matrix as skew
from forceid.records import Array


def bending(sensors: Sensors, moved: Moved, modes: FlyingModes) -> tuple[Array, Array]:
    """What the modes add to the channels used (time, channel), and its slopes (time, channel, state).

    Slopes are by the states of the chains of the modes, along whose path both are taken.
    """
    assert modes.mounting is not None
    w2, b = modes.prior.frequency**2, modes.prior.damping
    q, rate = modes.amplitude, modes.rate
    second = modes.path[:, 2::STATES] - w2 * q - 2 * b * rate
    Rt, J_inv = moved.rotation.swapaxes(1, 2), np.asarray(np.linalg.inv(moved.inertia))
    H, T, F = (apply(Rt, v) for v in (moved.H, moved.T, moved.F))
    omega = apply(J_inv, H - moved.h)
    alpha = apply(J_inv, T - np.cross(omega, H) - apply(moved.inertia_rate, omega) - moved.h_rate)
    dJ, dh, dh_rate = modes.products.slopes(q, rate)
    dJ_rate = 2 * np.einsum("tl,klij->tkij", rate, modes.products.inertia[1:, 1:])
    # by q and by q' of every mode, as columns
    d_omega = [-J_inv @ (np.einsum("tkij,tj->tik", dJ, omega) + dh.swapaxes(1, 2)), -J_inv @ dh_rate.mT]
    swung = J_inv @ (skew(H) - moved.inertia_rate)
    d_alpha = [
        swung @ d_omega[0]
        - J_inv @ (np.einsum("tkij,tj->tik", dJ, alpha) + np.einsum("tkij,tj->tik", dJ_rate, omega)),
        swung @ d_omega[1] - J_inv @ np.einsum("tkij,tj->tik", dJ, omega),
    ]
    turning = skew(omega)
    count = len(sensors.rotation)
    y, rows = np.zeros((len(q), 2 * count, 3)), np.zeros((len(q), 2 * count, 3, modes.path.shape[1]))
    for s in range(count):
        S, r = sensors.rotation[s], sensors.position[s]
        Phi, Psi = modes.mounting[0][s].T, modes.mounting[1][s].T
        tilt = q @ Psi.T
        tilted = exp(tilt) @ S  # sensor to body
        back = tilted.swapaxes(1, 2)
        u, u_rate, p_rate = q @ Phi.T, rate @ Phi.T, rate @ Psi.T
        spun = omega + p_rate + 0.5 * np.cross(tilt, p_rate)  # to second order in the tilt
        y[:, s] = apply(back, spun) - omega @ S
        rows[:, s, :, ::STATES] = back @ (skew(spun - 0.5 * p_rate) @ Psi + d_omega[0])
        rows[:, s, :, 1::STATES] = back @ (Psi + 0.5 * skew(tilt) @ Psi + d_omega[1])
        still = F / moved.mass + np.cross(alpha, r) + np.cross(omega, np.cross(omega, r))
        a = still + np.cross(alpha, u) + np.cross(omega, np.cross(omega, u) + 2 * u_rate) + second @ Phi.T
        at = r + u
        by_omega = -skew(np.cross(omega, at) + 2 * u_rate) - turning @ skew(at)
        carried = skew(alpha) + turning @ turning
        y[:, count + s] = apply(back, a) - still @ S
        rows[:, count + s, :, ::STATES] = back @ (
            skew(a) @ Psi + carried @ Phi - Phi * w2 - skew(at) @ d_alpha[0] + by_omega @ d_omega[0]
        )
        rows[:, count + s, :, 1::STATES] = back @ (
            2 * turning @ Phi - 2 * Phi * b - skew(at) @ d_alpha[1] + by_omega @ d_omega[1]
        )
        rows[:, count + s, :, 2::STATES] = back @ Phi
    used = sensors.used
    flat = rows.reshape(len(q), 6 * count, -1)
    return y.reshape(len(q), -1)[:, used], flat[:, used]
