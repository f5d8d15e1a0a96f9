"""Flights under a law of the air: many at once, each from its own start with its own coefficients."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.aero.air import wind_at
from forceid.aero.axes import cross, dot
from forceid.aero.law import Law
from forceid.motion import exp
from forceid.records import Array

TINY = 1e-150  # rad: nothing, that may be divided by


@dataclass(frozen=True)
class Course:
    """What flies, and what was seen of it.

    time (time,) s; center (time, 3) m and rotation (time, 3, 3), NaN where not seen; root (time, 6, 6):
    inverse root of the covariance of both, world axes; mass kg; inertia (time, 3, 3) kg m2 and h (time, 3)
    kg m2/s, body axes; gravity (3,) m/s2; wind (time, 3) m/s where that was measured; turns: whether the
    rotation is known; start (12,): center, velocity, no turn, angular velocity, and rotation (3, 3) at the
    first sample; wrench (time, 6), its deviation, and the motion that the estimate gives, to begin with.
    """

    name: str
    time: Array
    center: Array
    rotation: Array
    root: Array
    mass: float
    inertia: Array
    h: Array
    gravity: Array
    wind: Array | None
    turns: bool
    start: Array
    start_rotation: Array
    wrench: Array
    wrench_std: Array
    path: tuple[Array, Array, Array, Array]
    substeps: int = 1

    def in_still_air(self) -> Course:
        """The same without the wind that was measured."""
        return replace(self, wind=None)


@dataclass(frozen=True)
class Path:
    """Where flights go: center (time, flight, 3) m and rotation (time, flight, 3, 3)."""

    center: Array
    rotation: Array


def fly(course: Course, law: Law, start: Array, value: Array) -> Path:
    """Paths from starts (flight, 12): center, velocity, turn off the course's rotation (rad) and angular
    velocity, world axes, under coefficients (flight, term).

    Runge-Kutta of order 4 on center, velocity and angular momentum, by Munthe-Kaas on the rotation; inertia,
    inner momentum and measured wind go straight from sample to sample. What leaves all bounds is NaN.
    """
    c, v = start[:, :3].copy(), start[:, 3:6].copy()
    R = exp(start[:, 6:9]) @ course.start_rotation
    J0, h0 = course.inertia[0], course.h[0]
    body = (np.swapaxes(R, 1, 2) @ start[:, 9:12, None])[..., 0]
    H = (R @ (J0 @ body[..., None] + h0[:, None]))[..., 0]
    n = len(course.time)
    centers, rotations = np.empty((n, *c.shape)), np.empty((n, *R.shape))
    centers[0], rotations[0] = c, R
    inverse = np.linalg.inv(course.inertia)
    steady = bool(np.ptp(inverse, axis=0).max() == 0 and not np.ptp(course.h, axis=0).any())

    def rates(t: float, at: int, share: float, c: Array, v: Array, R: Array, H: Array) -> tuple[Array, ...]:
        if steady:
            J_inv, h = inverse[0], course.h[0]
        else:
            J_inv = (1 - share) * inverse[at] + share * inverse[at + 1]
            h = (1 - share) * course.h[at] + share * course.h[at + 1]
        wind = course.wind
        here = None if wind is None else (1 - share) * wind[at] + share * wind[at + 1] + 0 * c
        air = v - wind_at(law.aero, c, course.gravity, here)
        if course.turns:
            Rt = np.swapaxes(R, 1, 2)
            omega = (R @ (J_inv @ (Rt @ H[..., None] - h[:, None])))[..., 0]
        else:
            omega = np.zeros_like(H)
        force, moment = law.wrench(value, t, air, R, omega)
        return v, force / course.mass + course.gravity, omega, moment

    def turned(step: Array, omega: Array) -> Array:
        a = cross(step, omega)
        return np.asarray(omega - 0.5 * a + cross(step, a) / 12)

    with np.errstate(all="ignore"):
        for at in range(n - 1):
            dt = (course.time[at + 1] - course.time[at]) / course.substeps
            for k in range(course.substeps):
                t, share, half = course.time[at] + k * dt, k / course.substeps, (k + 0.5) / course.substeps
                c1, v1, w1, m1 = rates(t, at, share, c, v, R, H)
                s = 0.5 * dt
                c2, v2, w2, m2 = rates(t + s, at, half, c + s * c1, v + s * v1, turn(s * w1, R), H + s * m1)
                w2 = turned(s * w1, w2)
                c3, v3, w3, m3 = rates(t + s, at, half, c + s * c2, v + s * v2, turn(s * w2, R), H + s * m2)
                w3 = turned(s * w2, w3)
                end = (k + 1) / course.substeps
                at4 = c + dt * c3, v + dt * v3, turn(dt * w3, R), H + dt * m3
                c4, v4, w4, m4 = rates(t + dt, at, end, *at4)
                w4 = turned(dt * w3, w4)
                c = c + dt / 6 * (c1 + 2 * c2 + 2 * c3 + c4)
                v = v + dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
                H = H + dt / 6 * (m1 + 2 * m2 + 2 * m3 + m4)
                if course.turns:
                    R = turn(dt / 6 * (w1 + 2 * w2 + 2 * w3 + w4), R)
            if not np.isfinite(v).all():
                v = np.where(np.isfinite(v), v, np.nan)
            centers[at + 1], rotations[at + 1] = c, R
    return Path(centers, rotations)


def turn(phi: Array, R: Array) -> Array:
    """exp([phi]x) R of rotation vectors (..., 3), by Rodrigues, with as few calls as can be."""
    square = dot(phi, phi)
    angle = np.sqrt(square) + TINY
    K = np.zeros((*phi.shape, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = phi[..., 0], phi[..., 1], phi[..., 2]
    K -= np.swapaxes(K, -1, -2)
    KR = K @ R
    by = np.sin(angle) / angle
    half = np.sin(0.5 * angle) / angle
    return np.asarray(R + by[..., None, None] * KR + (2 * half**2)[..., None, None] * (K @ KR))
