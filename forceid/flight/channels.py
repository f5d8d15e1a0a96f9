"""Channels that loads drive, z'' = gain * load: their model, and what a record of them shows of the load."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from forceid.flight.color import Color
from forceid.flight.pieces import Pieces, drawn, forms_over, split_in_a_row
from forceid.kalman.building.clock import discretize_steps
from forceid.kalman.building.process import Process, superpose
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.rounding import SINGLE

CHANNEL_SAMPLES = 2048  # that a search on channels looks at, or a mean over a record: known to 2 %
MEAN = 2  # state of a chain that is the mean of its load; those of the kernel follow
FLIGHT_SAMPLES = 400  # that a search on a whole flight looks at, as each try filters all its states: to 5 %


@dataclass(frozen=True)
class Start:
    """Variances at the start, as good as unknown: of the load's second and first integral, of its mean."""

    second: float
    first: float
    mean: float


def start_of(time: Array, z: Array, gain: float) -> Start:
    """Start of channels z (time, axis), z'' = gain * load, that begin near zero."""
    seen = np.isfinite(z).all(1)
    t, span = time[seen], np.ptp(time[seen])
    size = np.abs(z[seen]).max(initial=0.0) / gain or 1.0  # a record of zeros has no scale: any will do
    speed = np.abs(np.diff(z[seen], axis=0) / np.diff(t)[:, None]).max(initial=0.0) / gain or size / span
    return Start((10 * size) ** 2, (10 * speed) ** 2, (10 * speed / span) ** 2)


@dataclass(frozen=True)
class Channel:
    """Three measured channels (world axes) that one load drives: z'' = gain * load.

    time (time,) s; z (time, 3), NaN = missing; gain: 1/kg for a force and a mass center; noise_cov (time,
    3, 3) of z; drift (3, 3): covariance per second of the part of the noise that adds up; color: of the
    noise, None for white.
    """

    time: Array
    z: Array
    gain: float
    noise_cov: Array
    drift: Array
    color: Color | None = None

    @property
    def moved(self) -> Array:
        """Z about its first sample."""
        return np.asarray(self.z - self.z[np.isfinite(self.z).all(1)][0])

    def var(self, axes: Array) -> Array:
        """Noise variance (time, axis) along axes given as columns."""
        return np.asarray(((axes.T @ self.noise_cov) * axes.T).sum(-1))


def load_chain(load: Process, start: Start, lines: Sequence[Process] = ()) -> Process:
    """States (Y, H, mean, those of the load, lines) of a load: Y' = H, H' = mean + load + lines."""
    still = np.zeros((MEAN + 1, MEAN + 1))
    constants = Process(still, still, np.diag([start.second, start.first, start.mean]), np.ones(MEAN + 1))
    joint = superpose(constants, load, *lines)
    joint.A[..., 0, 1], joint.A[..., 1, MEAN:] = 1.0, joint.output[MEAN:]
    return replace(joint, output=np.eye(len(joint.output))[0])


def driven(
    chain: Process, gain: float, noise_var: Array, drift: Array, step: Array, color: Color | None = None
) -> StateSpace:
    """Channels z with z'' = gain * load: one scalar model per chain in `chain`.

    noise_var (time, model) of z; drift (model,): variance per second of the part of the noise that adds up;
    step (time - 1,) s; color: of the noise, of which the least variance has the memory in all.
    """
    chain, noise_var = colored(chain, gain, noise_var, color)
    # equal steps share their matrices: a regular clock has one
    unique, which = np.unique(np.round(step, 12), return_inverse=True)
    if shared := 2 * len(unique) < len(step):
        step = unique
    F, Q = discretize_steps(chain, step)
    Q[..., 0, 0] += drift * step[:, None]
    if shared and len(unique) > 1:
        F, Q = F[which], Q[which]
    H = gain * chain.output[None, None, None]
    return StateSpace(F, Q, H, noise_var[..., None, None], np.zeros(chain.P0.shape[:-1]), chain.P0)


def model_in_pieces(
    chain: Callable[[float], Process],
    gain: float,
    noise_var: Array,
    drift: Array,
    time: Array,
    order: int,
    color: Color | None = None,
) -> Callable[[Sequence[Pieces]], StateSpace]:
    """The same of loads that come in pieces: as many models for each of those tried, one try after another.

    chain: of a load of size one throughout, by a factor on its rate; order: states of its kernel; time
    (time,) s.
    """
    step = np.diff(time)
    plain, white = colored(chain(1.0), gain, noise_var, color)
    at = np.arange(len(plain.output))
    states = at == MEAN, (at > MEAN) & (at <= MEAN + order)
    over = forms_over(lambda haste: colored(chain(haste), gain, noise_var, color)[0], states[1], step)

    def model(tried: Sequence[Pieces]) -> StateSpace:
        split = split_in_a_row(tried, step, float(time[0]))
        forms = over(tried, split)
        forms.Q[..., 0, 0] += drift * forms.duration[:, None]
        size = np.repeat(np.concatenate([one.size for one in tried])[..., None], len(at), -1)
        F, Q, kind, P0 = drawn(forms, size, states, split)
        axes = F.shape[1]
        kind = (axes * kind.T[:, :, None] + np.arange(axes)).reshape(len(step), -1)
        F, Q, P0 = (a.reshape(-1, *a.shape[2:]) for a in (F, Q, P0))
        R = np.tile(white, len(tried))[..., None, None]
        output = gain * plain.output[None, None, None]
        return StateSpace(F, Q, output, R, np.zeros(P0.shape[:-1]), P0, kind=kind)

    return model


