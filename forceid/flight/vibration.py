"""The prior of a mode: an oscillator under a load that wanders, its four numbers by maximum likelihood.

How smooth that load is, its order, the record tells as well, for all modes together.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from itertools import product

import numpy as np

from forceid.flight.channels import driven, tuning_segments
from forceid.flight.tuning import ORDERS
from forceid.kalman.building.line_search import AT_ONCE
from forceid.kalman.building.process import Process, matern, matern_density
from forceid.kalman.engines import Engine, for_tuning
from forceid.kalman.model import StateSpace
from forceid.kalman.tuning.search import maximize
from forceid.records import Array
from forceid.significance import OUTLIER, PATIENCE

FREQUENCIES = 16  # looked at first, evenly spread, beside the tallest of the periodogram
SHAPES = np.array(list(product((0.01, 0.1, 1.0), (0.003, 0.1, 3.0))))  # damping and rate over the frequency
DETUNED = 0.3  # of a logarithm: how far the frequency may move from the best of these
STILL = 1e-6  # of an amplitude: as good as none
HIDDEN = np.geomspace(1e-3, 1.0, 31)  # of it: sizes tried of motion that may hide in noise
HASTENED = (
    1.0,
    2.0,
    4.0,
)  # times the rate of the order below, tried first: a smoother load bends at a higher one


class ModeState(IntEnum):
    """The first states of a mode: its amplitude, the rate of that, and the load that drives it.

    The derivatives of the load follow.
    """

    AMPLITUDE, RATE, LOAD = range(3)


@dataclass(frozen=True)
class Vibration:
    """Amplitudes q'' + 2 b q' + w^2 q = f with a Matern load f of some order, an oscillator each.

    frequency w (mode,) rad/s; damping b (mode,) 1/s; std (mode,) m of q; rate (mode,) 1/s at which the load
    forgets. Of order 1, with b = w = rate, q is a Matern process of order 3; with little damping a line at w.
    Source: principal equations 4e.
    """

    frequency: Array
    damping: Array
    std: Array
    rate: Array
    order: int = 1

    @property
    def states(self) -> int:
        """States of a mode."""
        return ModeState.LOAD + self.order

    @property
    def load(self) -> Array:
        """Standard deviation (mode,) of the loads f, m/s2."""
        return np.asarray(np.sqrt(self.process.P0[..., 2, 2]))

    @property
    def motion(self) -> Array:
        """Rows (mode, 3, 3) that read amplitude, rate and acceleration off a mode's first three states."""
        rows = np.tile(np.eye(3), (len(self.rate), 1, 1))
        rows[:, 2, 0], rows[:, 2, 1] = -(self.frequency**2), -2 * self.damping
        return rows

    def answer(self, w: Array) -> Array:
        """Density (..., mode) of the accelerations q'' over that of the loads f, at w (..., 1) rad/s."""
        still = (self.frequency**2 - w**2) ** 2 + (2 * self.damping * w) ** 2
        return np.asarray(w**4 / still)

    def density(self, w: Array) -> Array:
        """Spectral density (..., mode), two-sided, per Hz, of the accelerations q'' at w (..., 1) rad/s."""
        return self.answer(w) * matern_density(self.order, self.load, self.rate, w)

    @property
    def process(self) -> Process:
        """States (q, q', f and its derivatives) of each mode, stationary from the start; the output is q."""
        load = matern(self.order, np.ones_like(self.rate), self.rate)
        A, Qc = (np.zeros((*self.rate.shape, self.states, self.states)) for _ in range(2))
        A[..., 0, 1] = A[..., 1, 2] = 1.0
        A[..., 1, 0], A[..., 1, 1] = -(self.frequency**2), -2 * self.damping
        A[..., 2:, 2:], Qc[..., 2:, 2:] = load.A, load.Qc
        P0 = swinging(self.frequency, self.damping, load)
        scale = (self.std**2 / P0[..., 0, 0])[..., None, None]
        return Process(A, scale * Qc, scale * P0, np.eye(self.states)[0])


