"""What a load that is taken for constant may do in a record, where it makes few cycles or less than one.

Such a load bends the track as a parabola nearly does, and the noise hides how it varies long before it hides
its mean. A spectrum of so few cycles tells little of it, so that each candidate is weighed by the exact
likelihood of the record, and the claim is the variance of their mixture,

    var = sum_c w_c (P_c + (f_c - f)^2),

where f is the load in use, f_c and P_c the load and its variance under a candidate c, w_c its probability
given the record. Means over stretches of a sampled track lose nothing of loads so slow. Source: mixtures of
smoothers (Magill, IEEE Trans. Automatic Control 10 (1965) 434); the likelihood is that of what start, speed
and a constant load leave (restricted likelihood).

A load that turns with the body swings at the spin in axes of the world, where these stretches stand; slow
along an axis of the body, it is weighed by the exact likelihood of the channel instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import softmax

from forceid.estimation.loads.hidden.whitened import FAINTEST, NONE_OF_SIX, Whitened
from forceid.flight.channels import Channel
from forceid.flight.color import autocorrelation
from forceid.flight.priors.matern import UNTOLD_ORDER, Matern
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.tuning import LEAK
from forceid.records import Array, Flags
from forceid.rounding import SINGLE
from forceid.significance import CHANCE, PATIENCE, SIGMAS

MEANS = 48  # stretches of a record: at the most cycles below, eight to each
MOST_CYCLES = MEANS / 8  # in a record, above which its spectrum tells a load
SLOW_RATES = 6  # candidates, about two to an octave of those that a record of few cycles tells apart
NEXT_SIZE = 10**0.5  # from one size to the next, in power: a fifth of a log-likelihood at its top
CORRELATED_AT = 4 * MEANS  # lags at which the correlation of a load is worked out
HARDLY = 0.4  # rad that a body turns within a mean: it takes less than a percent from what turns with it
TIMES = 2.0  # from one size of a load to the next: a sigma or two of what a likelihood tells of it
SIZES = 10  # of them at most: the last is five hundred times the first
CYCLES = (
    1.0,
    0.5 * MOST_CYCLES,
)  # in a record, of loads that are tried: as a trend, and as fast as is slow


def slow_growth(channel: Channel, prior: LoadPrior, cycles: float) -> Array:
    """Factors (axis,), one at least, on the claimed deviation of a load that is as good as constant.

    cycles: in the record, of the fastest load that is part of the claim. Even odds for a load that acts to
    vary; one that is not there does not, by the odds of `whitened`.
    """
    tracks = [Track.along(channel, axis) for axis in prior.axes.T]
    acts = sum((one.constant / one.claim) ** 2 for one in tracks) > SIGMAS**2 + len(tracks) - 1
    odds, order = 1.0 if acts else NONE_OF_SIX, prior.kernel.order
    each = zip(tracks, prior.kernel.rate, prior.kernel.std, strict=True)
    return np.array([one.growth(cycles, odds, one.under(order, rate, std**2)) for one, rate, std in each])


@dataclass(frozen=True)
class Track:
    """A driven channel along an axis as means over stretches, whitened by its noise.

    time (mean,) s; left (rest,): what start, speed and a constant load leave of it; seen (rest, mean): what
    of a load at these times is left of it so; beside (mean, mean): what of a load is beside the constant that
    the channel is taken for; constant: this load, and its claim.
    """

    time: Array
    left: Array
    seen: Array
    beside: Array
    constant: float
    claim: float

    @classmethod
    def along(cls, channel: Channel, axis: Array) -> Track:
        """The channel along an axis (3,) of the world."""
        known = np.isfinite(channel.z).all(1)
        z, var = (channel.moved @ axis)[known], channel.var(axis[:, None])[known, 0]
        var = var * (1.0 if channel.color is None else channel.color.slow)
        clock = channel.time[known] - channel.time[0]
        edges = np.linspace(0, len(clock), min(MEANS, len(clock)) + 1).astype(int)
        count = np.diff(edges)
        time, z, var = (np.add.reduceat(a, edges[:-1]) / count for a in (clock, z, var))
        drift = float(axis @ channel.drift @ axis) * np.minimum.outer(time, time)
        root = np.linalg.cholesky(np.diag(var / count) + drift)
        driven = channel.gain * twice_integrated(time)
        known_shapes = np.stack([np.ones(len(time)), time, driven.sum(1)], 1)
        whole = np.column_stack([z, driven, known_shapes])
        white = np.asarray(solve_triangular(root, whole, lower=True), float)
        z, driven, known_shapes = white[:, 0], white[:, 1:-3], white[:, -3:]
        rest = np.linalg.qr(known_shapes, mode="complete")[0][:, 3:]
        reads = np.linalg.pinv(known_shapes)[2]  # a constant load
        return cls(
            time,
            rest.T @ z,
            rest.T @ driven,
            np.eye(len(time)) - reads @ driven,
            float(reads @ z),
            float(np.linalg.norm(reads)),
        )

    def under(self, order: int, rate: float, size: float | None = None) -> tuple[Array, Array, Array]:
        """Matern loads of a variance, or of all (size,) from next to none to more than the track allows.

        The log-likelihood (size,) gained over a constant; the load (size, mean) beside the constant, and the
        variance of both.
        """
        span = float(self.time[-1] - self.time[0])
        lags = np.linspace(0, span, CORRELATED_AT)
        K = np.interp(
            np.abs(self.time[:, None] - self.time), lags, autocorrelation(order, np.array(rate), lags)
        )
        shown = K @ self.seen.T
        power, axes = np.linalg.eigh(self.seen @ shown)
        power, y = np.maximum(power, 0.0), axes.T @ self.left
        if size is None:
            most = max(1.0, float(y @ y) / len(y)) / FAINTEST
            sizes = np.exp(np.arange(np.log(FAINTEST), np.log(most), np.log(NEXT_SIZE)))[:, None] / power[-1]
        else:
            sizes = np.array([[size]])
        ratio, read = 1 + sizes * power, self.beside @ shown @ axes
        alone = np.einsum("ij,jk,ik->i", self.beside, K, self.beside)
        var = np.maximum(sizes * alone - sizes**2 / ratio @ (read**2).T, 0.0)
        gain = 0.5 * (y**2 - np.log(ratio) - y**2 / ratio).sum(1)
        return gain, (sizes / ratio * y) @ read.T, var + self.claim**2

    def growth(self, cycles: float, odds: float, own: tuple[Array, Array, Array]) -> float:
        """Factor on the deviation of the load in use, `own`; odds: of a constant over one that varies."""
        span, n = float(self.time[-1] - self.time[0]), len(self.time)
        inner = slice(n // 8, n - n // 8)
        rates = np.geomspace(1 / span, 2 * np.pi * cycles / span, SLOW_RATES)
        each = [self.under(UNTOLD_ORDER, rate) for rate in rates]
        _, used, claimed = own
        gain = np.concatenate([gain for gain, _, _ in each])
        var = np.concatenate([(var + (load - used) ** 2)[:, inner].mean(1) for _, load, var in each])
        constant = self.claim**2 + float((used[0, inner] ** 2).mean())
        top = max(float(gain.max()), 0.0)
        weight, none = np.exp(gain - top), odds * len(gain) * np.exp(-top)
        mixed = (weight @ var + none * constant) / (weight.sum() + none)
        return max(float(np.sqrt(mixed / claimed[0, inner].mean())), 1.0)


def twice_integrated(time: Array) -> Array:
    """Matrix (time, time) that takes a load, straight between its samples, to its second integral.

    >>> t = np.linspace(0.0, 2.0, 9)
    >>> bool(np.allclose(twice_integrated(t) @ t, t**3 / 6))
    True
    """
    n = len(time)
    at, first, second = np.eye(n), np.zeros((n, n)), np.zeros((n, n))
    for k, step in enumerate(np.diff(time)):
        second[k + 1] = second[k] + step * first[k] + step**2 / 6 * (2 * at[k] + at[k + 1])
        first[k + 1] = first[k] + step / 2 * (at[k] + at[k + 1])
    return second


def thinned(found: Whitened) -> Whitened:
    """A channel as means over samples within which body and loads hardly turn or change; as it is where few.

    Errors that follow each other stay as they are.
    """
    channel, R = found.channel, found.rotation
    step = float(np.median(np.diff(channel.time)))
    turn = np.arccos(np.clip((np.einsum("tab,tab->t", R[1:], R[:-1]) - 1) / 2, -1, 1)).max(initial=0.0)
    fastest = max(float(turn), step * float(found.prior.kernel.rate.max()))
    each = min(int(HARDLY / fastest), len(R) // (MEANS + 1)) if fastest > 0 else len(R) // (MEANS + 1)
    each -= 1 - each % 2  # odd: the middle one is where the mean is
    even = np.ptp(np.diff(channel.time)) < SINGLE * step
    if each < 3 or channel.color is not None or found.prior.lines or not even:
        return found
    whole = slice(0, len(R) // each * each)

    def means(a: Array) -> Array:
        return np.asarray(a[whole].reshape(-1, each, *a.shape[1:]).mean(1))

    cov = channel.noise_cov
    cov = (means(cov) if cov.ndim == 3 else cov) / each
    middle = slice(each // 2, whole.stop, each)
    part = replace(channel, time=channel.time[middle], z=means(channel.z), noise_cov=cov)
    return replace(found, channel=part, rotation=R[middle])


def slow_turning_growth(found: Whitened, claimed: Array, slow: Flags) -> Array:
    """Factors (axis,), one at least, on the claimed deviations of loads along the axes that are `slow`.

    claimed (axis,): variances.
    """
    found = thinned(found)
    prior, growth, span = found.prior, np.ones(3), float(np.ptp(found.channel.time))
    edge = len(found.channel.time) // 8
    inner = slice(edge, len(found.channel.time) - edge)
    own, claim = found.likelihood(prior), None
    kernel, at = prior.kernel, np.arange(3)
    least = LEAK * float(kernel.std.max())
    for axis in np.flatnonzero(slow):
        tried: list[tuple[float, LoadPrior]] = []
        for cycles in CYCLES:
            before = -np.inf
            for size in max(np.sqrt(claimed[axis]), least) * TIMES ** np.arange(SIZES):
                rate = np.where(at == axis, 2 * np.pi * cycles / span, kernel.rate)
                std = np.where(at == axis, size, kernel.std)
                other = prior.with_kernel(Matern(kernel.order, std, rate))
                gain = found.likelihood(other) - own
                tried.append((gain, other))
                if gain < before and gain < -PATIENCE:
                    break
                before = gain
        first, *weight = softmax([0.0, *(gain for gain, _ in tried)])
        count = [
            (w, other) for w, (_, other) in zip(weight, tried, strict=True) if w * (len(tried) + 1) > CHANCE
        ]
        if not count:  # none is near as likely as the prior itself
            continue
        load, var = claim = found.smoothed(prior) if claim is None else claim
        mixed = first * float(var[inner, axis].mean())
        for share, other in count:
            there, spread = found.smoothed(other)
            mixed += share * float((spread + (there - load) ** 2)[inner, axis].mean())
        ratio = mixed / float(var[inner, axis].mean())
        growth[axis] = np.sqrt(ratio) if ratio > 1 else 1.0  # also where rounding swamps a variance
    return growth
