"""The angular momentum, integrated: a channel that the moment drives, as m c is one that the force drives.

Y'' = T, of a body by its rotations, and of points about their mass center as they are: Y = integral of sum m
u x u' dt is twice the area that arms u sweep, whatever bends; from a frame to the next an arm goes straight
to v, and sweeps u x v. Source: principal equations 2.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.motion import momentum_between
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


def angular_channel(
    time: Array, rotation: Array, cov: Array, inertia: Array, h: Array, known: Array | None = None
) -> AngularChannel:
    """Integrated angular momentum of measured rotations (time, 3, 3), with cov (time, 3, 3) of left errors.

    inertia (time, 3, 3) and h (time, 3) of the deforming body, body axes; known (time, 3): the part of Y
    that known moments make, which is left out. H is the one that takes a free body
    from frame to frame. An error theta of the rotation makes H wrong by J theta' - H x theta, so Y by J theta
    plus the integral of (-J' - [H]x) theta; across a step of some size, by what that step makes of theta.
    Good for tuning a prior; the flight smoother makes no use of it. Source: principal equations 2.4, 4f.
    """
    seen = np.isfinite(rotation).all((1, 2))
    t, R, C, J_body = time[seen], rotation[seen], cov[seen], inertia[seen]
    step = np.diff(t)[:, None, None]
    H, by_R, by_H = momentum_between(t, R, J_body, h[seen])
    Y = np.concatenate([np.zeros((1, 3)), np.cumsum(H * step[..., 0], axis=0)])
    Y -= 0.0 if known is None else known[seen]
    # theta_2 = by_R theta_1 + by_H dH: a frame moves Y by the step that ends in it, against the one it begins
    ends = step * np.linalg.inv(by_H)
    adds_up = ends[:-1] - ends[1:] @ by_R[1:]
    drift = (
        (adds_up @ C[1:-1] @ adds_up.swapaxes(1, 2) / step[1:]).mean(0) if len(step) > 1 else np.zeros((3, 3))
    )
    moved = np.concatenate([ends[:1], ends])
    return AngularChannel(t, Y, moved @ C @ moved.swapaxes(1, 2), drift)


def swept_momentum(position: Array, mass: Array, known: Array | None = None) -> tuple[Array, Array]:
    """Y (time, 3) kg m2, NaN where a mass is not seen, and the arms u (time, node, 3) m.

    position (time, node, 3) m, world axes; mass (node,) kg; known (time, 3): the part of Y that known moments
    make, which is left out.

    >>> t = np.linspace(0, 1, 101)[:, None, None]
    >>> turning = np.concatenate([np.cos(t), np.sin(t), 0 * t], 2) * [[1], [-1]]
    >>> swept_momentum(turning, np.ones(2))[0][-1].round(4).tolist()
    [0.0, 0.0, 2.0]
    """
    seen = np.asarray(np.isfinite(position[:, mass > 0]).all((1, 2)))
    center = np.einsum("n,tna->ta", mass / mass.sum(), np.where(mass[:, None] > 0, position, 0.0))
    arm = np.where(mass[:, None] > 0, position - center[:, None], 0.0)
    u = arm[seen]
    swept = np.einsum("n,tna->ta", mass, np.cross(u[:-1], u[1:]))
    Y = np.full((len(position), 3), np.nan)
    Y[seen] = np.concatenate([np.zeros((1, 3)), np.cumsum(swept, axis=0)])[: len(u)]
    return Y if known is None else Y - known, arm
