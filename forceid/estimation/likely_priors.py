"""Claims that allow for the priors of a load that a record does not tell apart: order, rate, size, and none.

The smoother works under one prior, the likeliest smooth one. Others that explain the record about as well
would have it follow more or less of the load. The claim is what its error would be under each of them,
weighed by its likelihood: in the frequency domain, where a candidate costs a sum over the whitened
innovations' spectrum. Source: the likelihood of Whittle (1953); the error of a suboptimal smoother, Gelb
(1974) 7.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.hidden_load import SLOWEST, band_of, beside_parabola, densities
from forceid.kalman.channels import Channel
from forceid.kalman.engines import Engine
from forceid.kalman.flight import FlightState
from forceid.kalman.lines import OUTLIER, PATIENCE
from forceid.kalman.prior import LoadPrior, channel_model
from forceid.kalman.process import matern
from forceid.kalman.tuning import LEAK
from forceid.records import Array

LONGEST = 2048  # samples that are looked at: the middle of a longer record
ORDERS = (2, 3, 4, 6)
RATES = 12  # from one over the record to half a turn a sample
STEP = 10**0.25  # from one size to the next, in power
LEAST, MOST = 1e-2, 1e2  # load over noise where it shows most: from next to none, to more than would not show
SINGLE = 16  # ordinates from the slowest on that stand for themselves; faster ones in groups
GROUPS = 8  # an octave
LEAKED = 2 * LEAK  # of the load on the strongest axis: one so small was not found
BEYOND = 8.0  # times half the sample rate, up to which what is lost of a load is counted


@dataclass(frozen=True)
class Spectrum:
    """Whitened innovations in groups of ordinates.

    power (group, axis), one where the prior is right; count (group,) of ordinates; frequency (group,) Hz.
    """

    frequency: Array
    power: Array
    count: Array


def growth_along_world(
    state: FlightState, channels: Mapping[str, Channel], priors: Mapping[str, LoadPrior], engine: Engine
) -> Array:
    """Matrix (6, 6) that takes errors of a wrench as its priors claim them to errors under all candidates.

    channels: that force and moment drive, by name, with their priors, along world axes. The load stays what
    it is.
    """
    found, edge = np.eye(6), len(state.wrench_cov) // 8
    inner = state.wrench_cov[edge : len(state.wrench_cov) - edge]
    for name, channel in channels.items():
        first, prior = (0 if name == "force" else 3), priors[name]
        own, axes = slice(first, first + 3), prior.axes
        claimed = np.nanmean(np.einsum("ai,tab,bi->ti", axes, inner[:, own, own], axes), axis=0)
        growth = growth_of(channel, prior, claimed, engine)
        found[own, own] = axes * growth @ axes.T
    return found


def grown(state: FlightState, growth: Array) -> FlightState:
    """The same state with the errors that its wrench claims turned by a matrix (6, 6)."""
    known = np.isfinite(state.wrench_cov)
    cov = growth @ np.where(known, state.wrench_cov, 0.0) @ growth.T
    return replace(state, wrench_cov=np.where(known, cov, np.nan))


def growth_of(channel: Channel, prior: LoadPrior, claimed: Array, engine: Engine) -> Array:
    """Factors (axis,), one at least, on the claimed variance (axis,) of a load along the axes of its prior.

    On its deviation: the mean of the deviations under all candidates over the one claimed.
    """
    first = max(0, (len(channel.time) - LONGEST) // 2)
    part = cut(channel, slice(first, first + LONGEST))
    spectrum = innovations_of(part, prior, engine)
    span, fastest = float(np.ptp(part.time)), spectrum.frequency[-1]
    noise, smooth, _ = densities(part, prior, spectrum.frequency)
    shown = noise / beside_parabola(spectrum.frequency * span)[:, None]
    wide = np.geomspace(0.5 / span, BEYOND * fastest, 96)
    noise_at, smooth_at, _ = densities(part, prior, wide)
    lost = np.where(wide[:, None] < fastest, noise_at / (noise_at + smooth_at), 1.0)
    band = band_of(part, prior, np.geomspace(1 / span, fastest, 128)).max()
    width = np.gradient(wide)[:, None] * 2
    found = np.ones(3)
    for axis in range(3):
        counted = width[:, 0]
        if not prior.tuned.std[axis] > LEAKED * prior.tuned.std.max():
            # what is faster than the band of the load is no part of the claim, but of what may hide
            counted = np.where(wide < max(band, SLOWEST / span), counted, 0.0)
        likelihood, error = candidates(
            spectrum.frequency, spectrum.power[:, axis], spectrum.count, shown[:, axis], smooth[:, axis],
            wide, counted * lost[:, axis] ** 2,
        )  # fmt: skip
        weight = np.exp(likelihood - likelihood.max())
        own = float((counted * lost[:, axis] ** 2 * smooth_at[:, axis]).sum())
        std = np.sqrt(np.maximum(claimed[axis] + error - own, 0.0) / claimed[axis])
        found[axis] = max(float(weight @ std / weight.sum()), 1.0)
    return found


def likeliest(channel: Channel, prior: LoadPrior, engine: Engine, beside: Array | None = None) -> float:
    """Log-likelihood of the likeliest candidates, but for a constant of the prior in use.

    beside (time, 3, column): what a channel may show of something else, in unknown amounts, which are taken
    as they fit best.
    """
    first = max(0, (len(channel.time) - LONGEST) // 2)
    run = slice(first, first + LONGEST)
    part = cut(channel, run)
    spectrum = innovations_of(part, prior, engine, None if beside is None else beside[run])
    span = float(np.ptp(part.time))
    noise, smooth, _ = densities(part, prior, spectrum.frequency)
    shown = noise / beside_parabola(spectrum.frequency * span)[:, None]
    total, none = 0.0, np.zeros(1)
    for i in range(3):
        likelihood, _ = candidates(
            spectrum.frequency, spectrum.power[:, i], spectrum.count, shown[:, i], smooth[:, i], none, none
        )
        total += float(likelihood.max())
    return total


def innovations_of(
    channel: Channel, prior: LoadPrior, engine: Engine, beside: Array | None = None
) -> Spectrum:
    """The spectrum of a channel's whitened innovations along the axes of a prior, without what is beside."""
    axes = prior.axes
    model = channel_model(channel, prior)
    turned = replace(model, H=axes.T @ model.H, R=axes.T @ model.R @ axes)
    v = engine.filter(turned, channel.moved @ axes).innovation
    seen = np.asarray(np.isfinite(v).all(1))
    v = np.where(seen[:, None], v, 0.0)
    if beside is not None:
        gaps = np.where(np.isfinite(channel.z), 0.0, np.nan)
        signals = np.moveaxis(beside + gaps[..., None], 2, 0) @ axes
        columns = [engine.filter(turned, signal).innovation for signal in signals]
        A = np.nan_to_num(np.stack(columns, -1)).reshape(-1, beside.shape[2])
        v = v - (A @ np.linalg.lstsq(A, v.ravel(), rcond=None)[0]).reshape(v.shape)
    v = np.clip(v, -OUTLIER, OUTLIER)
    power = np.abs(np.fft.rfft(v, axis=0)[1:-1]) ** 2 / seen.sum()
    frequency = np.fft.rfftfreq(len(v), float(np.median(np.diff(channel.time))))[1:-1]
    index = np.arange(1, len(frequency) + 1)
    group = np.where(index <= SINGLE, index, SINGLE + np.ceil(GROUPS * np.log2(index / SINGLE))).astype(int)
    starts = np.flatnonzero(np.diff(group, prepend=0))
    count = np.diff(starts, append=len(group))
    mean = np.add.reduceat(power, starts, axis=0) / count[:, None]
    return Spectrum(np.add.reduceat(frequency, starts) / count, mean, count)


