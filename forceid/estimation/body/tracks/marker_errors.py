"""The errors of markers as what no motion of the body makes shows them: their size, their color, and when.

n markers have 3n - 6 - m numbers a sample that neither the pose nor m shapes move. Errors alike and
independent between markers have one spectrum in all of these numbers, and in every coordinate of a marker
(the likelihood of Whittle 1953). Where some frames are louder, the variance of a frame is drawn from an
inverse gamma distribution, so its numbers are those of Student's t (Lange, Little and Taylor, J. Am. Stat.
Assoc. 84 (1989) 881). Source: theory of one model, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, ndtri

from forceid.flight.color import Color, Colored, LowPassed, autocorrelation
from forceid.kalman.tuning.robust import runs
from forceid.records import Array
from forceid.rounding import SINGLE
from forceid.significance import CHANCE, HANN, NUMBER, PATIENCE, SIGMAS, TENTH, WILD, WORSE

COLORS = (1, 2)  # orders of errors with a memory: walks
FILTERS = (2, 4)  # orders of filters at the source: Butterworth, both ways
CUTS = 96  # of filters that are tried: one from the next by less than its own uncertainty
NOTHING = TENTH**2  # of the density below its cut, that a filter lets pass where nothing is told any more
MEMORIES = 24  # of memory, from one over the record to half a turn a sample
WHITE = np.geomspace(
    TENTH**2, 1.0, 17
)  # shares of the variance that are white: nothing is known to less than a tenth
FINER = 1.5  # from one to the next of both, within which a second look is taken
TWICE_AS_NOISY = 1.25**2 - 1  # `sphericity` of markers of which a fifth are; of any other share, less
SPECTRAL = 16  # samples in a row from which a spectrum can be told
FREEDOMS = np.geomspace(1.0, 64.0, 13)  # of Student's t that are tried: beyond, it is as good as normal
SCALE_ROUNDS = 100  # of the scale by Newton at most: where most squares are small, it doubles in each


@dataclass(frozen=True)
class MarkerErrors:
    """Errors of a coordinate of a marker: standard deviation m, color (None: white), and how they are known.

    relative: standard error of their density where many frequencies show it, as a part of it; uneven: one
    where they are as large in all of the numbers, in the octave in which they differ most; kurtosis: 3 of
    normal ones; loud (time,): variance of a frame over the mean one, None where all are as loud.
    """

    std: float
    color: Colored | None
    relative: float
    uneven: float
    kurtosis: float
    loud: Array | None = None

    @property
    def alike(self) -> bool:
        """Whether they may be errors of markers, and are no motion that is larger in some of the numbers."""
        return self.uneven < WORSE

    def as_stated(self, std: float) -> bool:
        """Whether they may well be white ones of a stated standard deviation."""
        return (
            self.color is None
            and self.loud is None
            and abs(self.std**2 / std**2 - 1) < SIGMAS * self.relative
        )


def marker_errors(time: Array, y: Array) -> MarkerErrors | None:
    """Errors from the numbers y (time, freedom) m that no motion makes, NaN in frames that are not whole.

    From the longest run of whole frames, or from all of these where it holds less than half of them. None
    where there are too few.
    """
    whole = np.asarray(np.isfinite(y).all(1))
    first, length = max(runs(whole), key=lambda run: run[1], default=(0, 0))
    row = np.arange(first, first + length)
    if 2 * length < whole.sum():  # lost here and there: the others in a row err as fast on the mean
        row = np.flatnonzero(whole)
    if not y.shape[1] or len(row) < SPECTRAL:
        return None
    y = y - np.median(y[row], 0)
    each = loudness(y)
    loud = None if each is None else each / each[whole].mean()
    y = y[row] if loud is None else (y / np.sqrt(loud)[:, None])[row]
    n, step = len(y), float(np.ptp(time[row])) / (len(y) - 1)
    kurtosis = float((y**4).mean() / max(float((y**2).mean()) ** 2, np.finfo(float).tiny))
    usual = max(float(np.quantile(np.abs(y), 0.9)) / 1.645, np.finfo(float).tiny)  # as of a normal deviate
    y = np.clip(y, -WILD * usual, WILD * usual)
    taper = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    taper /= np.sqrt((taper**2).sum())
    waves = np.fft.rfft((y - taper @ y / taper.sum()) * taper[:, None], axis=0)[2:-1]
    count, mean = HANN * y.shape[1], (np.abs(waves) ** 2).mean(1)

    def likelihood(shape: Array) -> tuple[Array, Array]:
        """Log-likelihood (...) of errors whose spectra have a shape (..., bin), and their variance."""
        size = (mean / shape).mean(-1)
        return -count * (np.log(shape).sum(-1) + len(mean) * (np.log(size) + 1)), size

    white, size = likelihood(np.ones(len(mean)))
    found: Colored | None = None
    best, std, spectrum = float(white) + PATIENCE, float(np.sqrt(size)), np.ones(len(mean))
    lag, shown = np.asarray(step * np.arange(n), float), window(taper)
    for order in COLORS:
        rates, whites = np.geomspace(1 / (n * step), np.pi / step, MEMORIES), WHITE
        for _ in range(2):  # the second time about the best of the first
            colored = tapered_spectrum(autocorrelation(order, rates[:, None], lag), shown)[:, 2:-1]
            value, size = likelihood(whites[:, None, None] + (1 - whites[:, None, None]) * colored)
            i, j = np.unravel_index(int(value.argmax()), value.shape)
            top, var_found, rate, part = (
                float(value[i, j]),
                float(size[i, j]),
                float(rates[j]),
                float(whites[i]),
            )
            shape = (1 - part) * colored[j] + part
            rates = rate * FINER ** np.linspace(-1, 1, 9)
            whites = np.clip(part * FINER ** np.linspace(-1, 1, 9), WHITE[0], 1.0)
        if top > best:
            best, std, spectrum = top, float(np.sqrt(var_found)), shape
            found = Color(order, rate, 1 - part, step)
    filtered = low_passed(mean, count, step)
    if filtered is not None and filtered[0] > best:
        _, found, shape = filtered
        told = shape > TENTH
        spectrum, waves, std = shape[told], waves[told], float(np.sqrt(mean.mean()))
    uneven = unevenness(waves / np.sqrt(spectrum)[:, None])
    return MarkerErrors(std, found, float(np.sqrt(2 / (n * count))), uneven, kurtosis, loud)


def low_passed(mean: Array, count: float, step: float) -> tuple[float, LowPassed, Array] | None:
    """The likeliest filter at the source of errors whose spectrum has means (bin,) over `count` numbers.

    Its log-likelihood, less a number for every ordinate of which the filter leaves nothing, as those are what
    they are; and the power (bin,) that it lets pass. None where more is left there than a tenth.
    """
    f = (np.arange(len(mean)) + 2) / (len(mean) + 2) / 2 / step
    if len(f) <= SPECTRAL or mean[-SPECTRAL // 4 :].mean() > TENTH * mean.max():
        return None
    best: tuple[float, LowPassed, Array] | None = None
    for order in FILTERS:
        for cut in np.geomspace(f[SPECTRAL // 2], f[-1], CUTS):
            color = LowPassed(order, float(cut), step)
            shape = color.power(f)
            told = shape > NOTHING
            level = float((mean[told] / shape[told]).mean(where=shape[told] > 0.5))
            left = np.maximum(mean[~told], np.finfo(float).tiny)
            if told.all() or left.mean() > NOTHING * level:  # more than the filter lets pass
                continue
            expected = level * shape[told]
            misfit = (np.log(expected) + mean[told] / expected).sum() + (np.log(left) + 1).sum()
            value = -count * float(misfit) - NUMBER * len(left)
            if best is None or value > best[0]:
                best = value, color, shape
    return best


def unevenness(waves: NDArray[np.complexfloating[Any, Any]]) -> float:
    """How uneven variances along the axes of waves (bin, freedom) are in their most uneven octave, over all.

    As the root mean square of variances over their mean. One where errors that have one shape at all
    frequencies are as uneven in more than a share CHANCE of records. Markers of which some are noisier than
    others are so in every octave, a motion is not. Source: the test of sphericity, John (1971), as Ledoit and
    Wolf (2002) have it for more numbers than samples.
    """
    octaves = SPECTRAL * 2 ** np.arange(max(int(np.log2(len(waves) / SPECTRAL)), 0))
    parts = [part for part in np.split(waves, octaves) if len(part)]
    apart, off = np.transpose([sphericity(part) for part in parts])
    off *= ndtri(1 - CHANCE / len(parts))
    most = TWICE_AS_NOISY if len(parts) > 1 else 0.0  # of the markers, where all octaves bear it out
    own = float(np.clip((apart + off * (1 + np.maximum(apart, 0.0))).min(), 0.0, most))
    return float(np.sqrt((1 + apart) / (1 + own)).max(where=apart - own > off * (1 + own), initial=1.0))


def sphericity(waves: NDArray[np.complexfloating[Any, Any]]) -> tuple[float, float]:
    """Variance of the variances along the axes of waves (bin, freedom), over their mean squared.

    And its standard deviation where they are alike; where they are not, that is 1 + variance times as large.
    """
    m, dof = waves.shape[1], 2 * HANN * len(waves)
    both = np.concatenate([waves.real, waves.imag])
    trace, products = float((both**2).sum()), both @ both.T if len(both) < m else both.T @ both
    if not trace > 0:
        return np.inf, 0.0
    apart = m * float((products**2).sum()) / trace**2 - 1
    return (dof * apart - (m + 1)) / (dof + 1), 2 / dof


def tapered_spectrum(correlation: Array, shown: Array) -> Array:
    """Expected spectrum (..., bin) of tapered samples with correlations (..., lag); shown (lag,): by it."""
    g = correlation * shown
    g = g + np.concatenate([np.zeros((*g.shape[:-1], 1)), g[..., :0:-1]], -1)
    return np.maximum(np.fft.rfft(g, axis=-1).real, np.finfo(float).eps)


def window(taper: Array) -> Array:
    """What a taper (time,) shows of covariances (lag,): the sums of its products at each lag."""
    n = len(taper)
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(taper, 2 * n)) ** 2, 2 * n)[:n])


def loudness(y: Array) -> Array | None:
    """Variance (time,) of the errors of every frame, from numbers y (time, number), NaN in frames not whole.

    There it is the mean. None unless frames of which some are louder are e^PATIENCE times as likely.

    >>> rng = np.random.default_rng(0)
    >>> y = rng.standard_normal((300, 12))
    >>> loudness(y) is None
    True
    >>> y[::10] *= 4
    >>> found = loudness(y)
    >>> (found[::10] > 3 * found[1::10]).all()
    np.True_
    """
    whole = np.asarray(np.isfinite(y).all(1))
    square, d = (y[whole] ** 2).sum(1), y.shape[1]
    if not len(square) or not square.all():
        return None
    mean, nu = float(square.mean()) / d, FREEDOMS
    each = np.full(len(nu), 1 / mean)  # scale of the squares under each: Newton's steps come from below
    for _ in range(SCALE_ROUNDS):
        part = square * each[:, None] / (nu[:, None] + square * each[:, None])
        step = (d / (nu + d) - part.mean(1)) / (part * (1 - part)).mean(1)
        each *= 1 + step
        if not step.max() > SINGLE:
            break
    logs = np.log1p(square * (each / nu)[:, None]).sum(1)
    one = gammaln(0.5 * (nu + d)) - gammaln(0.5 * nu) - 0.5 * d * np.log(np.pi * nu / each)
    value = len(square) * one - 0.5 * (nu + d) * logs
    if not value.max() > PATIENCE - 0.5 * d * len(square) * (np.log(2 * np.pi * mean) + 1):
        return None
    at = int(value.argmax())
    found = (nu[at] / each[at] + square) / (nu[at] + d - 2)
    out = np.full(len(y), found.mean())
    out[whole] = found
    return out
