"""Loads as fast as the modes of a body show them, where its poses do not follow them.

The same forces push the whole body and its modes. Smoothed loads on modes tell at every frequency how strong
they are, but noise goes through their smoother too: how much of it is known, and only what chance does not
make of it is a load. At its own frequency a mode rings by itself, and damping told a little wrong passes for
a load there: these frequencies tell nothing. Source: theory of one model, 2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.loads.hidden.left_out import densities
from forceid.estimation.verdict.catalogue import note
from forceid.flight.channels import Channel, middle
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.flight.vibration import Vibration
from forceid.kalman.building.lines import near
from forceid.kalman.building.process import matern_density
from forceid.records import Array, Finding
from forceid.significance import DENIED, TENTH

RINGING = 3.0  # bins about the frequency of a mode: a Hann window spreads a line over two, and damping more


@dataclass(frozen=True)
class ShownLoads:
    """Density (frequency,) N2/kg/Hz, two-sided, of loads on unit modal mass, at frequency (frequency,) Hz.

    Zero where modes show none.
    """

    frequency: Array
    density: Array


def loads_shown(time: Array, on_modes: Array, told: Array, prior: Vibration, size: Array) -> ShownLoads:
    """What smoothed loads on modes (time, mode) show of loads, in the mean of their logarithms over modes.

    told (mode, mode): information D^T D of a frame on the amplitudes, with noise of unit variance; prior: of
    the amplitudes that were smoothed; size (mode,) 1/sqrt(kg): load over that on unit modal mass.
    """
    run = middle(len(time))
    time, on_modes = time[run], on_modes[run] / size
    step = float(np.ptp(time)) / (len(time) - 1)
    frequency: Array = np.fft.rfftfreq(len(time), step)[1:].astype(float)
    taper = np.hanning(len(time))[:, None]
    waves = np.fft.rfft(taper * (on_modes - on_modes.mean(0)), axis=0)[1:]
    power = np.abs(waves) ** 2 * step / (taper**2).sum()
    noise = noise_of_smoothed(frequency, step, told, prior) / size**2
    by_chance = np.log(power.size / DENIED)  # of one ordinate of all, which are of an exponential law
    apart = np.abs(frequency[:, None] - prior.frequency / (2 * np.pi)) > RINGING * frequency[0]
    shown = (apart & (power > by_chance * noise)).any(1)
    logarithm = np.log(np.maximum(power, np.finfo(float).tiny))
    unit_mass = np.exp((apart * logarithm).sum(1) / np.maximum(apart.sum(1), 1))
    return ShownLoads(frequency, np.where(shown, unit_mass, 0.0))


def noise_of_smoothed(frequency: Array, step: float, told: Array, prior: Vibration) -> Array:
    """Density (frequency, mode) that noise makes of smoothed loads on modes.

    frequency Hz; told, prior: as of `loads_shown`. Of amplitudes of density P a smoother leaves the noise
    P (1 + T P)^-1 T (1 + P T)^-1 P, T = D^T D; samples show what differs by their rate as the same.
    """
    w = 2 * np.pi * (frequency[:, None] + np.array([-1.0, 0.0, 1.0])[:, None, None] / step)
    moved = 1 / ((prior.frequency**2 - w**2) ** 2 + (2 * prior.damping * w) ** 2)
    load = matern_density(prior.order, prior.load, prior.rate, w) / step
    gain, P = (load * np.sqrt(moved)).sum(0), (load * moved).sum(0)
    inverse = np.linalg.inv(np.eye(len(told)) + told * P[:, None, :])
    return np.asarray(gain**2 * step * np.einsum("fki,ij,fkj->fk", inverse, told, inverse, optimize=True))


def as_fast_as_on_modes(
    channels: Mapping[str, Channel],
    priors: Mapping[str, LoadPrior],
    state: FlightState,
    shown: ShownLoads,
    moved: Mapping[str, Array],
    rotation: Array,
) -> tuple[FlightState, list[Finding]]:
    """The state with claims that allow for loads as fast as modes show them, where poses do not follow these.

    moved (3, 3), by name: mass or inertia, world axes; rotation (time, 3, 3) of the body. At a frequency a
    smoother that follows the share G of a load errs by (1 - G)^2 of it, of which its claim has what its own
    prior expects; a line that it holds is followed. The record denies what would be stronger than the noise.
    The finding says from which frequency on, where the variance claimed grows by half or more.
    """
    clock, cov, findings = channels["moment"].time, state.wrench_cov.copy(), []
    frequency = shown.frequency
    for name, unit, own in (("force", "N", slice(0, 3)), ("moment", "N m", slice(3, 6))):
        if name not in channels:
            continue
        noise, smooth, axes = densities(channels[name], priors[name], frequency, rotation)
        along = np.diagonal(axes.T @ moved[name] @ axes)
        hidden = np.minimum(along * shown.density[:, None], noise) - smooth
        missed = (noise / (noise + smooth)) ** 2 * np.maximum(hidden, 0.0)
        held = [line.frequency for line in priors[name].lines]
        missed[[near(f, held, clock) for f in frequency]] = 0.0
        added = 2 * missed.sum(0) * frequency[0]
        claimed = np.nanmean(np.einsum("ai,tab,bi->ti", axes, cov[:, own, own], axes), axis=0)
        cov[:, own, own] += (axes * added) @ axes.T
        worst = int((added / claimed).argmax())
        if added[worst] > 0.5 * claimed[worst]:
            below = np.cumsum(missed[:, worst]) < TENTH * missed[:, worst].sum()
            findings.append(
                note(
                    "faster-on-modes",
                    load=name,
                    frequency_hz=float(frequency[below.sum()]),
                    hidden=float(np.sqrt(added[worst])),
                    unit=unit,
                    claim=float(np.sqrt(claimed[worst] + added[worst])),
                )
            )
    return replace(state, wrench_cov=cov), findings
