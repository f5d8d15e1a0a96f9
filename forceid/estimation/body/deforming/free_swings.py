"""Frequency and damping of modes from how a body swings when nothing but its weight acts.

Each amplitude is c + e^(-z w t) (A cos + B sin)(w sqrt(1 - z^2) t), fitted by least squares over w and z,
with the others in closed form. Source: principal equations 2.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from forceid.records import Array
from forceid.rounding import CENTRAL_STEP

STEPS_OF_A_TURN = 8  # frequencies tried in the width of a line, one over the record
DECAYS_TRIED = (0.0, 0.5, 2.0, 6.0)  # e-folds over the record that are tried
BOUNDS = ([0.0, -0.5], [np.inf, 0.9])  # of rad/s and damping: what grows or hardly swings is no mode


@dataclass(frozen=True)
class FreeSwing:
    """A mode that swings: frequency Hz, damping ratio, their cov (2, 2); misfit: chi-square per degree of
    freedom; gain: by which chi-square falls from that of a constant.
    """

    frequency: float
    damping: float
    cov: Array
    misfit: float
    gain: float


def free_swing(time: Array, q: Array, var: Array) -> FreeSwing:
    """The likeliest free swing in an amplitude q (time,) m with noise var (time,) m2; NaN = not seen.

    >>> t = np.arange(400) / 200
    >>> q = 1e-3 * np.exp(-0.8 * t) * np.cos(60 * t) + 1e-4
    >>> found = free_swing(t, q, np.full(400, 1e-10))
    >>> round(found.frequency, 3), round(found.damping, 4)
    (9.55, 0.0133)
    """
    seen = np.isfinite(q) & np.isfinite(var)
    t, weight = time[seen] - time[seen][0], 1 / np.sqrt(var[seen])
    z = q[seen] * weight

    def columns(p: Array) -> Array:
        decay, turn = p[0] * p[1] * t, p[0] * np.sqrt(max(1 - p[1] ** 2, 0.0)) * t
        swing = np.exp(-decay) * np.stack([np.cos(turn), np.sin(turn), np.exp(decay)])
        return np.asarray((swing * weight).T)

    def left(p: Array) -> Array:
        D = columns(p)
        return np.asarray(D @ np.linalg.lstsq(D, z)[0] - z)

    span = float(np.ptp(t))
    tried = np.arange(1.0, 0.5 * len(t), 1 / STEPS_OF_A_TURN) * 2 * np.pi / span
    starts = [(w, d / span / w) for w in tried for d in DECAYS_TRIED if d / span < 0.5 * w]
    start = min(starts, key=lambda p: float((left(np.array(p)) ** 2).sum()))
    found = least_squares(left, start, x_scale=(1 / span, 1 / span / start[0]), bounds=BOUNDS)
    p, D = found.x, columns(found.x)
    own = np.linalg.lstsq(D, z)[0]
    step = CENTRAL_STEP * np.array([p[0], 1.0])
    slopes = [(columns(p + h) - columns(p - h)) @ own / (2 * h.sum()) for h in np.diag(step)]
    J = np.column_stack([*slopes, D])
    dof = len(t) - 5
    misfit = float(2 * found.cost / dof)
    cov = np.linalg.inv(J.T @ J)[:2, :2] * max(misfit, 1.0)
    turns = np.array([1 / (2 * np.pi), 1.0])
    still = z - weight * (weight @ z) / (weight @ weight)
    gain = float(still @ still - 2 * found.cost)
    return FreeSwing(float(p[0] * turns[0]), float(p[1]), turns[:, None] * cov * turns, misfit, gain)