def swinging(frequency: Array, damping: Array, load: Process) -> Array:
    """Covariance P (mode, state, state) of (q, q', load) at rest, A P + P A^T + Qc = 0, row by row.

    frequency and damping (mode,) 1/s; load: at rest itself. With A of the load alone and c = E[q f] over its
    states, (A^2 - 2 b A + w^2) c = E[f_0 f] and E[q' f] = -A c; the variance of q' is E[q' f_0] / 2 b. That
    is solved for by itself, and no difference takes its digits: a slow load moves a mode by far more than it
    makes it ring.
    """
    unit = frequency[:, None] ** -np.arange(load.A.shape[-1])  # of time, a power for every derivative
    size = unit[:, :, None] * unit[:, None, :]
    A = load.A / frequency[:, None, None] * unit[:, :, None] / unit[:, None, :]
    P, Qc = load.P0 * size, load.Qc * size / frequency[:, None, None]
    ratio = (damping / frequency)[:, None, None]
    # at rest -A E[f_0 f] is row 0 of A P + Qc, whose zeros are exact
    both = np.concatenate([P[:, :1], A[:, :1] @ P + Qc[:, :1]], 1).mT
    told = np.linalg.solve(A @ A - 2 * ratio * A + np.eye(A.shape[-1]), both).mT
    out = np.zeros((len(A), A.shape[-1] + 2, A.shape[-1] + 2))
    out[:, :2, 2:], out[:, 2:, :2], out[:, 2:, 2:] = told, told.mT, P
    out[:, 1, 1] = told[:, 1, 0] / (2 * ratio[:, 0, 0])
    out[:, 0, 0] = out[:, 1, 1] + told[:, 0, 0]
    back = np.concatenate([frequency[:, None] ** -np.array([2, 1]), 1 / unit], 1)
    return np.asarray(out * back[:, :, None] * back[:, None, :])


def vibrating(prior: Vibration, noise_var: Array, step: Array) -> StateSpace:
    """Measured amplitudes as one scalar model a mode; noise_var (time, mode) m2; step (time - 1,) s."""
    return driven(prior.process, 1.0, noise_var, np.zeros(noise_var.shape[1]), step)


