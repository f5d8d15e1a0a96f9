"""A channel as the prior in use whitens it, and how likely other priors of its load make the record.

In the frequency domain, where a candidate costs a sum over the spectrum of the whitened innovations: under
another smooth load S' that spectrum is (S' + N) / (S + N). Source: the likelihood of Whittle (1953).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from forceid.estimation.loads.hidden.left_out import beside_parabola, own_densities
from forceid.flight.channels import Channel, middle
from forceid.flight.color import LowPassed
from forceid.flight.priors.protocol import LoadPrior, channel_model
from forceid.flight.tuning import ORDERS
from forceid.flight.whittle import ordinates
from forceid.kalman.building.process import matern_density
from forceid.kalman.engines import Engine
from forceid.kalman.model import Filtered, StateSpace
from forceid.records import Array, Indices
from forceid.significance import OUTLIER

RATES_TRIED = 12  # from one over the record to half a turn a sample
STEP = 10**0.25  # from one size to the next, in power
FAINTEST = 1e-2  # load over noise where it shows most: from next to none, up to its inverse
NONE_OF_SIX = 6.0 + 1  # odds that a component has no load, as none of six may: rule of succession (Laplace)


@dataclass(frozen=True)
class Candidates:
    """Priors of the load along one axis, uniform in the logarithm of rate and size; the first is none.

    Of each (candidate,): its order, rate 1/s, and size, a factor on the density of a load of unit deviation.
    Its log-likelihood given a spectrum is -cost - inverse @ (power * count), inverse (candidate, group).
    """

    order: Indices
    rate: Array
    size: Array
    cost: Array
    inverse: Array

    def log_likelihood(self, powers: Array) -> Array:
        """Of each candidate, with the odds that it has beforehand, given power times count (group,)."""
        return np.asarray(-self.cost - self.inverse @ powers)

    def of_orders(self, likelihood: Array) -> Array:
        """Log-likelihood (order,) of each of ORDERS with all of its candidates; none is a part of every one.

        likelihood (candidate,): as of `log_likelihood`.
        """
        none, each = likelihood[0] - np.log(len(ORDERS)), likelihood[1:].reshape(len(ORDERS), -1)
        return np.asarray(np.logaddexp(none, np.logaddexp.reduce(each, axis=1)))

    def density(self, frequency: Array, weight: Array) -> Array:
        """Sum (candidate,) over frequencies (frequency,) Hz of the density of the load, weighed."""
        found = np.zeros(len(self.order))
        for order in ORDERS:
            own = self.order == order
            rate, which = np.unique(self.rate[own], return_inverse=True)
            found[own] = self.size[own] * (densities_of(order, rate, frequency) @ weight)[which]
        return found


@dataclass(frozen=True)
class Whitened:
    """The innovations (time, 3) of a channel along the axes of its prior, outliers held back, zero at gaps.

    rotation (time, 3, 3): of the body, which these may turn with; also (time, 3, column): what else the
    channel may show, in unknown amounts, world axes; signals: as its innovations would be; loads: what the
    prior takes it for; seen: samples that are not gaps. orders: of the priors that may be in its place;
    doubt: variance of the logarithm of the noise in an octave, where that is not known; source: filter that
    the channel went through, None for none.
    """

    channel: Channel
    prior: LoadPrior
    engine: Engine
    rotation: Array
    also: Array
    innovation: Array
    signals: Array
    loads: Array
    seen: int
    orders: tuple[int, ...] = ORDERS
    doubt: float = 0.0
    source: LowPassed | None = None

    @cached_property
    def groups(self) -> tuple[Array, Indices, Array]:
        """Frequency (group,) Hz of the groups of ordinates, the first ordinate of each, and their count."""
        return groups_of(self.channel.time)

    def powers(self, innovation: Array) -> Array:
        """Power (group, 3) of innovations (time, 3), one an ordinate where the prior is right, summed."""
        return summed_powers(innovation, self.seen, self.groups[1]) * self.worth[:, None]

    @cached_property
    def worth(self) -> Array:
        """What an ordinate of each group (group,) counts: none where the source took more than half of it,
        and all of an octave no more than the doubt about the noise there lets them tell.
        """
        frequency, _, count = self.groups
        upto = np.concatenate([[0.0], np.cumsum(count)])
        half_octave = np.array([[2.0**-0.5], [2.0**0.5]])
        low, high = upto[np.searchsorted(frequency, frequency * half_octave)]
        return np.where(self.passed(frequency) > 0.5, 1 / (1 + (high - low) * self.doubt), 0.0)

    def passed(self, frequency: Array) -> Array:
        """Power (frequency,) that the source let pass at frequencies in Hz."""
        return np.ones(len(frequency)) if self.source is None else self.source.power(frequency)

    @cached_property
    def candidates(self) -> tuple[Candidates, ...]:
        """The candidates along each axis of the prior."""
        frequency, _, count = self.groups
        noise, own = self.densities(frequency)
        noise = noise / beside_parabola(frequency * float(np.ptp(self.channel.time)))[:, None]
        counted, further = count * self.worth, (self.orders, self.passed(frequency))
        each = zip(noise.T, own.T, strict=True)
        return tuple(candidates(frequency, counted, *one, *further) for one in each)

    def densities(self, frequency: Array) -> tuple[Array, Array]:
        """Spectral densities (frequency, 3) of noise and smooth load, as a load, along the same axes."""
        return own_densities(self.channel, self.prior, frequency, self.rotation)

    def likelihood(self, prior: LoadPrior) -> float:
        """Exact log-likelihood of the channel under another prior."""
        model = channel_model(self.channel, prior, self.rotation)
        return float(self.engine.log_likelihood(model, self.channel.moved))

    def smoothed(self, prior: LoadPrior) -> tuple[Array, Array]:
        """The load under another prior, along its axes, and its variance, (time, 3) each."""
        found = self.engine.smooth(channel_model(self.channel, prior, self.rotation), self.channel.moved)
        rows, own = prior.axes_along(self.rotation).mT @ prior.rows, slice(prior.states)
        load = (rows @ found.x[:, own, None])[..., 0]
        return load, np.asarray(np.einsum("tai,tij,taj->ta", rows, found.P[:, own, own], rows))

    def beside(self, columns: slice) -> Whitened:
        """The same with some of the signals alone."""
        return replace(
            self,
            also=self.also[..., columns],
            signals=self.signals[..., columns],
            loads=self.loads[..., columns],
        )

    def filtered(self, prior: LoadPrior) -> Filtered:
        """The filter's pass under another prior, over the channel and then each of the signals."""
        return self.engine.filter(*along_axes(self.channel, prior, self.also, self.rotation))


