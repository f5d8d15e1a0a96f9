"""A body that is seen to ring: claims that allow for the loads that ring with it, where noise hides them.

What pulls at a soft body, as a joint to another one does, swings at the frequency at which the body rings,
and a smooth prior has no part in that. Force, moment and shape ring at one frequency, each by a size of its
own: the record is weighed with such a resonance at every frequency, of all sizes that noise may hide, against
none. Where it is seen, the claim is what the smoother would err by under each, weighed by its likelihood.
Source: as of `order_uncertainty`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from forceid.estimation.loads.hidden.inner_wheel import STRONG
from forceid.estimation.loads.hidden.left_out import least_band
from forceid.estimation.loads.hidden.order_uncertainty import claimed_along
from forceid.estimation.loads.hidden.whitened import FAINTEST, Whitened
from forceid.estimation.verdict.catalogue import note
from forceid.flight.color import Color
from forceid.flight.smoother import FlightState
from forceid.records import Array, Finding, Indices
from forceid.significance import OUTLIER, TENTH, WORSE

RING_DAMPINGS = (0.02, 0.06)  # of critical, of bodies that ring: steel in its joints, and rubber
RINGING_SIZES = np.geomspace(TENTH, 1 / FAINTEST, 7)  # over the noise at the peak, two a decade
NEXT_RING = 0.04  # from one frequency to the next, in logarithm: about the width of the sharper ones
RING_WIDTHS = 6.0  # half-widths of a resonance within which it is looked at: all but a tenth of its power


@dataclass(frozen=True)
class Spectrum:
    """Powers (ordinate, column) of what is white where nothing rings, each the sum of `count` columns.

    noise (ordinate, column): the share of the noise in it.
    """

    power: Array
    noise: Array
    count: float


@dataclass(frozen=True)
class Resonances:
    """Resonances tried: frequency Hz and evidence, over none, of each; hidden by load, (resonance, axis):
    the variance of what it does unseen to a load along the axes of its prior.
    """

    frequency: Array
    evidence: Array
    hidden: dict[str, Array]

    @property
    def gained(self) -> float:
        """Log-likelihood that the record gains by one at some frequency, over none."""
        return float(np.logaddexp.reduce(self.evidence) - np.log(len(self.evidence)))


def allow_for_ringing_body(
    looks: Mapping[str, Whitened], residual: Array, freedoms: int, state: FlightState, growth: Array
) -> tuple[Array, tuple[Finding, ...]]:
    """Growth ([time,] 6, 6) of claimed errors that allows for a body that rings; a finding if it does.

    residual (time, column) m: what the markers show beside their pose at the times of the channels; freedoms:
    as many columns as no pose fits away.
    """
    found = resonances(looks, residual, freedoms)
    if found is None or not found.gained > np.log(STRONG):
        return growth, ()
    weight = np.exp(found.evidence - np.logaddexp.reduce(found.evidence))
    own, more = np.eye(6), {name: weight @ hidden for name, hidden in found.hidden.items()}
    widest = 1.0
    for name, var in more.items():
        first = slice(0, 3) if name == "force" else slice(3, 6)
        axes = looks[name].prior.axes_along(state.rotation)
        if axes.ndim > own.ndim:
            own = np.tile(own, (len(axes), 1, 1))
        turned = growth[..., first, first]
        cov = turned @ state.wrench_cov[:, first, first] @ turned.mT
        factor = np.sqrt(1 + var / claimed_along(axes, cov))
        own[..., first, first] = axes * factor @ axes.mT
        widest = max(widest, float(factor.max()))
    if widest < WORSE:
        return np.asarray(own @ growth), ()
    force, moment = (
        float(np.sqrt(more[name].sum())) if name in more else 0.0 for name in ("force", "moment")
    )
    at = float(found.frequency[found.evidence.argmax()])
    return np.asarray(own @ growth), (note("body-rings", frequency_hz=at, force=force, moment=moment),)


def resonances(looks: Mapping[str, Whitened], residual: Array, freedoms: int) -> Resonances | None:
    """The resonances from where some load is not followed any more up to half of what samples show."""
    look = looks["force"]
    time = look.channel.time
    span, step = float(np.ptp(time)), float(np.median(np.diff(time)))
    ordinate: Array = np.fft.rfftfreq(len(time), step)[1:-1].astype(float)
    slowest = max(2 / span, min(least_band(one.channel, one.prior, one.rotation) for one in looks.values()))
    if not slowest < 0.25 / step:
        return None
    spectra, lost = {}, {}
    for name, one in looks.items():
        noise, smooth = one.densities(ordinate)
        power = np.abs(np.fft.rfft(one.innovation, axis=0)[1:-1]) ** 2 / one.seen
        spectra[name] = Spectrum(power, noise / (noise + smooth), 1.0)
        lost[name] = noise * (noise / (noise + smooth)) ** 2
    spectra["shape"] = shape_spectrum(time, residual, freedoms, look.channel.color)
    frequency, found = [], []
    hidden: dict[str, list[float]] = {name: [] for name in looks}
    for f in np.exp(np.arange(np.log(slowest), np.log(0.25 / step), NEXT_RING)):
        for damping in RING_DAMPINGS:
            width = damping * f + 0.25 / span  # Hz; no line is narrower than a record shows it
            near = np.flatnonzero(np.abs(ordinate - f) < RING_WIDTHS * width)
            line = width**2 / (width**2 + (ordinate[near] - f) ** 2)
            total = 0.0
            for name, spectrum in spectra.items():
                each = by_size(spectrum, near, line)
                gained = float(np.logaddexp.reduce(each)) - np.log(len(RINGING_SIZES))
                # a load alone may oscillate: the body is seen to ring where its shape does
                total += gained if name in looks or gained > 0 else -np.inf
                if name in looks:
                    size = float(np.exp(each - np.logaddexp.reduce(each)) @ RINGING_SIZES)
                    hidden[name].append(2 * size * ordinate[0] * line @ lost[name][near])
            frequency.append(f)
            found.append(total)
    if not np.isfinite(found).any():
        return None
    return Resonances(np.array(frequency), np.array(found), {n: np.array(h) for n, h in hidden.items()})


def by_size(spectrum: Spectrum, near: Indices, line: Array) -> Array:
    """Log-likelihood (size,) that resonances of a shape line (near,) gain at some ordinates."""
    ratio = 1 + RINGING_SIZES[:, None, None] * (line[:, None] * spectrum.noise[near])
    gained = (1 - 1 / ratio) * spectrum.power[near] - spectrum.count * np.log(ratio)
    return np.asarray(gained.sum((1, 2)))


def shape_spectrum(time: Array, residual: Array, freedoms: int, color: Color | None) -> Spectrum:
    """Of what the markers show beside their pose, summed over its columns, over the size of their errors."""
    y = residual - residual.mean(0)
    most = OUTLIER * np.maximum(y.std(0), np.finfo(float).tiny)
    power = (np.abs(np.fft.rfft(np.clip(y, -most, most), axis=0)[1:-1]) ** 2).sum(1, keepdims=True)
    if color is not None:
        w: Array = 2 * np.pi * np.fft.rfftfreq(len(time), float(np.median(np.diff(time))))[1:-1].astype(float)
        power = power / color.density(w)[:, None]
    return Spectrum(freedoms * power / power.mean(), np.ones_like(power), float(freedoms))
