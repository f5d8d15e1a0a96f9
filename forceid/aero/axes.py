"""Axes of a body in the air: body, stability and wind axes, x forward, y to the right, z down; its angles.

Source: ISO 1151-1 for the angles and axes; Magnus force along spin x velocity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.config import AeroSetting
from forceid.principal import cross
from forceid.records import Array
from forceid.rounding import ROUNDED


@dataclass(frozen=True)
class Flow:
    """How air meets a body: axes (..., 3, 3) with rows x, y, z of the body's, in world axes; speed m/s, alpha
    and beta rad; rates (..., 3) rad/s about these axes, spin (...) rad/s: about `up`, of a ball its size.
    """

    axes: Array
    speed: Array
    alpha: Array
    beta: Array
    rates: Array
    spin: Array


def body_rows(setting: AeroSetting) -> Array:
    """Rows x, y, z (3, 3) of the body's axes in the air, in the axes of its file."""
    up = np.array(setting.up) / np.linalg.norm(setting.up)
    x = np.array(setting.forward) - np.dot(setting.forward, up) * up
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(x, up), -up])


def flow(setting: AeroSetting, air: Array, R: Array, omega: Array) -> Flow:
    """How the air meets a body that moves at `air` (..., 3) m/s against it, turned by R (..., 3, 3), body to
    world, and turning at omega (..., 3) rad/s, world axes.

    >>> seen = flow(AeroSetting(area=1.0), np.array([10.0, 0.0, -1.0]), np.eye(3), np.zeros(3))
    >>> float(seen.alpha.round(4)), float(seen.beta)
    (0.0997, 0.0)
    """
    speed = np.sqrt((air * air).sum(-1))
    if setting.axes == "ball":
        x = air / np.maximum(speed, ROUNDED)[..., None]
        lift = cross(omega, x)
        up = lift / np.maximum(np.sqrt((lift * lift).sum(-1)), ROUNDED)[..., None]
        axes = np.stack([x, cross(x, up), -up], -2)
        spin = np.sqrt((omega * omega).sum(-1))
    elif setting.axes == "disc":
        up = -(R @ body_rows(setting)[2])
        along = air - (air * up).sum(-1)[..., None] * up
        x = along / np.maximum(np.sqrt((along * along).sum(-1)), ROUNDED)[..., None]
        axes = np.stack([x, cross(x, up), -up], -2)
        spin = (omega * up).sum(-1)
    else:
        axes = body_rows(setting) @ np.swapaxes(R, -1, -2)
        spin = -(omega * axes[..., 2, :]).sum(-1)
    u, v, w = np.moveaxis((axes @ air[..., None])[..., 0], -1, 0)
    alpha = np.arctan2(w, u)
    beta = np.arctan2(v, np.sqrt(u * u + w * w))
    return Flow(axes, speed, alpha, beta, (axes @ omega[..., None])[..., 0], spin)


def stability_rows(seen: Flow) -> Array:
    """Rows (..., 3, 3) of the stability axes in the body's: turned about y until the air has no z."""
    c, s = np.cos(seen.alpha), np.sin(seen.alpha)
    o, i = np.zeros_like(c), np.ones_like(c)
    return np.stack([np.stack(row, -1) for row in ((c, o, s), (o, i, o), (-s, o, c))], -2)


def wind_rows(seen: Flow) -> Array:
    """Rows (..., 3, 3) of the wind axes in the body's: x is where the body flies in the air."""
    c, s = np.cos(seen.beta), np.sin(seen.beta)
    o, i = np.zeros_like(c), np.ones_like(c)
    turn = np.stack([np.stack(row, -1) for row in ((c, s, o), (-s, c, o), (o, o, i))], -2)
    return turn @ stability_rows(seen)
