"""The field of specific force on a body, fitted to accelerometers sample by sample.

At a place r from the mass center of a body that turns, in body axes, an accelerometer reads

    y = f + alpha x r + w x (w x r) + sum_k shape_k(r) a_k,

f the specific force at the mass center, (a - g), alpha = w', and a_k the accelerations of modes. This is
linear in f, alpha, the six numbers W = w w^T - w^2 1, and a_k. What no such motion can produce, 3n - 6 or
3n - 12 numbers of n sensors, measures noise and bias. Source: principal equations 2.2, 4d.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from forceid.principal import cross_matrix
from forceid.records import Array, Flags, Indices

FORCE, TURN, PULL = slice(0, 3), slice(3, 6), slice(6, 12)  # columns of f, alpha, W; modes stand behind
MODES = slice(6, None)  # without W
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # entries of W, in order
SHOWN = 1e-6  # of a combination of numbers: what less than that shows of it is rounding of the places


@dataclass(frozen=True)
class Sites:
    """Where accelerometers stand: position (sensor, 3) m from the mass center and rotation (sensor, 3, 3)
    sensor to body, body axes; shape (mode, sensor, 3): what modes of the body move them by; length m: size of
    the body, which a turn moves it by.
    """

    position: Array
    rotation: Array
    shape: Array
    length: float

    def columns(self, pull: bool) -> Array:
        """What each channel reads of a unit of f, alpha, W if `pull`, and a_k: (channel, number)."""
        r, none = self.position, np.zeros((len(self.position), 3))
        per_pull = []
        for i, j in PAIRS:
            part = none.copy()
            part[:, i] = r[:, j]
            part[:, j] = r[:, i]
            per_pull.append(part)
        still = np.tile(np.eye(3), (len(r), 1, 1))
        moved = [still, -cross_matrix(r), *([np.stack(per_pull, -1)] if pull else [])]
        every = np.concatenate([*moved, np.moveaxis(self.shape, 0, -1)], -1)
        return np.asarray(np.einsum("sba,sbn->san", self.rotation, every)).reshape(3 * len(r), -1)

    def sizes(self, pull: bool) -> Array:
        """Of each number, the size that moves the body by about one (number,)."""
        turning = np.full(PULL.stop - TURN.start if pull else 3, 1 / self.length)
        moved = np.linalg.norm(self.shape, axis=(1, 2))
        return np.concatenate([np.ones(3), turning, 1 / np.where(moved > 0, moved, 1.0)])


@dataclass(frozen=True)
class Fit:
    """Least squares of y = A p, sample by sample.

    number (time, number): p, the shortest where it is open; which (time,): the row of each sample in back
    (pattern, number, channel), p = back y, and in open (pattern, number, number), projector on combinations,
    over their sizes, that the channels read do not show; dof (time,) and misfit (time,): of what is left,
    residual (time, channel), NaN where not read; scale (number,): size of each.
    """

    number: Array
    which: Indices
    back: Array
    open: Array
    dof: Array
    misfit: Array
    residual: Array
    scale: Array

    @property
    def cov(self) -> Array:
        """Covariance (pattern, number, number) under channels of unit variance."""
        return np.asarray(self.back @ self.back.mT)

    def told(self, rows: Array) -> Flags:
        """Of rows (row, number) of combinations, whether each sample tells them: (time, row)."""
        scaled = rows * self.scale
        lost = np.linalg.norm(self.open @ scaled.T, axis=1)
        return np.asarray((lost <= SHOWN * np.linalg.norm(scaled, axis=1))[self.which])


def read_alike(y: Array) -> Iterator[tuple[Flags, Indices]]:
    """Which channels (channel,) are read, and the samples at which just these are, pattern by pattern.

    >>> [(r.tolist(), at.tolist()) for r, at in read_alike(np.array([[1.0, 2.0], [np.nan, 1.0], [0.0, 3.0]]))]
    [([False, True], [1]), ([True, True], [0, 2])]
    """
    patterns, which = np.unique(np.isfinite(y), axis=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        yield pattern, np.flatnonzero(which.ravel() == k)


def fit_field(y: Array, columns: Array, scale: Array) -> Fit:
    """The numbers behind readings y (time, channel), by columns (channel, number) and scale (number,)."""
    n, T = columns.shape[1], len(y)
    number, residual = np.zeros((T, n)), np.full(y.shape, np.nan)
    which, dof, misfit = np.zeros(T, int), np.zeros(T), np.zeros(T)
    backs, opens = [], []
    for k, (rows, at) in enumerate(read_alike(y)):
        U, s, V = np.linalg.svd(columns[rows] * scale, full_matrices=False)
        kept = s > SHOWN * s.max(initial=0.0)
        U, s, V = U[:, kept], s[kept], V[kept]
        back = np.zeros((n, len(rows)))
        back[:, rows] = scale[:, None] * (V.T / s @ U.T)
        number[at] = y[np.ix_(at, rows)] @ back[:, rows].T
        left = y[np.ix_(at, rows)] - number[at] @ columns[rows].T
        residual[np.ix_(at, rows)] = left
        which[at], dof[at], misfit[at] = k, rows.sum() - len(s), (left**2).sum(1)
        backs.append(back)
        opens.append(np.eye(n) - V.T @ V)
    return Fit(number, which, np.array(backs), np.array(opens), dof, misfit, residual, scale)


@dataclass(frozen=True)
class Level:
    """Standard deviations m/s2 of a channel: white, from sample to sample, and offset, which stays."""

    white: float
    offset: float

    @property
    def var(self) -> float:
        """Variance of what one reading is off by."""
        return self.white**2 + self.offset**2


def level_shown(fit: Fit) -> Level | None:
    """Noise and offset of a channel as what no motion can produce shows them; None where nothing is left."""
    dof = float(fit.dof.sum())
    if not dof:
        return None
    count = np.maximum(np.isfinite(fit.residual).sum(0), 1)
    steady = np.nansum(fit.residual, 0) / count
    white = float(np.nansum((fit.residual - steady) ** 2)) / dof
    each = dof / len(fit.dof)
    offset = float(steady @ steady) / each - white * each / max(dof, 1.0)
    return Level(np.sqrt(white), np.sqrt(max(offset, 0.0)))
