"""How likely spectra of what frames show make elastic modes and the loads on them, and where that is most.

The modes are oscillators of known frequency, damped a little, under loads of which each gets a share. Source:
likelihood by Whittle (1953), steps by Fisher's information.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from scipy.linalg import block_diag

from forceid.compiled import engine as compiled
from forceid.flight.channels import CHANNEL_SAMPLES, middle
from forceid.kalman.building.process import matern_density
from forceid.kalman.tuning.search import ENOUGH, uphill
from forceid.records import Array, Indices
from forceid.rounding import SOLVED
from forceid.significance import HANN, SIGMAS, TENTH

UNEVEN = 0.48  # of a logarithm, one standard deviation: of what a load at one node does to modes, chi of 3
DAMPING = 0.02  # of the critical one, while spectra are looked at
FIRST_SIZES = (0.01, 0.1, 1.0)  # of loads, over those that would move the modes as far as steady ones
FIRST_RATES = (0.02, 0.2, 1.0)  # at which loads forget, over the lowest frequency
WIDEST = 12.0  # of a logarithm: how far the size of loads may be from where its search begins
OWN_BINS = 128  # lowest frequencies looked at one by one; beyond, as many together as keeps the octaves alike
OFF_PROMISE = 0.5  # of its promise: a step off by more shows that second slopes are not as in the mean
FISHER_STEPS = 100  # of a search: each doubles the digits but where shares come to their bounds


@dataclass(frozen=True)
class Elastic:
    """Elastic modes of unit shapes: frequency (mode,) rad/s, damping (mode,) over critical, None if unknown.

    size (mode,) 1/sqrt(kg): norm of the shape of unit modal mass, so mass = 1 / size^2; told (mode,): norm of
    the shape that forces are told on; detuned (mode,): about how far the logarithm of a frequency is off, as
    the pull of a spin tightens the body.
    """

    frequency: Array
    damping: Array | None
    size: Array
    told: Array
    detuned: Array


@dataclass(frozen=True)
class Spectra:
    """Cross spectra (band, channel, channel) of channels = rows q + noise of unit variance.

    count (band,): frequencies in each; frequency (bin,) rad/s, band (bin,) of each; step s of the clock;
    span s of the record.
    """

    power: Array
    count: Array
    frequency: Array
    band: Indices
    rows: Array
    step: float
    span: float

    def over_bands(self, density: Array) -> Array:
        """Means (band, ...) of a density (bin, ...) over the frequencies of each band."""
        first = np.flatnonzero(np.diff(self.band, prepend=-1))
        return np.asarray(np.add.reduceat(density, first, axis=0) / self.count[:, None])

    def misfit(self, p: Array, moves: Array) -> tuple[float, Array, Array]:
        """Minus the log-likelihood of modes with densities p (band, mode), its slope (way, mode) where that
        of a mode moves by moves (band, way, mode), and what its second slopes are in the mean, of Fisher's
        information (way, mode, way, mode).
        """
        count = HANN * self.count
        if compiled is not None:
            value, slope, bend = compiled.misfit(self.rows, self.power, p, count, moves)
            return float(value[0]), slope, bend
        D = self.rows
        S = np.eye(len(D)) + (D * p[:, None]) @ D.T
        inverse = np.linalg.inv(S)
        left = inverse @ (self.power @ inverse)
        each = np.linalg.slogdet(S)[1] + np.einsum("bij,bji->b", inverse, self.power)
        by_p = count[:, None] * (D * ((inverse - left) @ D)).sum(1)
        square = count[:, None, None] * (D.T @ inverse @ D) ** 2
        bend = np.einsum("bik,bkl,bjl->ikjl", moves, square, moves, optimize=True)
        return float(count @ each), np.einsum("bik,bk->ik", moves, by_p), bend


def spectra_of(time: Array, observed: Array, rows: Array) -> Spectra | None:
    """Spectra of observed (time, mode) = rows q + unit noise, rows (time, mode, mode), from tapered samples.

    None where too few frames do. Frames that show less than the best are left out: an uneven clock and gaps
    cost accuracy, and no interpolation.
    """
    part = middle(len(time), CHANNEL_SAMPLES)
    time, observed, rows = time[part], observed[part], rows[part]
    seen = np.isfinite(observed).any(1)
    observed = np.nan_to_num(observed)  # where a frame has no further number its row is zero
    if seen.sum() < 8:
        return None
    best = rows[seen][np.einsum("tij,tij->t", rows[seen], rows[seen]).argmax()]
    seen &= np.linalg.norm(rows - best, axis=(1, 2)) < TENTH * np.linalg.norm(best)
    shown = np.linalg.norm(best, axis=1) > SOLVED * np.linalg.norm(best)
    best, t, y = best[shown], time[seen], observed[seen][:, shown]
    span, step = float(np.ptp(time)), float(np.median(np.diff(time)))
    taper = np.sin(np.pi * (t - time[0] + 0.5 * step) / (span + step)) ** 2
    taper /= np.sqrt((taper**2).sum())
    y = y - (taper @ y) / taper.sum()
    # below, the mean that was taken out
    w = np.arange(1, int(0.5 * span / step)) * (2 * np.pi / span)
    if not len(w) or not len(best):
        return None
    Y = np.exp(-1j * np.outer(w, t - time[0])) @ (taper[:, None] * y)
    octave = OWN_BINS * (1 + np.log(np.maximum(np.arange(len(w)) / OWN_BINS, 1.0)))
    together = np.minimum(np.arange(len(w)), octave.astype(int))
    band: Indices = np.unique(together, return_inverse=True)[1].astype(np.intp)
    power = np.zeros((band[-1] + 1, len(best), len(best)))
    np.add.at(power, band, np.einsum("fi,fj->fij", Y, Y.conj()).real)
    count = np.bincount(band).astype(float)
    return Spectra(power / count[:, None, None], count, np.asarray(w, float), band, best, step, span)


def searched(
    spectra: Spectra, elastic: Elastic, order: int, near: Array | None = None
) -> tuple[float, Array]:
    """The least value of `unlikeliness` at an order, and where; near: a point not far from it, if known."""
    modes, lowest = len(elastic.frequency), float(elastic.frequency.min())
    value = partial(unlikeliness, spectra, elastic, order)
    seen = np.linalg.norm(spectra.rows, axis=0) * elastic.size / elastic.frequency**2
    power = float(np.einsum("bii,b->", spectra.power, spectra.count))
    still = float(np.sqrt(2 * power * spectra.step / spectra.span))
    size = still / max(float(np.linalg.norm(seen)), np.finfo(float).tiny)
    fastest, slowest = 0.5 * np.pi / spectra.step, 1 / spectra.span
    starts = [
        np.log([size * s, np.clip(rate * lowest, slowest, fastest)])
        for s, rate in product(FIRST_SIZES, FIRST_RATES)
    ]
    starts = [np.concatenate([at, np.zeros(2 * modes)]) for at in starts]
    first = min(starts, key=lambda at: value(at)[0]) if near is None else near
    edge = np.array([WIDEST, np.inf, *[SIGMAS] * (2 * modes)])
    low, high = (np.append(first[0], np.zeros(2 * modes + 1)) + side * edge for side in (-1, 1))
    low[1], high[1] = np.log(slowest), np.log(fastest)
    return scored(value, first, low, high)


def scored(
    value: Callable[[Array], tuple[float, Array, Array]], at: Array, low: Array, high: Array
) -> tuple[float, Array]:
    """The least of a value between bounds, and where, by Fisher's steps from a point.

    value: with its slope, and its second slopes in the mean. A step is halved until it keeps a part of its
    promise. From the first on that keeps far from all of it, second slopes are those in the mean with what
    slopes have shown since (Broyden, Fletcher, Goldfarb and Shanno, 1970).
    """
    (here, slope, bend), learns = value(at), False
    for _ in range(FISHER_STEPS if np.isfinite(here) else 0):
        step = uphill(-slope, -bend, low - at, high - at)
        promise = -0.5 * float(slope @ step)  # of a quadratic
        while promise > ENOUGH and not (gain := here - (found := value(at + step))[0]) > TENTH * promise:
            step, promise = step / 2, promise / 2
        if not promise > ENOUGH:
            break
        learns = learns or abs(gain / promise - 1) > OFF_PROMISE
        next_bend = with_slopes(bend, step, found[1] - slope) if learns else found[2]
        at, (here, slope, _), bend = at + step, found, next_bend
    return here, at


def with_slopes(bend: Array, step: Array, change: Array) -> Array:
    """Second slopes that make the slope change as it did along a step, where it rose."""
    rise, along = float(step @ change), bend @ step
    if rise <= 0:
        return bend
    return bend + np.outer(change, change) / rise - np.outer(along, along) / float(step @ along)


def unlikeliness(spectra: Spectra, elastic: Elastic, order: int, at: Array) -> tuple[float, Array, Array]:
    """Minus the logarithm of Whittle's likelihood and of the prior of the shares, its slope, and what its
    second slopes are in the mean (Fisher's information).

    at (2 + 2 mode,): logarithms of the size of the loads on unit modal mass and of their rate; of the share
    of each mode, and of what its frequency is off by, in standard deviations.
    """
    size, rate = np.exp(at[:2])
    shares, off = at[2:].reshape(2, -1)
    w, own = spectra.frequency[:, None], elastic.frequency * np.exp(elastic.detuned * off)
    # no mode is sharper than the record shows: its width is added to what damping makes
    width = own * (DAMPING if elastic.damping is None else elastic.damping) + np.pi / spectra.span
    gain = 1 / ((own**2 - w**2) ** 2 + (2 * width * w) ** 2)
    load = (size * elastic.size * np.exp(UNEVEN * shares)) ** 2
    density = load * gain * matern_density(order, 1.0, rate, w) / spectra.step
    by_rate = (2 * order - 1) - 2 * order * rate**2 / (rate**2 + w**2)
    by_own = (
        -4 * own * gain * (own * (own**2 - w**2) + 2 * (width - np.pi / spectra.span) * width * w**2 / own)
    )
    means = spectra.over_bands(np.concatenate([density, density * by_rate, density * by_own], 1))
    p, p_by_rate, p_by_own = np.split(means, 3, axis=1)
    moves = np.stack([2 * p, p_by_rate, elastic.detuned * p_by_own], 1)
    value, slope, bend = spectra.misfit(np.ascontiguousarray(p), moves)
    one, own_mode = np.ones((1, len(shares))), np.eye(len(shares))
    # what each number moves: all modes by their size, all by the rate, and each by its share and frequency
    every = block_diag(np.concatenate([one, UNEVEN * own_mode]), one, own_mode)
    every = every[[0, len(shares) + 1, *range(1, len(shares) + 1), *range(len(shares) + 2, len(every))]]
    slope, bend = every @ slope.ravel(), every @ bend.reshape(every.shape[1], -1) @ every.T
    slope[2:] += at[2:]
    bend[2:, 2:] += np.eye(len(at) - 2)
    return value + 0.5 * float(at[2:] @ at[2:]), slope, bend