def groups_of(time: Array) -> tuple[Array, Indices, Array]:
    """Frequency (group,) Hz of groups of the ordinates of a record, the first ordinate of each, and count."""
    at = ordinates(len(time), float(np.median(np.diff(time))), None)
    return at.w[0] / (2 * np.pi), at.first, at.count.astype(float)


def summed_powers(innovation: Array, seen: ArrayLike, first: Indices) -> Array:
    """Power (group, column) of innovations (time, column), one an ordinate where they are white, summed.

    They are zero at gaps; seen, or seen (column,): samples that are not gaps; first: ordinate of each group.
    """
    power = np.abs(np.fft.rfft(innovation, axis=0)[1:-1]) ** 2 / seen
    return np.asarray(np.add.reduceat(power, first, axis=0))


def whitened(
    channel: Channel,
    prior: LoadPrior,
    engine: Engine,
    beside: Array | None = None,
    rotation: Array | None = None,
) -> Whitened:
    """The middle of a channel under its prior; beside (time, 3, column): what it may show beside a load.

    rotation (time, 3, 3): of the body, None where it does not show.
    """
    run = middle(len(channel.time))
    turned = np.tile(np.eye(3), (len(channel.time), 1, 1))[run] if rotation is None else rotation[run]
    cov = channel.noise_cov
    part = replace(
        channel, time=channel.time[run], z=channel.z[run], noise_cov=cov[run] if cov.ndim == 3 else cov
    )
    also = np.zeros((len(part.time), 3, 0)) if beside is None else beside[run] - beside[run][:1]
    return whitened_part(part, prior, engine, also, turned)


