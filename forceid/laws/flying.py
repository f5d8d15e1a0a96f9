"""Motions under a law: many at once, each from its own start with its own coefficients."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forceid.aero import cross, dot, wind_at
from forceid.laws.ground import along
from forceid.laws.law import Law
from forceid.laws.state import State
from forceid.motion import exp
from forceid.records import Array, Flags

SECANTS = 3  # of where a step meets the ground: each takes a digit or two of what is left
TINY = 1e-150  # rad: nothing, that may be divided by


@dataclass(frozen=True)
class Course:
    """What flies, and what was seen of it.

    time (time,) s; center (time, 3) m and rotation (time, 3, 3), NaN where not seen; root (time, 6, 6):
    inverse root of the covariance of both, world axes; mass kg; inertia (time, 3, 3) kg m2 and h (time, 3)
    kg m2/s, body axes; gravity (3,) m/s2; wind (time, 3) m/s where that was measured; turns: whether the
    rotation is known; start (12,): center, velocity, no turn, angular velocity, and rotation (3, 3) at the
    first sample; wrench (time, 6), its deviation, and the motion that the estimate gives, to begin with;
    substeps (time - 1,): from sample to sample; near (time - 1,): where the ground is, or close.
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
    substeps: Array
    near: Flags

    def in_still_air(self) -> Course:
        """The same without the wind that was measured."""
        return replace(self, wind=None)

    def part(self, which: NDArray[np.intp], name: str) -> Course:
        """Some of its samples, by their numbers, as a course of its own."""
        center, velocity, R, omega = (p[which] for p in self.path)
        start = np.concatenate([center[0], velocity[0], np.zeros(3), omega[0]])
        parts = {
            n: getattr(self, n)[which]
            for n in ("center", "rotation", "root", "inertia", "h", "wrench", "wrench_std")
        }
        return replace(
            self, name=name, time=self.time[which] - self.time[which[0]], start=start, start_rotation=R[0],
            wind=None if self.wind is None else self.wind[which], path=(center, velocity, R, omega),
            substeps=self.substeps[which[:-1]], near=self.near[which[:-1]], **parts,
        )  # fmt: skip


@dataclass(frozen=True)
class Path:
    """Where flights go: center (time, flight, 3) m and rotation (time, flight, 3, 3)."""

    center: Array
    rotation: Array


def fly(course: Course, law: Law, start: Array, value: Array) -> Path:
    """Paths from starts (flight, 12): center, velocity, turn off the course's rotation (rad) and angular
    velocity, world axes, under coefficients (flight, term).

    Runge-Kutta of order 4 on center, velocity and angular momentum, by Munthe-Kaas on the rotation; inertia,
    inner momentum and measured wind go straight from sample to sample. A step in which a place meets or
    leaves the ground is taken in two, so that the force jumps between them. What leaves all bounds is NaN.
    """
    R = exp(start[:, 6:9]) @ course.start_rotation
    J0, h0 = course.inertia[0], course.h[0]
    body = (np.swapaxes(R, 1, 2) @ start[:, 9:12, None])[..., 0]
    H = (R @ (J0 @ body[..., None] + h0[:, None]))[..., 0]
    velocity = start[:, 3:6]
    if law.ground is not None and law.ground.kind == "hard":  # what is on it has no other
        velocity = along(velocity, law.ground.normal)
    y = start[:, :3].copy(), velocity.copy(), R, H
    n = len(course.time)
    centers, rotations = np.empty((n, *y[0].shape)), np.empty((n, *R.shape))
    centers[0], rotations[0] = y[0], R
    rates = Rates(course, law, value)
    with np.errstate(all="ignore"):
        for at in range(n - 1):
            steps = int(course.substeps[at])
            dt = (course.time[at + 1] - course.time[at]) / steps
            for k in range(steps):
                span = Span(at, k / steps, 1 / steps, dt)
                y = on_and_off(rates, course.time[at] + k * dt, span, y)
            centers[at + 1], rotations[at + 1] = y[0], y[2]
    return Path(centers, rotations)


Motion = tuple[Array, Array, Array, Array]  # center, velocity, rotation, angular momentum (flight, ...)


@dataclass(frozen=True)
class Span:
    """A step between two samples: after which sample, from which share of the way on, how far, and s."""

    at: int
    share: float
    width: float
    dt: float


