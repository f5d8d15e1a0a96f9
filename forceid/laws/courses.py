"""A course to fit from an estimate: its poses, frame by frame, and what they move."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.laws.flying import Course
from forceid.records import Array, Estimate, Flags

FEWEST_POSES = 20  # frames with a pose: twice as many numbers as a start takes, and more


def course_of(estimate: Estimate, name: str) -> Course:
    """What was seen of a flight, and what flies. DataError: the result shows no poses.

    Errors of frames are those that the estimate counted; the deformation is that of the estimate.
    """
    flown = estimate.flown
    if flown is None or np.isfinite(flown.center).all(1).sum() < FEWEST_POSES:
        what = f"holds poses of fewer than {FEWEST_POSES} frames, which a law of the air is fitted to"
        raise DataError(what, f"{name}:/flown", "estimate again from markers or poses")
    whole: Flags = np.asarray(np.isfinite(flown.center).all(1))
    known: Flags = np.asarray(np.isfinite(estimate.velocity).all(1))
    turns = bool(np.isfinite(flown.orientation).any())
    seen: Flags = whole & np.isfinite(flown.orientation).all(1) if turns else whole
    first, stop = int(np.argmax(known)), len(known) - int(np.argmax(known[::-1]))
    s = slice(first, stop)
    R = rotations(flown.orientation)
    smooth = rotations(estimate.orientation)
    root = np.full((len(seen), 6, 6), np.nan)
    root[seen] = inverse_roots(flown.pose_cov[seen]) if turns else center_roots(flown.pose_cov[seen])
    omega = np.nan_to_num(estimate.angular_velocity)
    start = np.concatenate([estimate.center[first], estimate.velocity[first], np.zeros(3), omega[first]])
    begin = smooth[first] if turns else np.eye(3)
    at = np.where(seen[:, None], flown.center, np.nan)
    std = np.sqrt(np.diagonal(estimate.wrench_cov, axis1=1, axis2=2))
    turned = smooth[s] if turns else np.broadcast_to(np.eye(3), (stop - first, 3, 3))
    inertia = flown.inertia if turns else np.broadcast_to(np.eye(3), flown.inertia.shape)
    wrench = np.concatenate([estimate.force, estimate.moment], 1)
    if estimate.known_force is not None:
        raise DataError("is beside known loads, which no law is fitted to", name, "estimate it without them")
    if flown.current_mass is not None:
        raise DataError(
            "has a mass that changes, which no law is fitted to", name, "cut it to before or after"
        )
    return Course(
        name, estimate.time[s] - estimate.time[first], at[s], R[s], root[s], estimate.mass, inertia[s],
        flown.internal_momentum[s], np.asarray(estimate.gravity), bridged(flown.wind, s), turns, start, begin,
        wrench[s], std[s], (estimate.center[s], estimate.velocity[s], turned, omega[s]),
        np.ones(stop - first - 1, int), np.zeros(stop - first - 1, bool),
    )  # fmt: skip


def bridged(wind: Array | None, s: slice) -> Array | None:
    """A wind (time, 3) that was measured, its gaps bridged straight; None for none."""
    if wind is None or not np.isfinite(wind).all(1).any():
        return None
    clock, seen = np.arange(len(wind)), np.isfinite(wind).all(1)
    return np.stack([np.interp(clock, clock[seen], w[seen]) for w in wind.T], 1)[s]


def rotations(quaternion: Array) -> Array:
    """Rotation matrices (time, 3, 3) of quaternions (time, 4); NaN stays NaN."""
    out = np.full((len(quaternion), 3, 3), np.nan)
    seen = np.isfinite(quaternion).all(1)
    if seen.any():
        out[seen] = Rotation.from_quat(quaternion[seen]).as_matrix()
    return out


def inverse_roots(cov: Array) -> Array:
    """Inverse of the lower roots (time, 6, 6) of covariances: what whitens."""
    return np.stack([solve_triangular(np.linalg.cholesky(P), np.eye(len(P)), lower=True) for P in cov])


def center_roots(cov: Array) -> Array:
    """The same of centers alone, nothing of rotations."""
    out = np.zeros((len(cov), 6, 6))
    out[:, :3, :3] = inverse_roots(cov[:, :3, :3])
    return out
