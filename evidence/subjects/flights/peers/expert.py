"""What an expert does with public libraries before anything is differentiated: markers to two clean paths.

Rotation and center of every frame by a least-squares fit to all markers seen (Kabsch, all frames at once, as
scipy's Rotation.align_vectors solves it one by one), the angular momentum from one frame to the next, and its
integral Y: then force and moment are mass times the second derivative of the center, less weight, and the
second derivative of Y. Where the body bends and every mass carries a marker, center and angular momentum are
sums over the masses instead. No code of the estimators is used. Source: principal equations 2.4, 4b.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.records import Array, Body, Recording

BENDS = 3.0  # rms residual of the rigid fit over the stated noise, beyond which a body is taken to bend
JITTER = 1e-3  # of a step: instants this even are taken for a regular clock


@dataclass(frozen=True)
class Paths:
    """Center and Y (sample, 6) on a regular clock, and what makes a wrench of their second derivatives.

    time (sample,) s; step s; mass kg; gravity (3,) m/s2; instants (time,) s at which the wrench is wanted;
    moment: whether a rotation was seen.
    """

    time: Array
    z: Array
    step: float
    mass: float
    gravity: Array
    instants: Array
    moment: bool

    def wrench(self, second: Array) -> Array:
        """Force and moment (time, 6) of second derivatives (sample, 6)."""
        load = np.concatenate([self.mass * (second[:, :3] - self.gravity), second[:, 3:]], 1)
        if len(self.time) == len(self.instants):
            return load
        return np.asarray(CubicSpline(self.time, load)(np.clip(self.instants, self.time[0], self.time[-1])))

    def spread(self, var: Array) -> Array:
        """Standard deviations (time, 6) of the wrench, of variances (sample, 6) of the second derivatives."""
        std = np.sqrt(np.maximum(var, 0.0)) * np.repeat([self.mass, 1.0], 3)
        return np.stack([np.interp(self.instants, self.time, s) for s in std.T], 1)


def paths_of(recording: Recording, by_mass: bool | None = None) -> Paths:
    """Center and integrated angular momentum of a recording.

    by_mass: sums over the masses (True), a rigid fit (False), or what the residual of that fit calls for.
    DataError: nothing but sensors was measured.
    """
    body, motion = recording.body, recording.motion
    mass, at, J = rigid_inertia(body)
    time, masses = motion.time, body.mass
    if motion.position is None:
        if motion.center is None:
            raise DataError("holds neither markers nor a pose", "/motion", "the peers have nothing to fit")
        center, rotation = motion.center, None
        if motion.orientation is not None:
            rotation = Rotation.from_quat(motion.orientation).as_matrix()
        return clocked(recording, time, center, momentum_between_frames(time, rotation, J), mass)
    seen = np.asarray(np.isfinite(motion.position).all(2))
    frames = seen.sum(1) >= min(3, seen.shape[1])
    time, x, seen = time[frames], motion.position[frames], seen[frames]
    assert body.position is not None
    X = body.position - at
    whole = masses is not None and bool(seen[:, masses > 0].mean(0).min() > 0.9)
    if by_mass and not whole:
        raise DataError("shows masses without a marker", "/motion/position", "fit a rigid body")
    if seen.shape[1] < 3:
        return clocked(recording, time, x[:, 0] - X[0], None, mass)
    if by_mass is not True:
        center, rotation, residual = rigid_fit(x, X, seen)
        noise = motion.noise_std.get("position", np.inf)
        if by_mass is False or not whole or residual <= BENDS * noise:
            return clocked(recording, time, center, momentum_between_frames(time, rotation, J), mass)
    assert masses is not None
    center, H = by_masses(time, x[:, masses > 0], masses[masses > 0])
    return clocked(recording, time, center, H, mass)


def rigid_inertia(body: Body) -> tuple[float, Array, Array]:
    """Mass, its center (3,) and the inertia tensor (3, 3) about it."""
    if body.mass is not None and body.position is not None:
        total = float(body.mass.sum())
        at = body.mass @ body.position / total
        X = body.position - at
        return total, at, (body.mass @ (X**2).sum(1)) * np.eye(3) - X.T @ (body.mass[:, None] * X)
    if body.total_mass is None:
        raise DataError("holds no lumped mass", "/body", "the peers know masses of nodes, or a rigid whole")
    at = np.zeros(3) if body.mass_center is None else body.mass_center
    return body.total_mass, at, np.full((3, 3), np.nan) if body.inertia is None else body.inertia


def rigid_fit(x: Array, X: Array, seen: Array) -> tuple[Array, Array, float]:
    """Center (frame, 3), rotation (frame, 3, 3) and rms residual of a rigid fit to x (frame, node, 3)."""
    w = seen.astype(float)
    x = np.where(seen[..., None], x, 0.0)
    total = w.sum(1)[:, None]
    x_mean, X_mean = x.sum(1) / total, w @ X / total
    G = np.einsum("tna,nb->tab", x, X) - total[..., None] * x_mean[:, :, None] * X_mean[:, None]
    U, _, Vt = np.linalg.svd(G)
    U[..., 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    R = U @ Vt
    center = x_mean - np.einsum("tab,tb->ta", R, X_mean)
    residual = np.where(seen[..., None], x - center[:, None] - X @ R.swapaxes(1, 2), 0.0)
    return center, R, float(np.sqrt((residual**2).sum() / max(3 * w.sum() - 6 * len(w), 1)))


def momentum_between_frames(time: Array, rotation: Array | None, J: Array) -> Array | None:
    """Angular momentum (frame - 1, 3) midway between frames, by the turn from one to the next."""
    if rotation is None or not np.isfinite(J).all():
        return None
    turn = Rotation.from_matrix(rotation[:-1].swapaxes(1, 2) @ rotation[1:]).as_rotvec()
    middle = rotation[:-1] @ Rotation.from_rotvec(turn / 2).as_matrix()
    return np.asarray(np.einsum("tab,bc,tc->ta", middle, J, turn / np.diff(time)[:, None]))


def by_masses(time: Array, x: Array, m: Array) -> tuple[Array, Array]:
    """Center (frame, 3) and angular momentum (frame - 1, 3) of masses, short gaps of markers bridged."""
    flat = x.reshape(len(x), -1)
    for track in flat.T[~np.isfinite(flat).all(0)]:
        gone = ~np.isfinite(track)
        track[gone] = CubicSpline(time[~gone], track[~gone])(time[gone])
    x = flat.reshape(x.shape)
    center = np.einsum("n,tna->ta", m, x) / m.sum()
    arm = x - center[:, None]
    swept = np.einsum("n,tna->ta", m, np.cross(arm[:-1], arm[1:]))
    return center, swept / np.diff(time)[:, None]


def clocked(recording: Recording, time: Array, center: Array, H: Array | None, mass: float) -> Paths:
    """Paths on a regular clock, by cubic splines where the frames are not on one."""
    Y = np.zeros_like(center)
    if H is not None:
        Y[1:] = np.cumsum(H * np.diff(time)[:, None], axis=0)
    z, steps = np.concatenate([center, Y], 1), np.diff(time)
    step = float(np.median(steps))
    if np.abs(steps - step).max() > JITTER * step:
        even = np.arange(time[0], time[-1], step)
        z, time = CubicSpline(time, z)(even), even
    motion = recording.motion
    return Paths(time, z, step, mass, motion.gravity, motion.time, H is not None)
