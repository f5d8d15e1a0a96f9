"""Gyros and accelerometers on a flying body: what they read, as rows on the states of a flight.

In body axes, with H, F, T turned into them and the reading of a body that may deform,

    omega  = J^-1 (H - h)
    omega' = J^-1 (T - omega x H - J' omega - h')
    a      = F / m + omega' x r + omega x (omega x r)

F leaves weight out, so F / m is the specific force of the mass center. Exact, and linear in F and T; about a
reference linear in H and in the rotation error, which stands on the left: R^T v gains R^T [v]x theta. Each
channel has a bias that stays. The sensor stands still in body axes: its own motion and tilt as the body
deforms are not in the rows. Source: principal equations 4d, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from forceid.kalman.model import StateSpace
from forceid.motion.pose import log
from forceid.principal.operator import cross_matrix as skew
from forceid.records import Array, Flags


@dataclass(frozen=True)
class Sensors:
    """Gyros and accelerometers on the clock of a flight.

    angular_velocity rad/s and specific_force m/s2 (time, sensor, 3), sensor axes, NaN where not sampled;
    position (sensor, 3) m from the mass center and rotation (sensor, 3, 3) sensor to body, body axes;
    noise_std and bias_std (2, sensor), first of the gyros: of white noise, and of the bias before anything
    is read, which may be as good as unknown.
    """

    angular_velocity: Array
    specific_force: Array
    position: Array
    rotation: Array
    noise_std: Array
    bias_std: Array

    @property
    def readings(self) -> Array:
        """All channels side by side, (time, channel): gyros, then accelerometers, sensor by sensor."""
        both = (self.angular_velocity, self.specific_force)
        return np.concatenate([a.reshape(len(a), -1) for a in both], 1)

    @property
    def used(self) -> Flags:
        """Channels (channel,) that read anything at all: the others get no row and no bias."""
        return np.asarray(np.isfinite(self.readings).any(0))

    @property
    def noise_var(self) -> Array:
        """Variance of every channel used."""
        return np.repeat(self.noise_std.ravel() ** 2, 3)[self.used]

    @property
    def bias_var(self) -> Array:
        """Variance before the first sample of the bias of every channel used."""
        return np.repeat(self.bias_std.ravel() ** 2, 3)[self.used]


@dataclass(frozen=True)
class Moved:
    """A flight at the samples of its clock, for its sensors: rotation, momentum and loads in world axes.

    rotation (time, 3, 3); H, T, F (time, 3); mass kg; inertia, inertia_rate (time, 3, 3), h, h_rate (time, 3)
    of the shape, body axes.
    """

    rotation: Array
    H: Array
    T: Array
    F: Array
    mass: float
    inertia: Array
    inertia_rate: Array
    h: Array
    h_rate: Array


def sensed(sensors: Sensors, moved: Moved) -> tuple[Array, Array, Array, Array, Array]:
    """What the channels used read without bias (time, channel), and its derivatives.

    These are (time, channel, 3) by the rotation error theta and by H, T and F, world axes.

    >>> one = np.ones((1, 1, 1))
    >>> sensors = Sensors(0 * one + np.zeros(3), 0 * one + np.zeros(3), np.array([[0.1, 0.0, 0.0]]),
    ...                   np.eye(3)[None], np.ones((2, 1)), np.ones((2, 1)))
    >>> J, at_rest = 1e-3 * np.eye(3)[None], np.zeros((1, 3))
    >>> spun = Moved(np.eye(3)[None], np.array([[0.0, 0, 0.02]]), at_rest, np.array([[0.0, 0, 0.5]]), 0.5,
    ...              J, 0 * J, at_rest, at_rest)
    >>> sensed(sensors, spun)[0].round(9) + 0.0
    array([[  0.,   0.,  20., -40.,   0.,   1.]])
    """
    Rt = moved.rotation.swapaxes(1, 2)
    J_inv = np.asarray(np.linalg.inv(moved.inertia))
    H, T, F = (apply(Rt, v) for v in (moved.H, moved.T, moved.F))
    omega = apply(J_inv, H - moved.h)
    by_H = J_inv @ Rt  # of omega; theta moves H by [H]x theta, and so T and F
    d_omega = {"theta": by_H @ skew(moved.H), "H": by_H, "T": 0 * by_H, "F": 0 * by_H}
    d_H = {"theta": Rt @ skew(moved.H), "H": Rt, "T": 0 * Rt, "F": 0 * Rt}
    d_T = {"theta": Rt @ skew(moved.T), "H": 0 * Rt, "T": Rt, "F": 0 * Rt}
    d_F = {"theta": Rt @ skew(moved.F), "H": 0 * Rt, "T": 0 * Rt, "F": Rt}
    alpha = apply(J_inv, T - np.cross(omega, H) - apply(moved.inertia_rate, omega) - moved.h_rate)
    turned, lags = skew(H) - moved.inertia_rate, skew(omega)
    d_alpha = {v: J_inv @ (d_T[v] + turned @ d_omega[v] - lags @ d_H[v]) for v in d_H}

    read: list[Array] = []
    rows: dict[str, list[Array]] = {v: [] for v in d_H}
    for S in sensors.rotation:
        read.append(omega @ S)
        for v in rows:
            rows[v].append(S.T @ d_omega[v])
    for S, r in zip(sensors.rotation, sensors.position, strict=True):
        swept = np.cross(omega, r)
        read.append((F / moved.mass + np.cross(alpha, r) + np.cross(omega, swept)) @ S)
        by_omega = -skew(swept) - lags @ skew(r)
        for v in rows:
            rows[v].append(S.T @ (d_F[v] / moved.mass - skew(r) @ d_alpha[v] + by_omega @ d_omega[v]))
    used = sensors.used
    y, *d = (np.concatenate(parts, 1)[:, used] for parts in (read, *rows.values()))
    return y, d[0], d[1], d[2], d[3]


def with_sensors(model: StateSpace, sensors: Sensors, H: Array) -> StateSpace:
    """A model with channels of sensors below its own, and their biases behind its states.

    H (time, channel, state): rows of the sensors on the states of the model.
    """
    k, n, m, T = H.shape[1], len(model.x0), model.R.shape[-1], len(H)
    rows = np.zeros((T, m + k, n + k))
    rows[:, :m, :n], rows[:, m:, :n], rows[:, m:, n:] = model.H, H, np.eye(k)
    R, P0 = np.zeros((T, m + k, m + k)), np.zeros((n + k, n + k))
    R[:, :m, :m], R[:, m:, m:] = model.R, np.diag(sensors.noise_var)
    P0[:n, :n], P0[n:, n:] = model.P0, np.diag(sensors.bias_var)
    F, Q = (np.zeros((len(a), n + k, n + k)) for a in (model.F, model.Q))
    F[:, :n, :n], F[:, n:, n:], Q[:, :n, :n] = model.F, np.eye(k), model.Q
    u = None if model.u is None else np.pad(model.u, ((0, 0), (0, k)))
    return StateSpace(F, Q, rows, R, np.pad(model.x0, (0, k)), P0, u)


def gyro_rate(time: Array, sensors: Sensors | None) -> Array | None:
    """Angular velocity (time, 3), body axes, that the gyros read on average; bridged between samples.

    None where no gyro reads all three axes at once.
    """
    if sensors is None:
        return None
    body = np.einsum("sab,tsb->tsa", sensors.rotation, sensors.angular_velocity)
    whole = np.isfinite(body).all(2)
    seen = whole.any(1)
    if not seen.any():
        return None
    mean = np.where(whole[..., None], body, 0.0).sum(1)[seen] / whole.sum(1)[seen, None]
    return np.stack([np.interp(time, time[seen], axis) for axis in mean.T], 1)


def reckoned(time: Array, step: Array, rotation: Array) -> Array:
    """Rotations (time, 3, 3) by dead reckoning, led back to those that are seen.

    step (time - 1, 3, 3): turn from each sample to the next, body axes; rotation (time, 3, 3), NaN where not
    seen. The number of turns is that of the steps, so nothing is lost past half a turn a frame: what the
    reckoning drifts between two frames seen only has to stay below one half. Where none is seen, the world
    axes are those of the body at the first sample.
    """
    path = np.empty((len(time), 3, 3))
    path[0] = np.eye(3)
    for k, turn in enumerate(step):
        path[k + 1] = path[k] @ turn
    path = Rotation.from_matrix(path).as_matrix()  # rounding adds up along the products
    seen = np.isfinite(rotation).all((1, 2))
    if not seen.any():
        return path
    off = rotation[seen] @ path[seen].swapaxes(1, 2)
    if seen.sum() == 1:
        return np.asarray(off @ path)
    between = Slerp(time[seen], Rotation.from_matrix(off))
    return np.asarray(between(np.clip(time, *time[seen][[0, -1]])).as_matrix() @ path)


def drift(time: Array, step: Array, rotation: Array) -> float:
    """Largest angle rad by which dead reckoning, as in `reckoned`, misses a frame seen from the last."""
    seen = np.flatnonzero(np.isfinite(rotation).all((1, 2)))
    path = reckoned(time, step, np.full_like(rotation, np.nan))
    off = rotation[seen] @ path[seen].swapaxes(1, 2)
    return float(np.linalg.norm(log(off[1:] @ off[:-1].swapaxes(1, 2)), axis=1).max(initial=0.0))


def apply(A: Array, v: Array) -> Array:
    """Matrices (time, 3, 3) times vectors (time, 3)."""
    return np.asarray(np.einsum("tij,tj->ti", A, v))
