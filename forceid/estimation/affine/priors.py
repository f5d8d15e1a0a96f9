"""Priors of the loads on an affine body: the level at which the expected error is least.

Inner elastic forces swing at frequencies of their own, which no Matern spectrum has. Likelihood fits a prior
where the load stands far above the noise, and raises it everywhere to reach them; errors are made where load
and noise are alike, and there the claims come out too wide. So level and rate are those of the least expected
error of the load, which the spectrum of the whitened innovations gives without bias. Source: C. M. Stein,
Ann. Stat. 9 (1981) 1135, sections 2 and 5; principal equations 4e.
"""

from __future__ import annotations

import numpy as np

from forceid.estimation.affine.channels import AffineChannels, channel_in_body_axes, prior_in_body_axes
from forceid.estimation.affine.powers import Axes, Powers, powers, richest
from forceid.estimation.affine.resonances import find_resonances
from forceid.flight.channels import Channel, load_axes, start_of
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import Kernel, LoadPrior, Tuned
from forceid.flight.tuning import ORDERS, tune_loads
from forceid.kalman.building.lines import Line
from forceid.kalman.engines import Engine
from forceid.records import Array
from forceid.significance import NUMBER, PATIENCE

POWER_SHOWN = 0.2  # power of a load over that of the noise below which a frequency says nothing of it
SLOWER = (1.0, 0.5, 0.25)  # rates tried, of the frequency where load and noise are alike
SCALES = np.linspace(-3.0, 3.0, 121)  # levels tried, logarithms


def tune_channels(channels: AffineChannels, engine: Engine) -> list[LoadPrior]:
    """Priors of the force, along world axes, and of the columns of K along axes of the body.

    The columns are one body's: one order, one rate and one factor on the level for all of their entries.
    Lines of the prior of a column run along the axes of the body, three in turn.
    """
    priors = []
    if channels.center is not None:
        center, world = channels.center, axes_of(channels.center)
        tuned = Tuned(likeliest(channels_side_by_side([center], [world]), engine))
        priors.append(LoadPrior(tuned, world, start_of(center.time, center.moved @ world, center.gain)))
    bodily = [channel_in_body_axes(column, channels.rotation) for column in channels.columns]
    axes = [axes_of(w) for w in bodily]
    seen = channels_side_by_side(bodily, axes)
    most = richest(seen)
    kernel = least_error(likeliest(seen, engine), most, engine)
    resonances = find_resonances(kernel, most, engine)
    for B, column in enumerate(channels.columns):
        own = np.arange(3 * B, 3 * B + 3)
        lines = tuple(
            Line(s.w / (2 * np.pi), float(std), s.bandwidth, axis, turns=True)
            for s in resonances
            for std, axis in zip(s.std[own], axes[B].T, strict=True)
        )
        start = start_of(column.time, column.moved, 1.0)
        priors.append(prior_in_body_axes(LoadPrior(Tuned(kernel.of(own)), axes[B], start, lines), column))
    return priors


def axes_of(channel: Channel) -> Array:
    """Axes (columns) along which the load of a channel varies independently."""
    seen = np.isfinite(channel.z).all(1)
    return load_axes(channel.time[seen], channel.z[seen])


def channels_side_by_side(channels: list[Channel], axes: list[Array]) -> Axes:
    """Channels along their axes, side by side, in units of their loads."""
    pairs = [(c, a, c.gain) for c, a in zip(channels, axes, strict=True)]
    return Axes(
        channels[0].time,
        np.concatenate([c.moved @ a / g for c, a, g in pairs], 1),
        np.concatenate([c.var(a) / g**2 for c, a, g in pairs], 1),
        np.concatenate([np.diagonal(a.T @ c.drift @ a) / g**2 for c, a, g in pairs]),
    )


def likeliest(seen: Axes, engine: Engine) -> Kernel:
    """The likeliest kernel of the lowest order that no other beats clearly."""
    found: list[Tuned] = []
    for order in sorted((o for o in ORDERS if o > 1), reverse=True):
        tuned = tune_loads(seen.time, seen.z, 1.0, seen.noise_var, seen.drift, orders=(order,), engine=engine)
        found.append(tuned)
        if tuned.log_likelihood < max(t.log_likelihood for t in found) - PATIENCE:
            break  # rougher ones are less likely still
    top = max(t.log_likelihood for t in found)
    return next(t.kernel for t in reversed(found) if t.log_likelihood > top - NUMBER)


def least_error(kernel: Kernel, seen: Axes, engine: Engine) -> Kernel:
    """The prior of the same order, one rate and one factor on all levels, of the least expected error.

    Expected error of the load at a frequency, from total power T, noise N and a prior S: the part 1 - G of
    T - N that is lost, and the part G of N that passes, G = S / (S + N).
    """
    p = powers(kernel, seen, engine)
    observed = p.prior > POWER_SHOWN * p.noise
    if not observed.any():
        return kernel
    top = int(np.flatnonzero(observed.any(1))[-1]) + 1
    observed, p = observed[:top], Powers(p.w[:top], p.total[:top], p.noise[:top], p.prior[:top])
    alike = np.abs(np.log(p.prior / p.noise)).argmin(0)
    axis = np.arange(p.total.shape[1])
    # all axes count alike, whatever their size
    share = observed / np.maximum((p.prior * p.noise / (p.prior + p.noise) * observed).sum(0), 1e-300)
    middle = float(np.exp(np.log(p.w[alike][observed.any(0)]).mean()))
    best, least = kernel, np.inf
    for rate in middle * np.array(SLOWER):
        base = Matern(kernel.order, np.ones(1), np.array([rate])).density(p.w[:, None])
        level = np.log(p.prior[alike, axis] / base[alike, 0])  # alike where error is made
        S = base * np.exp(level + 2 * SCALES[:, None, None])
        gain = S / (S + p.noise)
        lost = ((1 - gain) ** 2 * (p.total - p.noise) + gain**2 * p.noise) * share
        error = lost.sum((1, 2))
        k = int(error.argmin())
        if error[k] < least:
            std = np.exp(0.5 * level + SCALES[k])
            best, least = Matern(kernel.order, std, np.full(len(axis), rate)), float(error[k])
    return best
