"""Noise that differs from axis to axis of the world: the root of its covariance, and what fits make of it."""

from __future__ import annotations

import numpy as np

from forceid.records import Array, Flags, Motion
from forceid.rounding import SOLVED

LAST_PLACES = 16  # of the last place, in sums of a few products
NO_AXIS = 0.02  # of the noise of the loudest axis: what shows less is no error of a track


def noisy(var: Array) -> Flags:
    """Which axes of noise variances (axis,) show some: not those of a planar video, or of an encoder.

    >>> noisy(np.array([1.0, 2.0, 0.0])).tolist()
    [True, True, False]
    """
    return np.asarray(var >= NO_AXIS**2 * var.max())


def at_rest(readings: Array) -> Flags:
    """Which readings (time, ...) never change but by rounding: (...).

    >>> at_rest(np.array([[0.1, 5.0], [0.1, 5.1]])).tolist()
    [True, False]
    """
    seen = np.isfinite(readings)
    high, low = (
        f(np.where(seen, readings, worst), axis=0) for f, worst in ((np.max, -np.inf), (np.min, np.inf))
    )
    return np.asarray(high - low <= LAST_PLACES * np.spacing(np.abs(readings[seen]).max(initial=1e-9)))


def as_stated(std: dict[str, float], motion: Motion) -> dict[str, Array]:
    """Roots (3, 3) of the covariances of noise stated by variable: axes on which all is at rest have none."""
    root = {name: level * np.eye(3) for name, level in std.items()}
    for name, read in (("position", motion.position), ("center", motion.center)):
        if name in root and read is not None:
            still = at_rest(read).reshape(-1, 3).all(0)
            root[name] = std[name] * np.diag(np.where(still & ~still.all(), NO_AXIS, 1.0))
    return root


def rms_noise(root: Array) -> float:
    """Standard deviation of a noise whose covariance has the root (3, 3), in the mean square over the axes.

    >>> round(rms_noise(np.diag([1.0, 1.0, 2.0])) ** 2, 9)
    2.0
    """
    return float(np.sqrt((root**2).sum() / 3))


def share(root: Array) -> Array:
    """Covariance (3, 3) of a noise along world axes over its mean variance, from the root of it."""
    return np.asarray(root @ root.T / rms_noise(root) ** 2)


def floored(root: Array, least: float) -> Array:
    """The root, or that of equal noise of `least` standard deviation where it is smaller in the mean."""
    return root if rms_noise(root) >= least else least * np.eye(3)


def uneven(root: Array) -> Array | None:
    """What the covariance (3, 3) of a noise has beyond its mean variance on every axis; None for nothing."""
    more = (share(root) - np.eye(3)) * rms_noise(root) ** 2
    return more if np.abs(more).max() > SOLVED * rms_noise(root) ** 2 else None
