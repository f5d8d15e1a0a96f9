"""The prior of a mode: an oscillator under a load that wanders, its four numbers by maximum likelihood."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from itertools import product

import numpy as np

from forceid.flight.channels import driven, tuning_segments
from forceid.kalman.building.lines import AT_ONCE
from forceid.kalman.building.process import Process, matern
from forceid.kalman.engines import Engine, for_tuning
from forceid.kalman.model import StateSpace
from forceid.kalman.tuning.search import maximize
from forceid.records import Array
from forceid.significance import OUTLIER

FREQUENCIES = 16  # looked at first, evenly spread, beside the tallest of the periodogram
DAMPED, REMEMBERED = (0.01, 0.1, 1.0), (0.003, 0.1, 3.0)  # rates over the frequency, looked at first
DETUNED = 0.3  # of a logarithm: how far the frequency may move from the best of these


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
    def process(self) -> Process:
        """States (q, q', f and its derivatives) of each mode, stationary from the start; the output is q."""
        load = matern(self.order, np.ones_like(self.rate), self.rate)
        A, Qc = (np.zeros((*self.rate.shape, self.states, self.states)) for _ in range(2))
        A[..., 0, 1] = A[..., 1, 2] = 1.0
        A[..., 1, 0], A[..., 1, 1] = -(self.frequency**2), -2 * self.damping
        A[..., 2:, 2:], Qc[..., 2:, 2:] = load.A, load.Qc
        P0 = stationary(A, Qc, self.frequency)
        P0[..., 0, 1] = P0[..., 1, 0] = 0.0  # at rest nothing goes with its own rate: no rounding either
        scale = (self.std**2 / P0[..., 0, 0])[..., None, None]
        return Process(A, scale * Qc, scale * P0, np.eye(self.states)[0])


def stationary(A: Array, Qc: Array, rate: Array) -> Array:
    """Covariance P (..., state, state) at which x' = A x + w rests: A P + P A^T + Qc = 0.

    rate (...) 1/s: of the motion, so that states and their derivatives are solved for in like units.
    """
    n = A.shape[-1]
    unit = rate[..., None] ** -np.arange(n)  # of time, a power for every derivative
    A = A * unit[..., :, None] / unit[..., None, :]
    Qc = Qc * unit[..., :, None] * unit[..., None, :]
    one = np.eye(n)
    both = np.einsum("...ij,kl->...ikjl", A, one) + np.einsum("ij,...kl->...ikjl", one, A)
    P = np.linalg.solve(both.reshape(*A.shape[:-2], n * n, n * n), -Qc.reshape(*Qc.shape[:-2], n * n, 1))
    P = P.reshape(Qc.shape) / unit[..., :, None] / unit[..., None, :]
    return np.asarray(0.5 * (P + P.mT))


def vibrating(prior: Vibration, noise_var: Array, step: Array) -> StateSpace:
    """Measured amplitudes as one scalar model a mode; noise_var (time, mode) m2; step (time - 1,) s."""
    return driven(prior.process, 1.0, noise_var, np.zeros(noise_var.shape[1]), step)


def tune_vibrations(time: Array, q: Array, noise_var: Array, engine: Engine | None = None) -> Vibration:
    """The most likely prior of each of the amplitudes q (time, mode), seen with noise_var (time, mode).

    Every mode by itself; NaN = missing. From the best of a grid, on it the lines that stand out of the
    periodogram.
    """
    likelihood, modes = for_tuning(engine).log_likelihood, q.shape[1]
    runs = tuning_segments(q)
    span, step = float(np.ptp(time)), float(np.median(np.diff(time)))

    def objective(points: Array, _levels: Array) -> Array:
        mode = np.broadcast_to(np.arange(modes)[:, None], points.shape[:-1]).ravel()
        prior = Vibration(*np.exp(points.reshape(-1, 4)).T)
        total = np.zeros(len(mode))
        for run in runs:
            model = vibrating(prior, noise_var[run][:, mode], np.diff(time[run]))
            total += likelihood(model, q[run][:, mode, None], OUTLIER)
        return np.asarray(total.reshape(points.shape[:-1]))

    seen = np.isfinite(q)
    var = np.nanmean(q**2, 0)
    size = np.sqrt(np.maximum(var - np.nanmean(np.where(seen, noise_var, np.nan), 0), 1e-2 * var))
    slow, fast = 2 * np.pi / span, 0.9 * np.pi / step
    power = np.abs(np.fft.rfft(np.nan_to_num(q), 2 * len(q), axis=0)[1:]) ** 2
    line = 2 * np.pi * np.fft.rfftfreq(2 * len(q), span / (len(q) - 1))[1:]
    power[(line < slow) | (line > fast)] = 0.0
    tallest = line[np.argsort(-power, axis=0)[:AT_ONCE]].T
    spread = np.geomspace(slow, fast, FREQUENCIES)
    first = np.concatenate([np.broadcast_to(spread, (modes, FREQUENCIES)), tallest], 1)
    shape = np.array(list(product(DAMPED, REMEMBERED)))
    grid = np.empty((modes, first.shape[1], len(shape), 4))
    grid[..., 0], grid[..., 2] = first[:, :, None], size[:, None, None]
    grid[..., 1], grid[..., 3] = (first[:, :, None] * rate for rate in shape.T)
    grid = np.log(grid.reshape(modes, -1, 4))
    value = np.nan_to_num(objective(grid[None], np.zeros((1, modes)))[0], nan=-np.inf)
    at = grid[np.arange(modes), value.argmax(1)]
    low = np.log(np.broadcast_to([slow, 0.1 / span, 1.0, 0.1 / span], at.shape)).copy()
    high = np.log(np.broadcast_to([fast, fast, 1.0, fast], at.shape)).copy()
    low[:, 0], high[:, 0] = (np.clip(at[:, 0] + d, low[:, 0], high[:, 0]) for d in (-DETUNED, DETUNED))
    low[:, 2], high[:, 2] = np.log(0.1 * size), np.log(10 * size)
    at = np.clip(at, low, high)
    found = maximize(objective, low, high, (0.0, 0.0), (at, 0.0))[0]
    return Vibration(*np.exp(found).T)