def tune_vibrations(
    time: Array,
    q: Array,
    noise_var: Array,
    engine: Engine | None = None,
    orders: tuple[int, ...] = ORDERS,
) -> Vibration:
    """The most likely prior of each of the amplitudes q (time, mode), seen with noise_var (time, mode).

    Every mode by itself, but for the order of their loads: the likeliest of orders, ascending. NaN = missing.
    The roughest from the best of a grid, on it the lines that stand out of the periodogram; each other from
    the one below, and those lines. A mode that is not e^PATIENCE times as likely to move as not moves like
    the one that moves most clearly, as far as it may by a standard error: absence of evidence is not zero.
    """
    likelihood, modes, step = for_tuning(engine).log_likelihood, q.shape[1], np.diff(time)
    runs = tuning_segments(q)

    def objective(order: int, points: Array, _: Array | None = None) -> Array:
        mode = np.broadcast_to(np.arange(modes)[:, None], points.shape[:-1]).ravel()
        prior = prior_of(points.reshape(-1, 4), order)
        total = np.zeros(len(mode))
        for run in runs:
            model = vibrating(prior, noise_var[run][:, mode], np.diff(time[run]))
            total += likelihood(model, q[run][:, mode, None], OUTLIER)
        return np.asarray(total.reshape(points.shape[:-1]))

    size = signal_size(q, noise_var)
    span = float(np.ptp(time))
    slow, fast = 2 * np.pi / span, 0.9 * np.pi / float(np.median(step))
    tried = first_points(time, q, size, slow, fast)
    lines = tried[:, FREQUENCIES * len(SHAPES) :]
    low, high = np.empty((modes, 4)), np.empty((modes, 4))
    low[:], high[:] = np.log([slow, 0.1 / span, 1.0, 0.1 / span]), np.log([fast, fast, 1.0, fast])
    low[:, 2], high[:, 2] = np.log(0.1 * size), np.log(10 * size)
    best, value, order = np.zeros(0), np.full(modes, -np.inf), 0
    for each in orders:
        tried = np.clip(tried, low[:, None], high[:, None])
        at = tried[np.arange(modes), np.nan_to_num(objective(each, tried[None])[0], nan=-np.inf).argmax(1)]
        near = np.array([DETUNED, np.inf, np.inf, np.inf])
        box = np.maximum(low, at - near), np.minimum(high, at + near)
        at, _, values = maximize(partial(objective, each), *box, (0.0, 0.0), (at, 0.0))
        if values.sum() < value.sum() - PATIENCE:
            break  # smoother ones are less likely still
        if values.sum() > value.sum():
            best, value, order = at, values, each
        near_by = np.repeat(at[:, None], len(HASTENED), 1)
        near_by[..., 3] += np.log(HASTENED)
        tried = np.concatenate([near_by, lines], 1)

    def sized(shape: Array, std: Array) -> Array:
        points = np.broadcast_to(shape, (modes, len(std), 4)).copy()
        points[..., 2] = np.log(std * np.sqrt(variance_of(q))[:, None])
        return np.asarray(np.nan_to_num(objective(order, points[None])[0], nan=-np.inf))

    moved = value - sized(best[:, None], np.array([STILL]))[:, 0]
    if (still := moved < PATIENCE).any():
        shape = np.array([*low[0, :2], 0.0, low[0, 3]]) if still.all() else best[moved.argmax()]
        likely = sized(shape, HIDDEN)
        most = (likely >= likely.max(1, keepdims=True) - 0.5) * np.arange(1, len(HIDDEN) + 1)
        best[still] = shape
        best[still, 2] = np.log(HIDDEN[most.max(1) - 1] * np.sqrt(variance_of(q)))[still]
    return prior_of(best, order)


def prior_of(at: Array, order: int) -> Vibration:
    """The prior at points (mode, 4) of a search: logarithms of frequency, damping, size and rate."""
    frequency, damping, std, rate = np.exp(at).T
    return Vibration(frequency, damping, std, rate, order)


def variance_of(q: Array) -> Array:
    """Mean square (mode,) of amplitudes, noise and all."""
    return np.asarray(np.nanmean(q**2, 0))


def signal_size(q: Array, noise_var: Array) -> Array:
    """About the standard deviation (mode,) of amplitudes, without their noise; a tenth of all at least."""
    var = variance_of(q)
    noise = np.nanmean(np.where(np.isfinite(q), noise_var, np.nan), 0)
    return np.asarray(np.sqrt(np.maximum(var - noise, 1e-2 * var)))


def first_points(time: Array, q: Array, size: Array, slow: float, fast: float) -> Array:
    """Where a search begins (mode, point, 4): logarithms of frequency, damping, size and rate of the load.

    Frequencies evenly spread between slow and fast (rad/s), and those that stand out of the periodogram.
    """
    power = np.abs(np.fft.rfft(np.nan_to_num(q), 2 * len(q), axis=0)[1:]) ** 2
    line = 2 * np.pi * np.fft.rfftfreq(2 * len(q), float(np.ptp(time)) / (len(q) - 1))[1:]
    power[(line < slow) | (line > fast)] = 0.0
    tallest = line[np.argsort(-power, axis=0)[:AT_ONCE]].T
    spread = np.broadcast_to(np.geomspace(slow, fast, FREQUENCIES), (len(size), FREQUENCIES))
    first = np.concatenate([spread, tallest], 1)
    grid = np.empty((*first.shape, len(SHAPES), 4))
    grid[..., 0], grid[..., 2] = first[:, :, None], size[:, None, None]
    grid[..., 1], grid[..., 3] = (first[:, :, None] * rate for rate in SHAPES.T)
    return np.asarray(np.log(grid.reshape(len(size), -1, 4)))
