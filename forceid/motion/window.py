"""How much to smooth: candidate windows of the classic routes, and the one that the data call for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import chdtri

from forceid.errors import EstimationError
from forceid.records import Array

Route = Literal["difference", "savgol", "spline"]
DEGREE = 5  # of the spline: its second derivative is a smooth cubic
ORDER = 6  # of the differences that tell noise from motion
THIRD = 1 / 3  # of a wave, from the shortest window to the next: more, and a second power tells half the bias
PILOT = 4.0  # variance of the pilot over that of the best window: quiet enough, and still less biased


@dataclass(frozen=True)
class Window:
    """How much a route smooths: `count` samples, which is `seconds`, with polynomials of degree `order`.

    count: difference, the lag; savgol, the samples on either side; spline, the samples a knot interval.
    """

    method: Route
    order: int
    count: int
    seconds: float

    @property
    def bias_power(self) -> int:
        """Power of the window's length that its bias of a second derivative grows with."""
        return 4 if self.order >= 4 else 2


@dataclass(frozen=True)
class WindowChoice:
    """The window chosen, its target (time, k), and the target's variance (time, k): noise and bias.

    bias_ratio: squared bias over noise variance, by which the variance exceeds that of the noise, as powers
    of the window tell it. resolved: whether they do, and the target does not change within the shortest one.
    compared: the window beside which it was judged; apart: how far both may be apart beyond noise, mean
    square over the noise variance of the target, with the standard error that noise leaves it.
    """

    window: Window
    target: Array
    variance: Array
    bias_ratio: float
    resolved: bool
    compared: Window
    apart: float


