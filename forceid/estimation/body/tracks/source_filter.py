"""A low-pass that marker tracks went through at the source, both ways: found, and undone.

What turns is rigid no longer once its tracks went through a filter, and a filter takes motion away with the
noise. Of Butterworth's filters the one is sought under which the body is rigid again and its errors are
white: Whittle's likelihood (1953) of what no rigid motion makes, in which an ordinate that stands out is
motion, and is what it is. The recursions of a filter B(z) / A(z) are undone by A(z) A(1/z), sums of a few
neighbors that hold up to the ends. Left is B(z) B(1/z), a power of (1 + z)(1 + 1/z), which is one but near
half the rate, and is undone by its series. Source: theory of one model, section 3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import correlate1d
from scipy.optimize import minimize_scalar
from scipy.special import comb, polygamma

from forceid.flight.channels import CHANNEL_SAMPLES, FLIGHT_SAMPLES, middle
from forceid.flight.color import LowPassed
from forceid.kalman.tuning.robust import runs
from forceid.records import Array
from forceid.significance import MEDIAN, NUMBER, TENTH

BUTTERWORTH = (2, 3, 4)  # of Butterworth's filters: both ways, two and three fall as smoothing splines do
RESTORED = 0.2  # cycles a sample up to which tracks are restored: beyond, the series gets long
LEFT_OUT = TENTH**2  # of a motion at RESTORED that the series leaves
OVER_LATER = 10.0  # times the noise that came behind the filter: so much of what went through it tells of it
IN_A_ROW = 64  # samples in a row from which a filter can be told
CUTS_TRIED = 16  # first, from a few waves in the record to RESTORED
SHARP = 1e-3  # of a logarithm, to which a cut is found: a third of what a thousand samples tell
TAPERED = 6  # power of the sine that tapers: what a filter left stands beside motion 1e10 times as strong
ALONE = 0.3  # of the ordinates under that taper are independent
WITHIN_CHANCE = 1.5  # times that of chance, that ordinates may have under the right filter
WORTH = 1.1  # times a cut up to which tracks have to be restored
MOST_LOST = 16  # samples at either end that no order of filter needs more of


@dataclass(frozen=True)
class Fit:
    """A filter of an order and a cut (cycles a sample): how likely, and the noise m2 before it.

    spread: of the ordinates, over that by chance.
    """

    order: int
    cut: float
    likely: float
    spread: float
    noise: float


Rest = Callable[[Array, Array], Array]  # of tracks (time, node, 3) at times: (time, number) that is not rigid


def source_filter(
    time: Array, position: Array, rest: Rest, size: float = np.inf
) -> tuple[LowPassed, LowPassed] | None:
    """The filter that tracks (time, node, 3) went through, and what is left of it once it is undone.

    rest: what no rigid motion makes of tracks at some times; size: mean square m2 of a coordinate of the
    markers about their mean, of which errors are a tenth at most: once a filter slower than the true one is
    undone, anything looks like noise. None where no filter shows, or none that is worth undoing.
    """
    whole = np.asarray(np.isfinite(position).all((1, 2)))
    first, length = max(runs(whole), key=lambda run: run[1], default=(0, 0))
    inner = middle(length, CHANNEL_SAMPLES)
    t, x = (a[first : first + length][inner] for a in (time, position))
    step = np.diff(t)
    if len(t) < IN_A_ROW or np.ptp(step) > TENTH * step.min():
        return None
    f, power = spectrum(rest(t, x))
    behind = float(np.median(power[-IN_A_ROW // 4 :])) if power.size else np.inf
    hidden = np.flatnonzero(power <= OVER_LATER * behind)
    upto = min(float(f[hidden[0]]), RESTORED) if len(hidden) and hidden[0] else 0.0
    if (f < upto).sum() < IN_A_ROW // 4:
        return None

    def fitted(order: int, log_cut: float, part: slice = slice(None)) -> Fit:
        return fit(rest, t[part], x[part], order, float(np.exp(log_cut)), upto)

    logs = np.linspace(np.log(0.5 * f[0]), np.log(upto), CUTS_TRIED)
    first_look, fits = middle(len(t), FLIGHT_SAMPLES), []
    for order in BUTTERWORTH:
        tried = [fitted(order, log, first_look) for log in logs]
        at = int(np.argmax([fit.likely if fit.noise < TENTH * size else -np.inf for fit in tried]))
        beside = float(logs[max(at - 1, 0)]), float(logs[min(at + 1, CUTS_TRIED - 1)])
        found: Any = minimize_scalar(
            partial(lambda order, log: -fitted(order, log).likely, order), bounds=beside,
            options={"xatol": SHARP},
        )  # fmt: skip
        fits.append(fitted(order, float(found.x)))
    best = max(fits, key=lambda fit: fit.likely)
    if best.spread > WITHIN_CHANCE or upto < WORTH * best.cut or best.noise > TENTH * size:
        return None
    one = float(np.median(step))
    return LowPassed(best.order, best.cut / one, one), LowPassed(BUTTERWORTH[-1], upto / one, one)


def spectrum(y: Array) -> tuple[Array, Array]:
    """Cycles a sample (bin,) and mean power (bin,) of numbers y (time, number)."""
    n = len(y)
    taper = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** TAPERED
    taper /= np.sqrt((taper**2).sum())
    waves = np.fft.rfft((y - taper @ y / taper.sum()) * taper[:, None], axis=0)
    kept = slice(TAPERED, -1)
    return np.asarray(np.fft.rfftfreq(n)[kept], float), np.asarray(
        (np.abs(waves[kept]) ** 2).sum(1) / max(y.shape[1], 1)
    )


def fit(rest: Rest, time: Array, position: Array, order: int, cut: float, upto: float) -> Fit:
    """How well what no rigid motion makes is noise before a filter; half of the ordinates or more are.

    cut and upto: cycles a sample, of the filter, and to which ordinates are looked at.
    """
    weights, inner = undoing(order, cut), slice(MOST_LOST, len(time) - MOST_LOST)
    y = rest(time[inner], correlate1d(position, weights, axis=0)[inner])
    f, power = spectrum(y)
    f, power, numbers = f[f < upto], power[f < upto], y.shape[1]
    noise = float(np.median(power))
    ratio = np.maximum(power / noise, np.finfo(float).tiny)
    misfit = np.minimum(ratio, np.log(ratio) + 1 + NUMBER / (ALONE * numbers))
    misfit += np.log(noise) - 2 * np.log(np.abs(gain(weights, f)))
    off = np.median(np.abs(np.log(ratio))) / (MEDIAN * np.sqrt(polygamma(1, numbers)))
    return Fit(order, cut, -ALONE * numbers * float(misfit.sum()), float(off), noise)


def gain(weights: Array, f: Array) -> Array:
    """What symmetric weights of neighbors make of waves of f (...) cycles a sample."""
    lags = np.arange(len(weights)) - len(weights) // 2
    return np.asarray(np.cos(2 * np.pi * f[..., None] * lags) @ weights)


def undoing(order: int, cut: float, reach: int = MOST_LOST) -> Array:
    """Weights (2 lost + 1,) of neighbors that undo a filter run both ways; cut: cycles a sample.

    reach: neighbors on either side, at most; with fewer, what is near half the rate is undone less.

    >>> from scipy.signal import butter, sosfiltfilt
    >>> x = np.cumsum(np.random.default_rng(0).standard_normal(400))
    >>> slow = sosfiltfilt(butter(4, 2 * 0.1, output="sos"), x)  # as slow as it may be
    >>> filtered, weights = sosfiltfilt(butter(2, 2 * 0.06, output="sos"), slow), undoing(2, 0.06)
    >>> back, lost = np.correlate(filtered, weights, "valid"), len(weights) // 2
    >>> bool(np.abs(back - slow[lost:-lost]).max() < 0.01)
    True
    """
    from scipy.signal import butter  # takes long to load

    b, a = butter(order, 2 * cut)
    highest, share = np.sin(np.pi * RESTORED) ** 2, np.ones(1)
    while share[-1] > LEFT_OUT and len(share) <= reach - order:  # (1 - s)^-order, s = (2 - z - 1/z) / 4
        k = len(share)
        share = np.append(share, comb(order - 1 + k, k) * highest**k)
    total, term = np.zeros(1), np.ones(1)
    for k, weight in enumerate(share / highest ** np.arange(len(share))):
        total = weight * term + np.pad(total, 1 if k else 0)
        term = np.convolve(term, np.array([-0.25, 0.5, -0.25]))
    return np.asarray(np.convolve(np.convolve(a, a[::-1]) / (2**order * b[0]) ** 2, total))


def undone(position: Array, source: LowPassed, left: LowPassed) -> Array:
    """Tracks (time, node, 3) as before a filter, but for what is `left` of it; NaN at their very ends."""
    from scipy.signal import butter, sosfiltfilt  # takes long to load

    order, cut = source.order, source.cut * source.step
    weights = undoing(order, cut)
    shorter = {i: undoing(order, cut, i) for i in range(order, len(weights) // 2)}  # beside the ends
    smooth = partial(sosfiltfilt, butter(left.order, 2 * left.cut * left.step, output="sos"), axis=0)
    out = np.full_like(position, np.nan)
    for k in range(position.shape[1]):
        for first, length in runs(np.asarray(np.isfinite(position[:, k]).all(1))):
            if length < IN_A_ROW:
                continue
            track = position[first : first + length, k]
            restored = correlate1d(track, weights, axis=0)
            for i, near in shorter.items():
                restored[i] = near @ track[: 2 * i + 1]
                restored[length - 1 - i] = near @ track[length - 1 - 2 * i :]
            restored[order : length - order] = smooth(restored[order : length - order])
            told = slice(order + left.order, length - order - left.order)  # where both filters have neighbors
            out[first : first + length, k][told] = restored[told]
    return out