def candidates(
    frequency: Array, power: Array, count: Array, noise: Array, own: Array, wide: Array, lost: Array
) -> tuple[Array, Array]:
    """Log-likelihood of priors (candidate,) given a spectrum of innovations, and the error of the load lost.

    noise, own (group,): densities of the noise and of the prior in use; lost (wide,): what a density at each
    of the frequencies `wide` adds to the mean squared error.
    """
    rate = np.geomspace(2 * np.pi * frequency[0], np.pi * frequency[-1], RATES)[:, None]
    likelihood: list[Array] = [np.zeros(1)]
    error = [np.zeros(1)]
    most = MOST * max(1.0, float((own / noise).max()))
    size = np.exp(np.arange(np.log(LEAST), np.log(most), np.log(STEP)))[:, None, None]
    for order in ORDERS:
        shape, far = (
            matern(order, 1.0, rate[:, 0]).Qc[:, -1, -1, None] / (rate**2 + (2 * np.pi * f) ** 2) ** order
            for f in (frequency, wide)
        )
        unit = 1 / (shape / noise).max(1)[None, :, None]
        ratio = (size * unit * shape + noise) / (own + noise)
        likelihood.append((-(np.log(ratio) + power / ratio) @ count).ravel())
        error.append(((size * unit * far) @ lost).ravel())
    # none is held against the rest as tuning does: even odds where a load is e^PATIENCE times as likely
    some = np.concatenate(likelihood[1:])
    still = noise / (own + noise)
    none = PATIENCE - (np.log(still) + power / still) @ count + np.log(np.exp(some - some.max()).sum())
    return np.append(none, some), np.concatenate(error)


def cut(channel: Channel, run: slice) -> Channel:
    """A stretch of a channel."""
    cov = channel.noise_cov
    return replace(
        channel, time=channel.time[run], z=channel.z[run], noise_cov=cov[run] if cov.ndim == 3 else cov
    )