def windows(method: Route, time: Array) -> list[Window]:
    """Candidate windows, least smoothing first: each a tenth longer than the last, up to half the record.

    >>> [w.count for w in windows("difference", np.arange(30.0))]
    [1, 2, 3, 4, 5, 6, 7]
    """
    step = float(np.median(np.diff(time)))
    longest = max(len(time) // 4, 1)
    ladder = np.unique(np.round(1.1 ** np.arange(np.log(longest + 0.5) / np.log(1.1))).astype(int)).tolist()
    if method == "difference":
        return [Window(method, 2, h, h * step) for h in ladder]
    if method == "spline":
        return [Window(method, DEGREE, n, n * step) for n in ladder if n > 1]
    found = [Window(method, p, h, h * step) for p in (2, 4) for h in ladder if 2 * h >= p + 2]
    return sorted(found, key=lambda w: w.count if w.order == 2 else w.count / 1.65)  # by the noise they pass


def noise_variance(time: Array, z: Array) -> float:
    """Variance of white noise in one channel of a record z (time, channel), from its sixth differences.

    Divided differences of seven samples seen in a row, on any clock; the median over time, so bursts do not
    count; pooled over the channels, so turning the axes changes nothing. An upper bound where the
    motion is coarsely sampled: sixth differences of the motion count as noise.

    >>> z = 0.1 * np.random.default_rng(0).standard_normal((4000, 3))
    >>> round(noise_variance(np.arange(4000.0), z), 3)
    0.01
    """
    seen = np.isfinite(z).all(1)
    if seen.sum() < 2 * ORDER:
        raise EstimationError(
            f"shows {seen.sum()} complete samples, expected at least {2 * ORDER} to tell noise from motion",
            "record",
            "state noise_std",
        )
    t = sliding_window_view(time[seen], ORDER + 1)
    span = np.ptp(t, axis=1)
    near = span <= 1.5 * np.median(span)
    t = t[near] / np.median(span)
    gap = np.stack([np.prod(np.delete(t[:, [i]] - t, i, axis=1), axis=1) for i in range(ORDER + 1)], 1)
    w = 1 / gap
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    d = np.einsum("ti,tci->tc", w, sliding_window_view(z[seen], ORDER + 1, axis=0)[near])
    rounding = np.spacing(np.abs(z[seen]).max()) ** 2
    return float(max(np.median((d**2).sum(1)) / chdtri(z.shape[1], 0.5), rounding))


def noise_growth(time: Array, z: Array) -> float:
    """Factor by which the noise that `noise_variance` shows grows from every sample to every second one.

    z (time, channel). One for white noise that the record resolves; more where motion, or errors smoothed
    at the source, pass for it. NaN where the record is too short to tell, or stands still without any.

    >>> z = np.random.default_rng(0).standard_normal((4000, 3))
    >>> round(noise_growth(np.arange(4000.0), z), 1)
    1.0
    """
    if np.isfinite(z).all(1).sum() < 5 * ORDER:
        return float("nan")
    every, second = noise_variance(time, z), noise_variance(time[::2], z[::2])
    return float(np.sqrt(second / every)) if every else float("nan")


def choose_window(
    candidates: Sequence[Window], estimate: Callable[[Window], tuple[Array, Array]]
) -> WindowChoice:
    """The window of least mean squared error of a target, as far as the data tell.

    candidates: of one method, least smoothing first, as from `windows`. estimate(window) returns the target
    (time, k) and the variance (time, k) that the noise of the record gives it, NaN where there is none;
    the target may be any function of the record that is linear in its noise to first order.

    A shorter window, the pilot T_0, shows the bias of a longer one T_h: E|T_h - T_0|^2 = bias^2 + v_0 - v_h.
    The cross term is v_h because among unbiased combinations of the samples in its window T_h has the least
    noise (Gauss and Markov), so the pilot correlates with it as it does with itself. Squared bias plus v_h
    (Mallows 1973), weighted by 1/v and tapered over the outer eighths, is least at the window chosen.
    The pilot climbs, always a few times noisier than the best window so far: a much shorter one drowns
    the bias in its own noise. The variance returned includes the squared bias, in proportion to the
    noise variance, and no less of it than the best window has in theory.
    Raises EstimationError where no window fits the record.
    """

    @cache
    def at(i: int) -> tuple[Array, Array]:
        return estimate(candidates[i])

    def noise(i: int) -> float:
        v = at(i)[1].sum(1)
        return float(np.median(v[np.isfinite(v)])) if np.isfinite(v).any() else np.inf

    order = max((w.order for w in candidates), default=0)
    pilots = [i for i, w in enumerate(candidates) if w.order == order]
    first = next((i for i in pilots if noise(i) < np.inf), None)
    if first is None:
        raise EstimationError(
            "is too short, or too broken by gaps, for any window",
            "record",
            "use a longer record, or the smoother",
        )

    def shorter(best: int) -> int:
        fit = [i for i in pilots if candidates[i].count <= candidates[best].count]
        return max((i for i in fit if PILOT * noise(best) <= noise(i) < np.inf), default=first)

    def best_after(pilot: int, scale: int, only: int | None = None) -> tuple[int, float, float]:
        """Best candidate, or the only one, as the pilot sees it; squared bias over noise, standard error."""
        taper = smooth_taper(len(at(pilot)[0]))
        weight = taper / at(scale)[1].sum(1)
        risk: dict[int, float] = {}
        ratio: dict[int, float] = {}
        error: dict[int, float] = {}
        for i, w in enumerate(candidates):
            if w.count < candidates[pilot].count or only not in (None, i):
                continue
            (T, v), (T_0, v_0) = at(i), at(pilot)
            v_shared = shared_noise(w, candidates[pilot]) * v
            between = weight * (v_0 + v - 2 * v_shared).sum(1)
            bias2, own = weight * ((T - T_0) ** 2).sum(1) - between, weight * v.sum(1)
            known = np.isfinite(bias2)
            if not known.any():
                continue
            total = taper[known].sum()
            risk[i] = float((bias2[known].sum() + own[known].sum()) / total)
            ratio[i] = float(bias2[known].sum() / own[known].sum())
            error[i] = float(between[known].sum() / own[known].sum())
            error[i] *= error_of_square(taper * known, candidates[pilot], T.shape[1])
            if ratio[i] > 3 and risk[i] > 3 * min(risk.values()):
                break
        if not risk:  # no sample of both
            return pilot, 0.0, np.inf
        best = min(risk, key=risk.__getitem__)
        return best, ratio[best], error[best]

    pilot = -1
    best = higher = first
    while higher > pilot:
        pilot = higher
        best, *_ = best_after(pilot, best)
        higher = shorter(best)
    pilot = shorter(best)
    best, ratio, error = best_after(pilot, best)
    chosen, power, resolved = candidates[best], candidates[best].bias_power, True
    other, apart = pilot, max(ratio, 0.0)
    if chosen.order == order and chosen.count > candidates[pilot].count:
        ratio /= (1 - (candidates[pilot].count / chosen.count) ** power) ** 2  # the pilot has bias as well
    elif best == pilot and (longer := next((i for i in pilots if i > best), None)) is not None:
        # no shorter one shows its bias: from that of the next longer, whose powers are the same
        less = (chosen.count / candidates[longer].count) ** power
        other, apart, error = best_after(pilot, best, longer)
        apart = max(apart, 0.0)
        resolved = apart * noise(best) < THIRD**2 * float(np.nanmean((at(best)[0] ** 2).sum(1)))
        ratio = apart * (less / (1 - less)) ** 2
    ratio = max(ratio, 5 / (2 * power))  # noise falls as length^-5: what a minimum of their sum has
    target, variance = at(best)
    beside, allowed = candidates[other], apart + max(error, 0.0)
    return WindowChoice(chosen, target, variance * (1 + ratio), ratio, resolved, beside, allowed)


def shared_noise(window: Window, pilot: Window) -> float:
    """Covariance of a window's second derivative and the pilot's, over the variance of the window's own.

    One by Gauss and Markov; three-sample differences of two lags share their middle sample only.

    >>> shared_noise(Window("difference", 2, 3, 0.3), Window("difference", 2, 1, 0.1))
    6.0
    """
    if window.method == "difference" and window.count != pilot.count:
        return 2 / 3 * (window.count / pilot.count) ** 2
    return 1.0


def error_of_square(taper: Array, window: Window, axes: int) -> float:
    """Relative standard error of a mean square of noise under a taper (time,): a window has a number an axis.

    >>> round(error_of_square(np.ones(300), Window("savgol", 2, 7, 0.7), 1), 2)
    0.32
    """
    numbers = axes * taper.sum() ** 2 / (taper**2).sum() / (2 * window.count + 1)
    return float(np.sqrt(2 / numbers))


def smooth_taper(n: int) -> Array:
    """Weights (n,) that rise over the outer eighths: an edge would let the pilot's noise into the risk."""
    s = (np.arange(n) + 0.5) / n
    r = np.clip(8 * np.minimum(s, 1 - s), 0, 1)
    return np.asarray(r**4 * (35 - 84 * r + 70 * r**2 - 20 * r**3))