def colored(chain: Process, gain: float, noise_var: Array, color: Color | None) -> tuple[Process, Array]:
    """A chain beside what has a memory of the noise of its channel, and the variance that is white."""
    if color is None:
        return chain, noise_var
    held, white = color.parts(noise_var)
    return superpose(chain, color.process(held / gain**2)), white


def on_clock(time: Array, *rows: Array) -> tuple[Array, ...]:
    """Every tick of a regular clock, frames of which are gone, and rows (time, ...), NaN where they are.

    As given on an irregular clock, or with fewer frames left than gone. Equal steps share their
    matrices: with NaN in its gaps a regular clock has one.

    >>> [a.tolist() for a in on_clock(np.array([0.0, 1.0, 3.0]), np.array([5.0, 6.0, 8.0]))]
    [[0.0, 1.0, 2.0, 3.0], [5.0, 6.0, nan, 8.0]]
    """
    step = np.diff(time)
    if len(step) < 2 or not (time[-1] - time[0]) / step.min() < 2 * len(time):
        return (time, *rows)
    tick = np.round((time - time[0]) / step.min()).astype(int)
    regular = np.linspace(time[0], time[-1], tick[-1] + 1)
    if not len(time) <= tick[-1] < 2 * len(time) or np.abs(regular[tick] - time).max() > SINGLE * step.min():
        return (time, *rows)
    wide = tuple(np.full((len(regular), *row.shape[1:]), np.nan) for row in rows)
    for out, row in zip(wide, rows, strict=True):
        out[tick] = row
    return (regular, *wide)


def tuning_segments(z: Array) -> list[slice]:
    """Stretches of a record (time, axis) that tuning looks at, each with enough samples present."""
    n = len(z)
    quarters = [slice(0, n)]
    if n > CHANNEL_SAMPLES:
        quarter = CHANNEL_SAMPLES // 4
        quarters = [slice(a, a + quarter) for a in np.linspace(0, n - quarter, 4).astype(int)]
    enough = [s for s in quarters if np.isfinite(z[s]).all(1).sum() >= 8]
    return enough or [slice(0, n)]


def runs_of(time: Array, z: Array, noise_var: Array) -> list[tuple[Array, Array, Array]]:
    """Those stretches by themselves: times, z about the first sample, and the variance of its noise."""
    runs = []
    for run in tuning_segments(z):
        t, y, var = on_clock(time[run], z[run] - z[run][np.isfinite(z[run]).all(1)][0], noise_var[run])
        runs.append((t, y, np.where(np.isfinite(var), var, 1.0)))
    return runs


def middle(samples: int, most: int = CHANNEL_SAMPLES) -> slice:
    """The middle of a record, of at most so many samples."""
    first = max((samples - most) // 2, 0)
    return slice(first, min(first + most, samples))


def second_difference(time: Array, z: Array, lag: int) -> Array:
    """Second divided difference (sample, axis) of z over `lag` samples either way; NaN at gaps."""
    ahead = (z[2 * lag :] - z[lag:-lag]) / (time[2 * lag :] - time[lag:-lag])[:, None]
    behind = (z[lag:-lag] - z[: -2 * lag]) / (time[lag:-lag] - time[: -2 * lag])[:, None]
    d = 2 * (ahead - behind) / (time[2 * lag :] - time[: -2 * lag])[:, None]
    return d[np.isfinite(d).all(1)]


def search_box(time: Array, z: Array, gain: float, order: int) -> tuple[Array, Array]:
    """Smallest and largest search point (2,) worth a look, from second differences at many lags.

    The first is a load that no record shows; a rate beyond half a turn a sample would pass noise for load.
    """
    sizes = [np.sqrt(np.mean(d**2)) / gain for lag in lags(z) if len(d := second_difference(time, z, lag))]
    rate = np.log([1.0 / (time[-1] - time[0]), 0.5 / np.median(np.diff(time))])
    high = 10 * max(sizes, default=0.0) or 1.0  # a record of zeros has no scale: any will do
    low = max(1e-3 * min(sizes, default=0.0), 1e-9 * high)
    corner = np.array([np.log(low), np.log(high)]) + (order - 0.5) * rate
    return np.array([corner[0], rate[0]]), np.array([corner[1], rate[1]])


def load_axes(time: Array, z: Array) -> Array:
    """Orthogonal axes (columns) along which the second derivative of z (time, 3) varies independently.

    Equal white noise on all axes does not turn them. They turn with the data, so that estimates do not
    depend on the frame. Taken at the lag where they stand out most.
    """
    best, axes = -1.0, np.eye(3)
    for lag in lags(z):
        d = second_difference(time, z, lag)
        if len(d) < 3:
            continue
        size, turned = np.linalg.eigh(d.T @ d / len(d))
        clear = (size[-1] - size[0]) / max(size.mean(), 1e-300) * np.sqrt(len(d) / lag)
        if clear > best:
            best, axes = clear, turned
    return np.asarray(axes * np.sign(np.linalg.det(axes)))


def lags(z: Array) -> list[int]:
    """Lags in samples, doubling, that a third of the record holds."""
    return [2**i for i in range(int(np.log2(max(len(z) // 3, 1))) + 1)]