def whitened_part(channel: Channel, prior: LoadPrior, engine: Engine, also: Array, turned: Array) -> Whitened:
    """A whole channel under its prior, beside what it may also show (time, 3, column)."""
    model, z = along_axes(channel, prior, also, turned)
    if not also.size:
        v, loads = engine.filter(model, z).innovation, np.zeros((len(also), 3, 0))
    else:
        filtered, states = engine.filter_and_smooth_states(model, z)
        rows = prior.axes.T @ prior.rows
        v, loads = filtered.innovation, np.moveaxis(states[:, 1:, : prior.states] @ rows.T, 1, 2)
    if prior.body_axes is not None:  # innovations of white noise stay as white along axes that turn
        along = prior.axes_along(turned)
        v, loads = (a @ along if a is v else along.mT @ a for a in (v, loads))
    seen = np.asarray(np.isfinite(v[:, 0]).all(1))
    v = np.where(seen[:, None, None], v, 0.0)
    own, signals = np.clip(v[:, 0], -OUTLIER, OUTLIER), np.moveaxis(v[:, 1:], 1, 2)
    return Whitened(channel, prior, engine, turned, also, own, signals, loads, int(seen.sum()))


def along_axes(channel: Channel, prior: LoadPrior, also: Array, turned: Array) -> tuple[StateSpace, Array]:
    """The model of a channel along the axes of its prior, and as its signals (time, 1 + column, 3) what was
    measured and what it may also show.
    """
    axes, model = prior.axes, channel_model(channel, prior, turned)
    model = replace(model, H=axes.T @ model.H, R=axes.T @ model.R @ axes)
    gaps = np.where(np.isfinite(channel.z), 0.0, np.nan)[:, None]
    return model, np.concatenate([channel.moved[:, None] @ axes, np.moveaxis(also, 2, 1) @ axes + gaps], 1)


def candidates(
    frequency: Array, count: Array, noise: Array, own: Array, orders: tuple[int, ...] = ORDERS,
    passed: Array | float = 1.0,
) -> Candidates:  # fmt: skip
    """The candidates of some orders where noise and the prior in use have densities noise and own (group,),
    as loads, of whose power the source let a part `passed` (group,) pass.
    """
    rate = np.geomspace(2 * np.pi * frequency[0], np.pi * frequency[-1], RATES_TRIED)
    most = 1 / FAINTEST * max(1.0, float((own / noise).max()))
    size = np.exp(np.arange(np.log(FAINTEST), np.log(most), np.log(STEP)))
    total, sizes, ratios = own + noise, [np.zeros(1)], [(noise / (own + noise))[None]]
    for order in orders:
        shape = densities_of(order, rate, frequency)
        scaled = size[:, None] / (shape / noise).max(1)
        sizes.append(scaled.ravel())
        ratios.append(((scaled[:, :, None] * (shape * passed) + noise) / total).reshape(-1, len(frequency)))
    each = RATES_TRIED * len(size)
    ratio = np.concatenate(ratios)
    cost = np.log(ratio) @ count
    cost[0] -= np.log(NONE_OF_SIX * len(orders) * each)
    return Candidates(
        np.repeat((orders[0], *orders), (1, *[each] * len(orders))),
        np.concatenate([rate[:1], np.tile(rate, len(size) * len(orders))]),
        np.concatenate(sizes), cost, 1 / ratio,
    )  # fmt: skip


def densities_of(order: int, rate: Array, frequency: Array) -> Array:
    """Density (rate, frequency) of a Matern load of unit deviation."""
    return matern_density(order, 1.0, rate[:, None], 2 * np.pi * frequency)
