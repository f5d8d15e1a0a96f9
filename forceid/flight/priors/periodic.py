"""A load that repeats, as of a wing, a rotor, a hand that shakes: its course in a period wanders slowly.

The periodic kernel times an envelope that decays, along each axis,

    k(t) = std^2 exp(-2 sin^2(pi f t) / length^2) exp(-decay |t|)
         = std^2 exp(-decay |t|) sum_j q_j^2 cos(2 pi j f t),    q_0^2 = I_0(1/length^2) exp(-1/length^2),
                                                                q_j^2 = 2 I_j(1/length^2) exp(-1/length^2):

of each harmonic a resonator that forgets its phase and its size at `decay`. Source: A. Solin and S. Sarkka,
Explicit link between periodic covariance functions and state space models, AISTATS 33 (2014) 904.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag
from scipy.optimize import Bounds, minimize
from scipy.special import ive

from forceid.flight.channels import driven, load_chain, runs_of, start_of
from forceid.flight.color import Color
from forceid.flight.pieces import Pieces
from forceid.flight.priors.protocol import Tuned
from forceid.flight.tuning import AT_LIMIT, ORDERS, PROBE, tune_loads
from forceid.kalman.building.line_candidates import winsorized
from forceid.kalman.building.line_search import AT_ONCE, COHERENT
from forceid.kalman.building.lines import Line, along_axes
from forceid.kalman.building.process import Process, matern, resonator, superpose
from forceid.kalman.engines import Engine, for_tuning
from forceid.kalman.model import StateSpace
from forceid.records import Array, Indices
from forceid.significance import OUTLIER, PATIENCE

MOST_HARMONICS = 8  # harmonics, two states an axis each: a course of two dozen turning points a period


@dataclass(frozen=True)
class Periodic:
    """Quasi-periodic kernels: std (axis,) of the load; of all axes frequency Hz, decay 1/s, length in radians
    of the phase, over which the load changes, and how many harmonics are counted.
    """

    std: Array
    frequency: float
    decay: float
    length: float
    harmonics: int
    order = 1
    kinks = rivals = False

    @property
    def rate(self) -> Array:
        """At which the load forgets itself (axis,), 1/s."""
        return np.full(len(self.std), self.decay)

    @cached_property
    def process(self) -> Process:
        """The load along each axis: what wanders about its mean, then two states a harmonic."""
        return process_of(self.std, self.frequency, self.decay, self.length, self.harmonics)

    @property
    def slope(self) -> Array:
        """Row (state,) that reads the rate of the load; what wanders about its mean has none."""
        load = self.of(np.arange(1)).process
        return np.append(0.0, (load.output @ load.A[0])[1:])

    def density(self, w: Array) -> Array:
        """Spectral density (..., axis), two-sided, per Hz, at w (..., 1) rad/s."""
        line, b = 2 * np.pi * self.frequency * np.arange(self.harmonics + 1), self.decay
        both = sum(b / (b**2 + (w + sign * line) ** 2) for sign in (-1, 1))
        return np.asarray(self.std**2 * (both @ shares(self.length, self.harmonics))[..., None])

    def of(self, axes: Indices) -> Periodic:
        """The kernels of some axes."""
        return replace(self, std=self.std[axes])

    def scaled(self, share: Array | float) -> Periodic:
        """The kernels of a load that is so many times as large."""
        return replace(self, std=self.std * share)

    def moved(self, by: Array) -> Periodic:
        """The kernels whose level at high frequency is e^by[0] times itself, and whose decay e^by[1]."""
        return replace(self, std=self.std * np.exp(by[0] - 0.5 * by[1]), decay=self.decay * np.exp(by[1]))

    def hastened(self, factor: float) -> Periodic:
        """The kernels of loads as large that forget themselves so many times as fast."""
        return replace(self, decay=factor * self.decay)

    def unknown(self, std: Array, rate: float) -> Periodic:
        """Kernels for loads of which little is known but std (axis,); their beat is that of this one."""
        return replace(self, std=std)

    def numbers(self) -> dict[str, float]:
        """What a result file says of the kernels."""
        found = {"period_s": 1 / self.frequency, "coherence_s": 1 / self.decay, "length": self.length}
        return found | {f"std_{i}": float(std) for i, std in enumerate(self.std, 1)}


def shares(length: ArrayLike, harmonics: int) -> Array:
    """Part (..., harmonics + 1) of the variance of a load in its mean and in each of its harmonics.

    Higher ones than these leave their part to all of these, so that the sum is one.

    >>> shares(1.0, 6).round(3).tolist()
    [0.466, 0.416, 0.1, 0.016, 0.002, 0.0, 0.0]
    """
    j = np.arange(harmonics + 1)
    share = ive(j, np.asarray(length, float)[..., None] ** -2) * np.where(j > 0, 2.0, 1.0)
    return np.asarray(share / share.sum(-1, keepdims=True))


def process_of(
    std: Array, frequency: ArrayLike, decay: ArrayLike, length: ArrayLike, harmonics: int
) -> Process:
    """The loads (...) of such kernels."""
    size = std[..., None] * np.sqrt(shares(length, harmonics))
    lines = [resonator(j * np.asarray(frequency), size[..., j], decay) for j in range(1, harmonics + 1)]
    return superpose(matern(1, size[..., 0], decay), *lines)


@dataclass(frozen=True)
class BeatSearch:
    """What a search looks at: stretches (time, z, noise_var) of a record, the lines that the load holds
    beside, and a prior from which to begin, whose noise it takes.
    """

    runs: list[tuple[Array, Array, Array]]
    gain: float
    drift: Array
    lines: tuple[Line, ...]
    start: Tuned
    engine: Engine

    @property
    def axes(self) -> int:
        """How many there are."""
        return len(self.drift)

    @property
    def span(self) -> float:
        """Length s of the longest stretch."""
        return max(float(np.ptp(time)) for time, _, _ in self.runs)

    @property
    def fastest(self) -> float:
        """Frequency Hz up to which samples tell one from another."""
        return 0.5 / float(np.median(np.diff(self.runs[0][0])))

    def models(self, load: Process, axis: Indices, noise: Array) -> Iterator[tuple[StateSpace, Array]]:
        """Models (model,) of loads (model,) along axes, the std of the noise times `noise`; what they see."""
        for time, y, var in self.runs:
            beside = along_axes(self.lines, axis)
            chain = load_chain(load, start_of(time, y, self.gain), beside)
            seen = var[:, axis] * noise**2, self.drift[axis] * noise**2
            yield driven(chain, self.gain, *seen, np.diff(time)), y[:, axis, None]

    def beats(self) -> list[float]:
        """Frequencies Hz whose harmonics stand out of what the first prior leaves."""
        axis, white = np.arange(self.axes), []
        for model, y in self.models(self.start.kernel.process, axis, self.start.noise):
            each = [self.engine.filter(model.one(i), y[:, i]).innovation[:, 0] for i in range(self.axes)]
            white.append(winsorized(np.stack(each, 1)))
        v = max(white, key=len)
        # so fine that the highest harmonic of a beat falls on a frequency that the record tells apart
        frequency = np.fft.rfftfreq(MOST_HARMONICS * len(v), 0.5 / self.fastest)
        power = np.abs(np.fft.rfft(v, MOST_HARMONICS * len(v), axis=0)) ** 2 / np.maximum((v**2).sum(0), 1.0)
        over = np.maximum(power, 1.0)
        gained = (over - 1 - np.log(over)).sum(1)  # log-likelihood, by a harmonic of any size
        gained -= gained.mean()
        # from where a beat is told from slow loads, up to where a harmonic of it is seen
        first = int(np.ceil(2 / (self.span * frequency[1])))
        combs = np.array(
            [gained[k : MOST_HARMONICS * k + 1 : k].sum() for k in range(first, len(gained) // 2)]
        )
        found: list[float] = []
        while len(found) < AT_ONCE and np.isfinite(combs).any():
            best = float(frequency[first + int(combs.argmax())])
            found.append(best)
            combs[np.abs(frequency[first : first + len(combs)] - best) * self.span <= 1] = -np.inf
        found += [share * f for share in (0.5, 2.0) for f in found[:1]]
        return [f for f in found if frequency[first] <= f <= 0.5 * self.fastest]

    def harmonics(self, frequency: float) -> int:
        """How many harmonics of a beat samples tell apart, MOST_HARMONICS at most."""
        return min(MOST_HARMONICS, int(self.fastest / frequency))

    def likelihoods(self, points: Array, harmonics: int) -> Array:
        """Of priors (point,), by axis. A point: frequency, logarithms of decay, noise, length and stds."""
        count = len(points)
        frequency, decay, level, length = (np.repeat(a, self.axes) for a in points[:, : -self.axes].T)
        std = np.exp(points[:, -self.axes :]).ravel()
        load = process_of(std, frequency, np.exp(decay), np.exp(length), harmonics)
        axis, noise = np.tile(np.arange(self.axes), count), np.exp(level) * np.tile(self.start.noise, count)
        likelihood = self.engine.log_likelihood
        total = sum(likelihood(model, y, OUTLIER) for model, y in self.models(load, axis, noise))
        return np.asarray(np.nan_to_num(np.reshape(total, (count, self.axes)), nan=-1e9))

    def climbed(self, first: Array, noise_range: tuple[float, float]) -> tuple[float, Array]:
        """The likeliest point from a first one on, and how likely it is.

        Axes share all numbers but their stds, all of which one difference moves.
        """
        shared, unit, harmonics = len(first) - self.axes, np.ones(len(first)), self.harmonics(first[0])
        unit[0] = 0.25 / self.span
        probes = PROBE * block_diag(np.eye(shared), np.ones(self.axes))

        def fall(x: Array) -> tuple[float, Array]:
            value = self.likelihoods(np.concatenate([x[None], x + probes]) * unit, harmonics)
            rise = (value[1:] - value[0]) / PROBE
            return -float(value[0].sum()), -np.concatenate([rise[:shared].sum(1), rise[shared]])

        louder = np.log(noise_range) - np.log([self.start.noise.min(), self.start.noise.max()])
        bounds = [
            first[0] + np.array([-1.0, 1.0]) / self.span,
            (np.log(COHERENT / self.span), np.log(first[0])),
            (min(louder[0], 0.0), max(louder[1], 0.0)),
            (-np.log(harmonics), np.log(2 * np.pi)),  # of the phase: all harmonics alike, or next to none
            *[(-np.inf, np.inf)] * self.axes,
        ]
        low, high = np.array(bounds).T / unit
        found = minimize(fall, first / unit, jac=True, method="L-BFGS-B", bounds=Bounds(low, high))
        return -float(found.fun), found.x * unit


def tune_periodic(
    time: Array,
    z: Array,
    gain: float,
    noise_var: Array,
    drift: Array,
    noise_range: tuple[float, float] = (1.0, 1.0),
    orders: tuple[int, ...] = ORDERS,
    lines: tuple[Line, ...] = (),
    engine: Engine | None = None,
    near: Tuned | None = None,
    color: Color | None = None,
    pieces: Pieces | None = None,
) -> Tuned:
    """Quasi-periodic prior of the loads that drive channels z'' = gain * load, by maximum likelihood.

    All as in `tune_loads`, from whose Matern prior the search begins; that one it stays where no periodic one
    is e^PATIENCE as likely, or the load comes in pieces.
    """
    if pieces is None and near is not None and isinstance(near.kernel, Periodic):
        start = near
    else:
        seen = time, z, gain, noise_var, drift, noise_range
        start = tune_loads(*seen, orders, lines, engine, near, color, pieces)
    if pieces is not None:
        return start
    search = BeatSearch(runs_of(time, z, noise_var), gain, drift, lines, start, for_tuning(engine))
    if isinstance(known := start.kernel, Periodic):
        sizes = np.log([known.length, *known.std])
        first, least = [np.array([known.frequency, np.log(known.decay), 0.0, *sizes])], -np.inf
    else:
        sizes = np.array([0.0, *np.log(known.std)])
        first = [np.array([f, np.log(np.pi / search.span), 0.0, *sizes]) for f in search.beats()]
        least = start.log_likelihood + PATIENCE
    if not first:
        return start
    likeliest = max(first, key=lambda p: float(search.likelihoods(p[None], search.harmonics(p[0])).sum()))
    best, at = search.climbed(likeliest, noise_range)
    if not best > least:
        return start
    decay, level, length = np.exp(at[1 : -search.axes]).tolist()
    kernel = Periodic(np.exp(at[-search.axes :]), float(at[0]), decay, length, search.harmonics(at[0]))
    noise = start.noise * level
    at_limit = noise_range[1] > noise_range[0] and np.mean(np.log(noise / noise_range[0]) < AT_LIMIT) > 0.5
    return Tuned(kernel, noise, bool(at_limit), best)