class Rates:
    """How fast the flights of a course change under a law, with coefficients (flight, term)."""

    def __init__(self, course: Course, law: Law, value: Array) -> None:
        self.course, self.law, self.value = course, law, value
        self.inverse = np.linalg.inv(course.inertia)
        self.steady = bool(np.ptp(self.inverse, axis=0).max() == 0 and not np.ptp(course.h, axis=0).any())

    def __call__(self, t: float | Array, span: Span, way: float, y: Motion, touching: Flags | None) -> Motion:
        """Velocity, acceleration, angular velocity and moment (flight, 3), a share of the way through a step.

        touching (flight, point): which places are on the ground; None: no law has any.
        """
        course, law, at, share = self.course, self.law, span.at, span.share + way * span.width
        c, v, R, H = y
        if self.steady:
            J_inv, h = self.inverse[0], course.h[0]
        else:
            J_inv = (1 - share) * self.inverse[at] + share * self.inverse[at + 1]
            h = (1 - share) * course.h[at] + share * course.h[at + 1]
        spread = R @ J_inv @ np.swapaxes(R, 1, 2)
        omega = (spread @ (H - (R @ h[:, None])[..., 0])[..., None])[..., 0] if course.turns else 0 * H
        air = v
        if law.aero is not None:
            wind = course.wind
            here = None if wind is None else (1 - share) * wind[at] + share * wind[at + 1] + 0 * c
            air = v - wind_at(law.aero, c, course.gravity, here)
        state = State(c, v, air, R, omega, H, course.mass, spread, course.gravity, span.dt, touching)
        force, moment = law.wrench(self.value, t, state)
        return v, force / course.mass + course.gravity, omega, moment


def stepped(
    rates: Rates, t: float, span: Span, dt: float | Array, y: Motion, touching: Flags | None
) -> Motion:
    """The motion a time dt (s, or (flight, 1)) later, with the same places on the ground."""
    c, v, R, H = y
    s = 0.5 * dt
    early, late = t + np.ravel(s), t + np.ravel(dt)
    c1, v1, w1, m1 = rates(t, span, 0.0, y, touching)
    c2, v2, w2, m2 = rates(early, span, 0.5, (c + s * c1, v + s * v1, turn(s * w1, R), H + s * m1), touching)
    w2 = turned(s * w1, w2)
    c3, v3, w3, m3 = rates(early, span, 0.5, (c + s * c2, v + s * v2, turn(s * w2, R), H + s * m2), touching)
    w3 = turned(s * w2, w3)
    c4, v4, w4, m4 = rates(
        late, span, 1.0, (c + dt * c3, v + dt * v3, turn(dt * w3, R), H + dt * m3), touching
    )
    w4 = turned(dt * w3, w4)
    c = c + dt / 6 * (c1 + 2 * c2 + 2 * c3 + c4)
    v = v + dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
    H = H + dt / 6 * (m1 + 2 * m2 + 2 * m3 + m4)
    return c, v, turn(dt / 6 * (w1 + 2 * w2 + 2 * w3 + w4), R) if rates.course.turns else R, H


def on_and_off(rates: Rates, t: float, span: Span, y: Motion) -> Motion:
    """The motion a step later; in two steps for flights in which a place meets or leaves the ground."""
    if rates.law.ground is None:
        return stepped(rates, t, span, span.dt, y, None)
    clear = rates.law.gaps(rates.value, y[0], y[2])
    always = rates.law.ground.kind != "soft"
    touching: Flags = np.asarray((clear < 0) | always) & rates.course.near[span.at]
    after = stepped(rates, t, span, span.dt, y, touching)
    if always or not rates.course.near[span.at]:
        return after
    left = rates.law.gaps(rates.value, after[0], after[2])
    crosses = (left < 0) != touching
    if not crosses.any():
        return after
    first = np.where(crosses, clear / np.where(crosses, clear - left, 1.0), 2.0).argmin(1)[:, None]
    ends = [np.take_along_axis(g, first, 1) for g in (clear, left)]
    low, high = np.zeros_like(ends[0]), np.ones_like(ends[0])
    some, on = crosses.any(1)[:, None], np.take_along_axis(touching, first, 1)
    way = high
    for _ in range(SECANTS):
        way = np.where(some, low + (high - low) * ends[0] / (ends[0] - ends[1]), 1.0)
        middle = stepped(rates, t, span, span.dt * way, y, touching)
        own = np.take_along_axis(rates.law.gaps(rates.value, middle[0], middle[2]), first, 1)
        early = (own < 0) == on
        low, high = np.where(early, way, low), np.where(early, high, way)
        ends = [np.where(early, own, ends[0]), np.where(early, ends[1], own)]
    flipped = touching.copy()
    np.put_along_axis(flipped, first, on ^ some, 1)
    return stepped(rates, t, span, span.dt * (1 - way), middle, flipped)


def turned(step: Array, omega: Array) -> Array:
    """Rate of a rotation vector (..., 3) that turns at omega from there, to second order."""
    a = cross(step, omega)
    return np.asarray(omega - 0.5 * a + cross(step, a) / 12)


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
