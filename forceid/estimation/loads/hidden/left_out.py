"""What an estimate leaves out: the frequency up to which a load was followed, and what may hide beyond it.

A channel that a load drives shows it against the noise: with S and N, the spectral densities of the smooth
load and of the noise as a load, a smoother follows the share S / (S + N). A line beside that is found where
it is as much likelier than none as the search for lines asks. Source: principal equations 4e (spin
harmonics).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from forceid.estimation.loads.rough_look import RESOLVED
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.leakage import LOOKED
from forceid.estimation.verdict.sensitivity import length
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.building.lines import near
from forceid.records import Array, Finding, HiddenLoad, deviation
from forceid.significance import PATIENCE, WILD

MUCH = 10.0  # times the claim, that a line is which matters


def hidden_load(
    channels: Mapping[str, Channel], priors: Mapping[str, LoadPrior], rotation: Array | None = None
) -> HiddenLoad:
    """What may hide beside the loads of a solved flight.

    channels: that force and moment drive, by name, with their priors; rotation (time, 3, 3): of the body,
    where priors keep to its axes. NaN for a load that no channel shows.
    """
    clock = channels["force"].time
    span, highest = float(np.ptp(clock)), 0.5 / float(np.median(np.diff(clock)))
    frequency = np.geomspace(1 / span, highest, LOOKED)
    finer = np.geomspace(1 / span, highest, 8 * LOOKED)
    amplitude, band = np.full((LOOKED, 6), np.nan), np.full(6, np.nan)
    for first, name in enumerate(("force", "moment")):
        if name in channels:
            own = slice(3 * first, 3 * first + 3)
            least, share = smallest_found(channels[name], priors[name], frequency, rotation)
            # where more than half of a load is followed, the noise alone hides it, and not the smooth load
            amplitude[:, own] = least * np.sqrt(np.minimum(1.0, 2 * (1 - share)))
            noise, smooth, axes = densities(channels[name], priors[name], finer, rotation)
            band[own] = followed_up_to(smooth / (noise + smooth) @ (axes**2).T, finer)
    return HiddenLoad(frequency, amplitude, band)


def smallest_found(
    channel: Channel,
    prior: LoadPrior,
    frequency: Array,
    rotation: Array | None = None,
    named: bool = False,
) -> tuple[Array, Array]:
    """Amplitude of a line that half of all records show, and the share of it that the smooth prior follows.

    Both (frequency, 3), along world axes.

    named: lines of which the frequency is known beforehand. The closed form, for a long record, of the
    evidence that a line has to gain: against the noise and the smooth load at its frequency.
    """
    noise, smooth, axes = densities(channel, prior, frequency, rotation)
    span, samples = float(np.ptp(channel.time)), int(np.isfinite(channel.z).all(1).sum())
    noise = noise / beside_parabola(frequency * span)[:, None]
    information = span / 4 * (1 / (noise + smooth)) @ (axes**2).T  # likelihood that a unit amplitude gains
    gained = required_gain(frequency * span, samples, named)
    return np.sqrt(gained[:, None] / information), smooth / (noise + smooth) @ (axes**2).T


def lines_at_spin(
    channels: Mapping[str, Channel],
    priors: Mapping[str, LoadPrior],
    state: FlightState,
    mass: float,
    gravity: Array,
) -> list[Finding]:
    """A line at the spin that would hide, where it would be much of the load, and of the claim.

    Much: of the load, or of weight, and of what turns the spin around in a radian, where no load shows. Less
    what the smooth prior follows of it; none where such a line is found, or is not to be seen at this rate.
    """
    std = deviation(state.wrench_cov)
    spin = float(np.mean(np.linalg.norm(state.omega, axis=1))) / (2 * np.pi)
    scales = {
        "force": (state.force, std[:, :3], mass * float(np.linalg.norm(gravity)), "N"),
        "moment": (state.moment, std[:, 3:], length(state.H) * length(state.omega), "N m"),
    }
    findings = []
    for name, channel in channels.items():
        load, claim, whole, unit = scales[name]
        size, claimed = length(load), length(claim)
        scale = size if size > WILD * claimed else max(size, whole)
        slow, fast = 2 / np.ptp(channel.time), 0.5 / np.median(np.diff(channel.time))
        taken = [line.frequency for line in priors[name].lines]
        for times, frequency in (("once", spin), ("twice", 2 * spin)):
            if not slow < frequency < fast or near(frequency, taken, channel.time):
                continue
            least, share = smallest_found(channel, priors[name], np.array([frequency]), named=True)
            hides = float((least * (1 - share)).max())
            if hides > MUCH * claimed and hides > RESOLVED * scale:
                findings.append(
                    note("line-at-spin", load=name, hidden=hides, unit=unit, times=times, claim=claimed)
                )
    return findings


def least_band(channel: Channel, prior: LoadPrior, rotation: Array | None = None) -> float:
    """Frequency Hz up to which the smooth prior follows more than half of a load along each of its axes."""
    frequency = np.arange(1, len(channel.time) // 2) / float(np.ptp(channel.time))
    noise, smooth, _ = densities(channel, prior, frequency, rotation)
    return float(followed_up_to(smooth / (noise + smooth), frequency).min())


def followed_up_to(share: Array, frequency: Array) -> Array:
    """Frequency (axis,) up to which a share (frequency, axis) of a load is more than half; 0: none."""
    followed = np.cumprod(share > 0.5, axis=0).sum(0)
    return np.where(followed > 0, frequency[np.maximum(followed, 1) - 1], 0.0)


def densities(
    channel: Channel, prior: LoadPrior, frequency: Array, rotation: Array | None = None
) -> tuple[Array, Array, Array]:
    """Spectral densities (frequency, 3) of noise and smooth load, both as a load, along axes (3, 3).

    The axes are those of the prior, as columns in world axes. One along axes of the body counts with the mean
    of its density along each axis of the world.
    """
    axes, w = prior.axes, 2 * np.pi * frequency[:, None]
    span, seen = float(np.ptp(channel.time)), np.isfinite(channel.z).all(1)
    white = channel.var(axes)[seen].mean(0) * span / seen.sum()
    drift = np.einsum("ai,ab,bi->i", axes, channel.drift, axes) / w**2
    white = white * (1.0 if channel.color is None else channel.color.density(w))
    noise = (white + drift) * w**4 / channel.gain**2
    return noise, prior.spectrum(w[:, 0], rotation), axes


def own_densities(
    channel: Channel, prior: LoadPrior, frequency: Array, rotation: Array
) -> tuple[Array, Array]:
    """The same along the axes that the prior holds along, which may turn with a rotation (time, 3, 3)."""
    if prior.body_axes is None:
        return densities(channel, prior, frequency)[:2]
    w, seen = 2 * np.pi * frequency, np.isfinite(channel.z).all(1)
    turning = prior.turning(channel.time, rotation)
    white = channel.var(np.eye(3))[seen].mean() * float(np.ptp(channel.time)) / seen.sum()
    white = white * (np.ones(len(w)) if channel.color is None else channel.color.density(w))
    drift = np.trace(channel.drift) / 3 / w**2
    noise = white * turning.of_position(w) + drift * turning.of_momentum(w)
    return (noise * w**4 / channel.gain**2).T, prior.spectrum(w)


def required_gain(cycles: Array, samples: int, named: bool = False) -> Array:
    """Log-likelihood (frequency,) that a line has to gain to be found in half of the records.

    Of a frequency that nobody named it has to stand out of all ordinates, and pays for the frequency too. So
    slow a load as is no line must be likelier than a constant on every axis.
    """
    price = np.full(len(cycles), PATIENCE if named else 2 * PATIENCE)
    price[cycles < 2] = 3 * PATIENCE
    gained = price
    for _ in range(20):  # two amplitudes that nobody knows cost the logarithm of what they gain
        gained = price + np.log1p(gained)
    stands = PATIENCE + (0.0 if named else np.log(2 * samples))
    return np.where(cycles < 2, gained, np.maximum(gained, stands))


def beside_parabola(cycles: Array) -> Array:
    """Part (frequency,) of the power of a wave that is left beside start, speed and a constant load."""
    ordinates = 4 * LOOKED
    t = np.linspace(-1.0, 1.0, ordinates)
    known = np.linalg.qr(np.polynomial.legendre.legvander(t, 2))[0]
    # beyond a quarter of these ordinates the part falls as one over the cycles
    few = np.minimum(cycles, ordinates / 8)
    wave = np.exp(1j * np.pi * few[:, None] * t)
    left = 1 - (np.abs(wave @ known) ** 2).sum(1) / ordinates
    return np.asarray(1 - (1 - left) * few / cycles)
