"""The rotation as a channel whose second derivative is the moment, as m c is one for the force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.motion.pose import exp, log
from forceid.principal.operator import cross_matrix
from forceid.records import Array


@dataclass(frozen=True)
class AngularChannel:
    """Y (sample, 3), the integral of the angular momentum about the mass center: Y'' = T, world axes.

    time (sample,) of the frames with a rotation; noise_cov (sample, 3, 3) of Y from the rotation errors;
    drift (3, 3), the covariance per second of the part of that noise which adds up along the record.
    """

    time: Array
    Y: Array
    noise_cov: Array
    drift: Array


def angular_channel(time: Array, rotation: Array, cov: Array, inertia: Array, h: Array) -> AngularChannel:
    """Integrated angular momentum of measured rotations (time, 3, 3), with cov (time, 3, 3) of left errors.

    inertia (time, 3, 3) and h (time, 3) of the deforming body, body axes. An error theta of the rotation
    makes H wrong by J theta' - H x theta, so Y by J theta plus the integral of (-J' - [H]x) theta.
    Good for tuning a prior; the flight smoother makes no use of it. Source: principal equations 2.4, 4f.
    """
    seen = np.isfinite(rotation).all((1, 2))
    t, R, C, J_body = time[seen], rotation[seen], cov[seen], inertia[seen]
    step = np.diff(t)[:, None]
    turn = log(R[1:] @ R[:-1].swapaxes(1, 2))
    middle = exp(0.5 * turn) @ R[:-1]
    J = middle @ (0.5 * (J_body[1:] + J_body[:-1])) @ middle.swapaxes(1, 2)
    h_world = np.einsum("tab,tb->ta", middle, 0.5 * (h[seen][1:] + h[seen][:-1]))
    gain = np.einsum("tab,tb->ta", J, turn) + h_world * step
    omega, H = cross_matrix(turn / step), cross_matrix(gain / step)
    adds_up = omega @ J - J @ omega + H
    drift = (step[..., None] * (adds_up @ C[1:] @ adds_up.swapaxes(1, 2))).mean(0)
    J_world = R @ J_body @ R.swapaxes(1, 2)
    Y = np.concatenate([np.zeros((1, 3)), np.cumsum(gain, axis=0)])
    return AngularChannel(t, Y, J_world @ C @ J_world.swapaxes(1, 2), drift)
