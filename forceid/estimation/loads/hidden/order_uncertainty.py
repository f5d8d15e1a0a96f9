"""Claims that allow for the priors of a load that a record does not tell apart: order, rate, size, and none.

The smoother works under one prior, the likeliest smooth one. Others that explain the record about as well
would have it follow more or less of the load. The claim is what its error would be under each of them,
weighed by its likelihood. Source: the error of a suboptimal smoother, Gelb (1974) 7.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from forceid.errors import EstimationError
from forceid.estimation.loads.hidden.left_out import followed_up_to
from forceid.estimation.loads.hidden.slow_load import MOST_CYCLES, slow_growth, slow_turning_growth
from forceid.estimation.loads.hidden.whitened import Candidates, Whitened
from forceid.flight.priors.matern import Matern
from forceid.flight.smoother import FlightState
from forceid.flight.tuning import LEAK, ORDERS
from forceid.records import Array
from forceid.rounding import SINGLE

POWERS_APART = 1e4  # times the power of the noise of a channel that what else is read may make of it
BEYOND = 8.0  # times half the sample rate, up to which what is lost of a load is counted


@dataclass(frozen=True)
class Rivals:
    """Channels whose priors a record has to tell from others, by load, of a state that claims errors under
    these priors.
    """

    looks: Mapping[str, Whitened]
    state: FlightState

    def growth(self, orders: Array | None = None) -> Array:
        """The growth ([time,] 6, 6) of the errors; orders: as of `growth_along_own`."""
        return growth_along_own(self.state, self.looks, orders)

    @property
    def orders(self) -> Array:
        """Log-likelihood (order,) of each of ORDERS, were it that of all loads along all axes."""
        found = np.zeros(len(ORDERS))
        for look in self.looks.values():
            powers = look.powers(look.innovation).T
            each = zip(look.candidates, powers, strict=True)
            found += np.sum([one.of_orders(one.log_likelihood(power)) for one, power in each], axis=0)
        return found


def growth_along_own(
    state: FlightState, channels: Mapping[str, Whitened], orders: Array | None = None
) -> Array:
    """Matrix (6, 6) that takes errors of a wrench as its priors claim them to errors under all candidates.

    One of each sample (time, 6, 6) where axes of a prior turn with the body. channels: that force and moment
    drive, by name, under their priors. orders (order,): log-likelihood of each of ORDERS by all records of
    loads that have it in common, these among them. The load stays what it is.
    """
    found = np.eye(6)
    for name, channel in channels.items():
        first, axes = (0 if name == "force" else 3), channel.prior.axes_along(state.rotation)
        own = slice(first, first + 3)
        if axes.ndim > found.ndim:
            found = np.tile(found, (len(axes), 1, 1))
        claimed = claimed_along(axes, state.wrench_cov[:, own, own])
        found[..., own, own] = axes * growth_of(channel, claimed, orders) @ axes.mT
    return found


def claimed_along(axes: Array, cov: Array) -> Array:
    """Mean variance (axis,) of cov (time, 3, 3) along axes ([time,] 3, 3), in the inner part of a record."""
    edge = len(cov) // 8
    along = np.einsum("...ai,...ab,...bi->...i", axes, cov, axes)
    if not np.isfinite(along[edge : len(along) - edge]).any():
        what = "loses all digits of what it claims: masses are too small, or the clock is too slow"
        raise EstimationError(what, "the smoother", "give the times in s, and the masses in kg")
    return np.asarray(np.nanmean(along[edge : len(along) - edge], axis=0))


def grown(state: FlightState, growth: Array) -> FlightState:
    """The same state with the errors that its wrench claims turned by a matrix ([time,] 6, 6)."""
    known = np.isfinite(state.wrench_cov)
    cov = growth @ np.where(known, state.wrench_cov, 0.0) @ growth.mT
    return replace(state, wrench_cov=np.where(known, cov, np.nan))


def growth_of(found: Whitened, claimed: Array, orders: Array | None = None) -> Array:
    """Factors (axis,), one at least, on the claimed variance (axis,) of a load along the axes of its prior.

    On its deviation: the mean of the deviations under all candidates over the one claimed. orders: as of
    `growth_along_own`.
    """
    part, prior = found.channel, found.prior
    span, fastest = float(np.ptp(part.time)), found.groups[0][-1]
    wide = np.geomspace(0.5 / span, BEYOND * fastest, 96)
    noise, smooth = found.densities(wide)
    lost = shares_lost(wide, fastest, noise, smooth, claimed)
    finer = np.geomspace(1 / span, fastest, 128)
    hidden, shown = found.densities(finer)
    band = followed_up_to(shown / (hidden + shown), finer).max()
    width, powers = np.gradient(wide) * 2, found.powers(found.innovation)
    leak = 2 * LEAK * (1 + SINGLE) * prior.kernel.std.max()  # of a prior that has no less, to rounding
    missed = 1 - (1 - lost) * np.sqrt(found.passed(wide))[:, None]  # with what the source took
    growth = np.ones(3)
    for axis, candidates in enumerate(found.candidates):
        counted = width
        if not prior.kernel.std[axis] > leak:
            # what is faster than the band of the load is no part of the claim, but of what may hide
            counted = np.where(wide < max(band, 2 / span), width, 0.0)
        error = candidates.density(wide, counted * missed[:, axis] ** 2)
        own = float((counted * lost[:, axis] ** 2) @ smooth[:, axis])
        likely = candidates.log_likelihood(powers[:, axis])
        likely = likely if orders is None else with_order(candidates, likely, orders)
        growth[axis] = grown_deviation(likely, error - own, claimed[axis])
    # a load that is as good as constant, or too weak to show: of few cycles a spectrum tells little. Of one
    # that turns with the body none does in axes of the world, where these stretches are
    still = prior.kernel.std**2 < np.maximum(claimed, leak**2)
    cycles = max(band * span, 2.0)
    if prior.lines or prior.tuned.pieces is not None or not isinstance(prior.kernel, Matern):
        return growth
    if prior.body_axes is not None:
        slow = still | (prior.kernel.rate * span < 2 * np.pi * MOST_CYCLES)
        return np.maximum(growth, slow_turning_growth(found, claimed, slow)) if slow.any() else growth
    if still.any() and cycles < MOST_CYCLES:
        return np.where(still, np.maximum(growth, slow_growth(part, prior, cycles)), growth)
    return growth


def with_order(candidates: Candidates, likelihood: Array, orders: Array) -> Array:
    """Log-likelihood (candidate,) with what all others tell of the order, orders (order,) of all together."""
    others = orders - candidates.of_orders(likelihood)
    none = np.logaddexp.reduce(others) - np.log(len(others))
    each = np.repeat(others, (len(likelihood) - 1) // len(others))
    return np.asarray(likelihood + np.concatenate([[none], each]))


def grown_deviation(likelihood: Array, more: Array, claimed: float) -> float:
    """Factor, one at least, on a deviation: the mean of those under all candidates over the one claimed.

    likelihood (candidate,): logarithms; more (candidate,): error variance under each beyond the one claimed.
    """
    weight = np.exp(likelihood - likelihood.max())
    std = np.sqrt(np.maximum(claimed + more, 0.0) / claimed)
    return max(float(weight @ std / weight.sum()), 1.0)


def shares_lost(frequency: Array, fastest: float, noise: Array, smooth: Array, claimed: Array) -> Array:
    """Share (frequency, axis) of the amplitude of a load that a smoother misses, all of it where faster.

    noise, smooth (frequency, axis): densities, as loads. What else is read makes the noise another size than
    that of the channel alone: the size with which the smoother's variance is the one claimed (axis,).
    """
    width, seen = np.gradient(frequency) * 2, frequency < fastest
    lost = np.ones_like(noise)
    for axis, (N, S) in enumerate(zip(noise[seen].T, smooth[seen].T, strict=True)):
        beyond = width[~seen] @ smooth[~seen, axis]

        def excess(log: float, N: Array = N, S: Array = S, left: float = claimed[axis] - beyond) -> float:
            return float(width[seen] @ (N * S / (N + S * np.exp(-log)))) - left

        span = np.log(POWERS_APART)
        log = brentq(excess, -span, span) if excess(-span) < 0 < excess(span) else 0.0
        lost[seen, axis] = N / (N + S * np.exp(-log))
    return lost
