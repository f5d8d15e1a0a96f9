"""How a body turns from sample to sample under its angular momentum, and what moves that turn.

R' = [omega]x R with omega = J^-1 (H - h) by Runge-Kutta-Munthe-Kaas of order 4, error on the left.
Compiled where a compiler was, else in numpy; the two are written apart and compared. Source: principal
equations 4b, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from forceid.compiled import engine as compiled
from forceid.motion import exp, log, rotation_vector_rate
from forceid.principal import cross_matrix as skew
from forceid.records import Array


@dataclass(frozen=True)
class ReferenceTrajectory:
    """Where a flight is linearized, at its samples; a step leads from each but the last.

    step (step,) s; R (time, 3, 3); H, T, dT (time, 3): angular momentum, moment and its rate, world axes;
    J (4, step or 1, 3, 3) and h (4, step or 1, 3): inertia and momentum of the deformation as cubics in the
    time since a sample, highest power first, body axes, a single one where they stand still; substeps of a
    step.
    """

    step: Array
    R: Array
    H: Array
    T: Array
    dT: Array
    J: Array
    h: Array
    substeps: int

    @property
    def parts(self) -> tuple[Any, ...]:
        """As the compiled functions take it."""
        return self.step, self.R, self.H, self.T, self.dT, self.J, self.h, self.substeps


def cubics(time: Array, a: Array) -> Array:
    """Values (time, ...) as cubics (4, step, ...) of a spline, or (4, 1, ...) where they stand still."""
    if (a == a[0]).all():
        return np.concatenate([np.zeros((3, 1, *a.shape[1:])), a[None, :1]])
    return np.asarray(CubicSpline(time, a).c)


def at(cubic: Array, s: Array) -> Array:
    """Cubics (4, step or 1, ...) at the times s (step,)."""
    s = s.reshape(-1, *[1] * (cubic.ndim - 2))
    return np.asarray(((cubic[0] * s + cubic[1]) * s + cubic[2]) * s + cubic[3])


def turn_along(path: ReferenceTrajectory) -> tuple[Array, Array, Array]:
    """Where each step leads, R (step, 3, 3), and its derivatives.

    d theta / d theta from theta' = J^-1 [H]x theta + J^-1 delta H, and that by delta H which grows over the
    step as 1, s and s^2, (3, step, 3, 3).
    """
    return turn_in_numpy(path) if compiled is None else compiled.turn(*path.parts)


def turn_in_numpy(path: ReferenceTrajectory) -> tuple[Array, Array, Array]:
    """`turn_along`, all steps at once."""
    step, n = path.step, path.substeps
    R, H, T, dT = (a[:-1] for a in (path.R, path.H, path.T, path.dT))

    def omega(R: Array, s: Array) -> tuple[Array, Array, Array]:
        H_s = H + T * s[:, None] + 0.5 * dT * s[:, None] ** 2
        J_inv = np.asarray(np.linalg.inv(R @ at(path.J, s) @ R.swapaxes(1, 2)))
        h = (R @ at(path.h, s)[..., None])[..., 0]
        return np.einsum("tij,tj->ti", J_inv, H_s - h), J_inv, H_s

    h, d_theta, d_H = step / n, np.tile(np.eye(3), (len(step), 1, 1)), np.zeros((3, len(step), 3, 3))
    for i in range(n):
        s, hv = i * h, h[:, None]
        k1, _, _ = omega(R, s)
        k2 = rotation_vector_rate(0.5 * hv * k1, omega(exp(0.5 * hv * k1) @ R, s + 0.5 * h)[0])
        w, J_inv, H_s = omega(exp(0.5 * hv * k2) @ R, s + 0.5 * h)
        k3 = rotation_vector_rate(0.5 * hv * k2, w)
        k4 = rotation_vector_rate(hv * k3, omega(exp(hv * k3) @ R, s + h)[0])
        R = exp(hv / 6 * (k1 + 2 * k2 + 2 * k3 + k4)) @ R
        a = J_inv @ skew(H_s) * h[:, None, None]
        half, whole = np.eye(3) + 0.5 * a + a @ a / 8, np.eye(3) + a + a @ a / 2 + a @ a @ a / 6
        grown = np.stack([h, h * (s + 0.5 * h), h * ((s + 0.5 * h) ** 2 + h**2 / 12)])
        d_theta, d_H = whole @ d_theta, whole @ d_H + half @ J_inv * grown[..., None, None]
    return R, d_theta, d_H


def between(R: Array, other: Array) -> Array:
    """Rotation vectors (time, 3) of R other^T, NaN where one of them is."""
    if compiled is not None:
        return np.asarray(compiled.between(R, other))
    whole = np.isfinite(R).all((1, 2)) & np.isfinite(other).all((1, 2))
    phi = np.full((len(R), 3), np.nan)
    phi[whole] = log(R[whole] @ other[whole].swapaxes(1, 2))
    return phi


def turned(phi: Array, R: Array) -> Array:
    """Rotations exp(phi) R (time, 3, 3), phi (time, 3)."""
    return exp(phi) @ R if compiled is None else np.asarray(compiled.turned(phi, R))
