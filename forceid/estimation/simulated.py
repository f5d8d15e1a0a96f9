"""The motion that a found load produces, beside the one that was measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PPoly, make_interp_spline
from scipy.spatial.transform import Rotation

from forceid.errors import DataError, EstimationError
from forceid.motion import exp, log, rotation_vector_rate
from forceid.records import Array, Body, Estimate, Flags, Motion, Recording
from forceid.rounding import ITERATIONS, solvable
from forceid.significance import TENTH

A_TURN_A_FRAME = 2 * np.pi  # rad: more than cameras follow, and it bounds the steps
TURN_A_STEP = 0.25  # rad of a step: by order 4 a turn of so much is right to a millionth
PROBED = 1e-5  # rad, and share of the angular momentum, of differences: half the digits of what they move
LEAST_POSES = 4  # with a pose: a start has as many numbers as two of them


@dataclass(frozen=True)
class Simulated:
    """A flight under the load of an estimate, world axes, from the start that suits what was measured best.

    time (time,) s; center (time, 3) m; orientation (time, 4) [x y z w], NaN where no rotation is known; off
    (time, 6): measured less simulated, m, then rad as a left error, NaN where nothing was measured; std
    (time, 6): of the measurement.
    """

    time: Array
    center: Array
    orientation: Array
    off: Array
    std: Array

    @property
    def rms(self) -> tuple[float, ...]:
        """Rms of the distance (m) and of the turn (rad) between both."""
        center, turn = (np.square(self.off[:, p]).sum(1) for p in (slice(0, 3), slice(3, 6)))
        return tuple(
            float(np.sqrt(np.nanmean(a))) if np.isfinite(a).any() else np.nan for a in (center, turn)
        )

    @property
    def misfit(self) -> float:
        """Rms of what both are off by, over the deviation of the measurement."""
        return float(np.sqrt(np.nanmean(np.square(self.off / self.std))))


@solvable()
def fly_again(estimate: Estimate, name: str = "the result") -> Simulated:
    """The flight under force and moment of an estimate, and those known beside them.

    Loads go from sample to sample by cubics, straight where they come in pieces; the center is their double
    integral, the angular momentum their integral, and the rotation follows with the inertia, and the inner
    momentum of the deformation, that the estimate has. DataError: no poses, or a moment about another point
    than the mass center. Source: principal equations 2.4, 4b.
    """
    flown = estimate.flown
    if flown is None or np.isfinite(flown.center).all(1).sum() < LEAST_POSES:
        raise DataError("holds no poses to compare with", f"{name}:/flown", "estimate from markers or poses")
    if estimate.moment_about != "mass_center":
        what = f"has its moment about {estimate.moment_about}, expected the mass center"
        raise DataError(what, name, 'estimate with moment_about = "mass_center"')
    known = np.isfinite(estimate.force).all(1) & np.isfinite(estimate.velocity).all(1)
    if not known.all():
        raise DataError("holds no force at some samples", name, "estimate with the smoother")
    t = estimate.time - estimate.time[0]
    force = estimate.force + (0.0 if estimate.known_force is None else estimate.known_force)
    moment = estimate.moment + (0.0 if estimate.known_moment is None else estimate.known_moment)
    if flown.current_mass is not None:  # all loads by the share of the mass, as of one that does not change
        force, moment = (load * (estimate.mass / flown.current_mass)[:, None] for load in (force, moment))
    std = np.sqrt(np.diagonal(flown.pose_cov, axis1=1, axis2=2))
    with np.errstate(over="ignore"):  # of a damaged result: `course` says so
        acceleration = force / estimate.mass + estimate.gravity
    pushed = course(t, acceleration, estimate).antiderivative(2)(t)
    seen: Flags = np.asarray(np.isfinite(flown.center).all(1))
    center = np.asarray(pushed + start_line(t, flown.center - pushed, std[:, 0], seen))
    off = np.full((len(t), 6), np.nan)
    off[:, :3] = flown.center - center
    q = np.full((len(t), 4), np.nan)
    if np.isfinite(flown.orientation).any() and np.isfinite(moment).all():
        H = course(t, moment, estimate).antiderivative(1)
        R, off[:, 3:] = turned_best(t, H, estimate, std[:, 3:])
        q = Rotation.from_matrix(R).as_quat(canonical=True)
    return Simulated(estimate.time, center, q, off, np.where(np.isfinite(off), std, np.nan))


def course(t: Array, values: Array, estimate: Estimate) -> PPoly:
    """Values (time, 3) between samples: cubic, or straight where loads come in pieces."""
    with np.errstate(over="ignore"):  # a spline multiplies and adds up slopes: their squares leave room
        finite(np.square(np.diff(finite(values), axis=0) / np.diff(t)[:, None]))
    if estimate.impulses is None:
        return CubicSpline(t, values)
    spline = make_interp_spline(t, values, 1)
    return PPoly.from_spline((spline.t, spline.c, spline.k))


def start_line(t: Array, left: Array, std: Array, seen: Flags) -> Array:
    """The start and speed (time, 3) that suit what is left best, along every axis."""
    rows = np.stack([np.ones_like(t), t], 1)
    weight = 1 / std[seen, None]
    return np.asarray(rows @ fitted(rows[seen] * weight, left[seen] * weight))


def fitted(A: Array, b: Array) -> Array:
    """Least squares of A x = b; EstimationError where these are no numbers."""
    return np.asarray(np.linalg.lstsq(finite(A), finite(b), rcond=None)[0], float)


def finite(values: Array) -> Array:
    """The values; EstimationError where some are beyond what numbers hold."""
    if not np.isfinite(values).all():
        raise EstimationError("is too far off to be flown again", "the load", "look for values far off")
    return values


def turned_best(t: Array, H: PPoly, estimate: Estimate, std: Array) -> tuple[Array, Array]:
    """Rotations (time, 3, 3) from the start that suits those measured best, and what these are off by.

    By Gauss-Newton on rotation and angular momentum at the start, slopes by differences.
    """
    assert estimate.flown is not None
    measured = np.full((len(t), 3, 3), np.nan)
    seen = np.isfinite(estimate.flown.orientation).all(1)
    measured[seen] = Rotation.from_quat(estimate.flown.orientation[seen]).as_matrix()
    first = int(np.argmax(seen))
    R0, H0 = measured[first], estimate.angular_momentum[0] - H(0.0)
    if first:
        R0 = Rotation.from_quat(estimate.orientation[0]).as_matrix()
    size = max(float(np.linalg.norm(estimate.angular_momentum, axis=1).max()), 1e-300)
    probe = np.repeat([PROBED, PROBED * size], 3)
    for _ in range(ITERATIONS):
        steps = np.concatenate([np.zeros((1, 6)), np.diag(probe)])
        R = turned_along(t, H, exp(steps[:, :3]) @ R0, H0 + steps[:, 3:], estimate)
        off = np.full((len(t), len(steps), 3), np.nan)
        off[seen] = log(measured[seen, None] @ np.swapaxes(R[seen], 2, 3))
        r, J = off[seen, 0] / std[seen], (off[seen, 1:] - off[seen, :1]) / probe[:, None] / std[seen, None]
        J = np.swapaxes(J, 1, 2).reshape(-1, 6)
        scale = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
        move = -fitted(J / scale, r.ravel()) / scale
        if np.abs(move * scale).max() < TENTH:
            break
        R0, H0 = exp(move[:3]) @ R0, H0 + move[3:]
    return R[:, 0], off[:, 0]


def turned_along(t: Array, H: PPoly, R: Array, H0: Array, estimate: Estimate) -> Array:
    """Rotations (time, start, 3, 3) from starts R (start, 3, 3) with H0 (start, 3) beside the integral H.

    Runge-Kutta-Munthe-Kaas of order 4; inertia and inner momentum go straight from sample to sample.
    """
    assert estimate.flown is not None
    J, h = finite(estimate.flown.inertia), finite(estimate.flown.internal_momentum)
    inverse, turned = np.linalg.inv(J), finite(estimate.angular_velocity)
    rate = float(np.hypot.reduce(turned, axis=1).max())
    if rate * (t[-1] - t[0]) > A_TURN_A_FRAME * len(t):
        what = f"turns by {rate:.3g} rad/s, expected at most a turn a frame to fly it again"
        raise EstimationError(what, "the body", "look for values far off")
    out = np.empty((len(t), *R.shape))
    out[0] = R
    for k, step in enumerate(np.diff(t)):
        n = max(1, int(np.ceil(rate * step / TURN_A_STEP)))
        for i in range(n):
            s = step / n
            at = t[k] + s * np.array([i, i + 0.5, i + 1])
            momenta = H(at)[:, None] + H0
            shares = np.array([i, i + 0.5, i + 1]) / n
            inertias = (1 - shares)[:, None, None] * inverse[k] + shares[:, None, None] * inverse[k + 1]
            inner = (1 - shares)[:, None] * h[k] + shares[:, None] * h[k + 1]

            def omega(
                R: Array, j: int, momenta: Array = momenta, J: Array = inertias, h: Array = inner
            ) -> Array:
                body = np.swapaxes(R, 1, 2) @ momenta[j][..., None] - h[j][:, None]
                return np.asarray((R @ (J[j] @ body))[..., 0])

            k1 = omega(R, 0)
            k2 = rotation_vector_rate(0.5 * s * k1, omega(exp(0.5 * s * k1) @ R, 1))
            k3 = rotation_vector_rate(0.5 * s * k2, omega(exp(0.5 * s * k2) @ R, 1))
            k4 = rotation_vector_rate(s * k3, omega(exp(s * k3) @ R, 2))
            R = exp(s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)) @ R
        out[k + 1] = R
    return out


def recording_of(found: Simulated, estimate: Estimate, title: str) -> Recording:
    """A simulated flight as the recording of a rigid body whose pose is measured, its loads as the truth."""
    assert estimate.flown is not None
    body = Body(
        total_mass=estimate.mass, mass_center=np.zeros(3), inertia=np.asarray(estimate.flown.inertia.mean(0))
    )
    pose = {"center": found.center}
    if np.isfinite(found.orientation).any():
        pose["orientation"] = found.orientation
    motion = Motion(found.time, gravity=np.asarray(estimate.gravity), **pose)  # type: ignore[arg-type]
    truth = {"force": estimate.force, "moment": estimate.moment, "time": found.time}
    return Recording(body, motion, truth=truth, title=title, source="forceid simulate")
