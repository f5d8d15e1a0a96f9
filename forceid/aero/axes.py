"""Axes of a body in the air: body, stability and wind axes, x forward, y to the right, z down; its angles.

Source: ISO 1151-1 for the angles and axes; Magnus force along spin x velocity.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from forceid.config import AeroSetting
from forceid.records import Array
from forceid.rounding import ROUNDED

PAIRS = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


def dot(a: Array, b: Array) -> Array:
    """Products a . b of (..., 3)."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def cross(a: Array, b: Array) -> Array:
    """Products a x b of (..., 3), with as few calls as can be: flights spend their time in it."""
    out = np.empty(a.shape)
    for i, j, k in PAIRS:
        out[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return out


@dataclass(frozen=True)
class Flow:
    """How air meets a body: axes x, y, z (..., 3) of the body, in world axes; where it flies, x_wind, and
    z of wind axes; speed m/s; alpha and beta rad; spin rad/s: about `up`, of a ball its size; omega (..., 3).
    """

    x: Array
    y: Array
    z: Array
    x_wind: Array
    z_wind: Array
    speed: Array
    alpha: Array
    beta: Array
    spin: Array
    omega: Array

    @property
    def axes(self) -> Array:
        """Rows x, y, z (..., 3, 3) of the body's axes, in world axes."""
        return np.stack([self.x, self.y, self.z], -2)

    @property
    def stability(self) -> Array:
        """Rows (..., 3, 3) of the stability axes, in world axes: turned about y until the air has no z."""
        return np.stack([cross(self.y, self.z_wind), self.y, self.z_wind], -2)

    @property
    def wind(self) -> Array:
        """Rows (..., 3, 3) of the wind axes, in world axes."""
        return np.stack([self.x_wind, cross(self.z_wind, self.x_wind), self.z_wind], -2)


@cache
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
    speed = np.sqrt(dot(air, air))
    x_wind = air / speed[..., None]
    if setting.axes == "ball":
        x, lift = x_wind, cross(omega, x_wind)
        z = lift / -np.maximum(np.sqrt(dot(lift, lift)), ROUNDED)[..., None]
        still = np.zeros_like(speed)
        return Flow(x, cross(z, x), z, x, z, speed, still, still, np.sqrt(dot(omega, omega)), omega)
    if setting.axes == "disc":
        z = R @ body_rows(setting)[2]
        w = dot(air, z)
        along = air - w[..., None] * z
        u = np.sqrt(dot(along, along))
        x = along / np.maximum(u, ROUNDED)[..., None]
        y, v = cross(z, x), np.zeros_like(u)
    else:
        axes = body_rows(setting) @ np.swapaxes(R, -1, -2)
        x, y, z = axes[..., 0, :], axes[..., 1, :], axes[..., 2, :]
        u, v, w = dot(air, x), dot(air, y), dot(air, z)
    in_plane = np.sqrt(u * u + w * w)
    z_wind = (u / in_plane)[..., None] * z - (w / in_plane)[..., None] * x
    alpha, beta = np.arctan2(w, u), np.arctan2(v, in_plane)
    return Flow(x, y, z, x_wind, z_wind, speed, alpha, beta, -dot(omega, z), omega)
