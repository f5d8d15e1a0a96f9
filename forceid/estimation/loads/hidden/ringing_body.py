"""A body that is seen to ring: claims that allow for the loads that ring with it, where noise hides them.

What pulls at a soft body, as a joint to another one does, swings at the frequency at which the body rings,
and a smooth prior has no part in that. Force, moment and shape ring at one frequency, each by a size of its
own: the record is weighed with such a resonance at every frequency, of all sizes that noise may hide, against
none. Where it is seen, the claim is what the smoother would err by under each, weighed by its likelihood.
Source: as of `order_uncertainty`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from forceid.estimation.body.deforming.resonance import (
    NEXT_RING,
    RINGING_SIZES,
    Spectrum,
    by_size,
    near_resonances,
    ordinates_of,
)
from forceid.estimation.loads.hidden.inner_wheel import STRONG
from forceid.estimation.loads.hidden.left_out import least_band
from forceid.estimation.loads.hidden.order_uncertainty import claimed_along
from forceid.estimation.loads.hidden.whitened import Whitened
from forceid.estimation.verdict.catalogue import note
from forceid.flight.color import Color
from forceid.flight.smoother import FlightState
from forceid.records import Array, Finding, Indices
from forceid.significance import OUTLIER, WORSE


@dataclass(frozen=True)
class Shape:
    """What markers show beside their pose (time, column) m, at the times of the channels.

    freedoms: as many columns as no pose fits away; color: of the errors of a marker, which those that all
    markers share have no part in.
    """

    residual: Array
    freedoms: int
    color: Color | None


@dataclass(frozen=True)
class Ringing:
    """Loads that ring with a body, as far as a record does not rule them out, and how clearly it shows them.

    frequency (ordinate,) Hz; by load, (ordinate, axis) along the axes of its prior: noise, the density of its
    noise as a load, smooth, that of the prior, and power, the variance at each ordinate of a load that rings.
    gained: log-likelihood that a resonance at some frequency brings, over none, where the shape rings too;
    at: the likeliest frequency, Hz. growth ([time,] 6, 6): of claimed errors of a body that is seen to ring.
    """

    frequency: Array
    noise: dict[str, Array]
    smooth: dict[str, Array]
    power: dict[str, Array]
    gained: float
    at: float
    growth: Array = field(default_factory=lambda: np.eye(6))

    def hidden(self, load: str) -> Array:
        """Variance (axis,) of what the smoother in use takes for noise of it."""
        noise = self.noise[load]
        return np.asarray((self.power[load] * (noise / (noise + self.smooth[load])) ** 2).sum(0))

    def hidden_under(self, load: str, density: Array) -> Array:
        """The same (other,) of a load of density (ordinate, other), of whose axes each may have any of it."""
        noise, power = (a[load].mean(1, keepdims=True) for a in (self.noise, self.power))
        return np.asarray((power * (noise / (noise + density)) ** 2).sum(0))


def allow_for_ringing_body(
    looks: Mapping[str, Whitened], found: Ringing, state: FlightState, growth: Array
) -> tuple[Ringing, tuple[Finding, ...]]:
    """Loads that ring, with the growth of errors that claim `growth` ([time,] 6, 6) already, where the body
    is seen to ring; a finding if it is.
    """
    if not found.gained > np.log(STRONG):
        return found, ()
    own, more = np.eye(6), {name: found.hidden(name) for name in looks}
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
    found = replace(found, growth=own)
    if widest < WORSE:
        return found, ()
    force, moment = (
        float(np.sqrt(more[name].sum())) if name in more else 0.0 for name in ("force", "moment")
    )
    return found, (note("body-rings", frequency_hz=found.at, force=force, moment=moment),)


def ringing(looks: Mapping[str, Whitened], shape: Shape | None = None) -> Ringing | None:
    """Loads that ring, from where some load is not followed any more up to half of what samples show.

    Where the shape is not known, no body is seen to ring.
    """
    rung = ringing_alike([looks], [shape])
    return rung[0] if rung else None


def ringing_alike(each: Sequence[Mapping[str, Whitened]], shapes: Sequence[Shape | None]) -> list[Ringing]:
    """Loads that ring with each of several bodies, at one frequency with all of them, as what they pass to
    each other does; none where the loads of each are followed as far as samples show.
    """
    times = [looks["force"].channel.time for looks in each]
    fastest = min(0.25 / float(np.median(np.diff(time))) for time in times)
    slowest = max(
        max(2 / float(np.ptp(time)) for time in times),
        min(least_band(one.channel, one.prior, one.rotation) for looks in each for one in looks.values()),
    )
    if not slowest < fastest:
        return []
    frequencies = np.exp(np.arange(np.log(slowest), np.log(fastest), NEXT_RING))
    tried = [list(resonances(looks, shape, frequencies)) for looks, shape in zip(each, shapes, strict=True)]
    evidence = np.sum([[sum(one.gains.values()) for one in body] for body in tried], axis=0)
    weight = np.exp(evidence - np.logaddexp.reduce(evidence))
    # a load alone may oscillate: the body is seen to ring where its shape does, at the frequency of the loads
    found = []
    for looks, each_tried in zip(each, tried, strict=True):
        own = np.array([one.gains.get("shape", 0.0) for one in each_tried])
        gained = np.logaddexp.reduce(evidence) - np.logaddexp.reduce(evidence - own)
        seen = (own > 0) & (gained > np.log(STRONG))
        found.append(rung(looks, each_tried, weight, np.where(seen, evidence, -np.inf)))
    return found


@dataclass(frozen=True)
class Resonance:
    """One at some frequency, Hz: what it gains of each spectrum, over all sizes, and the mean of its size;
    which ordinates it is near to, and its line (near,) there.
    """

    frequency: float
    gains: dict[str, float]
    size: dict[str, float]
    near: Indices
    line: Array


def resonances(looks: Mapping[str, Whitened], shape: Shape | None, frequencies: Array) -> Iterator[Resonance]:
    """Resonances at some frequencies (frequency,) Hz, of each damping."""
    time = looks["force"].channel.time
    ordinate = ordinates_of(time)
    spectra = {}
    for name, one in looks.items():
        noise, smooth = one.densities(ordinate)
        power = np.abs(np.fft.rfft(one.innovation, axis=0)[1:-1]) ** 2 / one.seen
        spectra[name] = Spectrum(power, noise / (noise + smooth), 1.0)
    if shape is not None:
        spectra["shape"] = shape_spectrum(time, shape)
    for f, near, line in near_resonances(time, frequencies):
        each = {name: by_size(spectrum, near, line).sum(1) for name, spectrum in spectra.items()}
        gains = {n: float(np.logaddexp.reduce(e)) - float(np.log(len(e))) for n, e in each.items()}
        size = {n: float(np.exp(e - np.logaddexp.reduce(e)) @ RINGING_SIZES) for n, e in each.items()}
        yield Resonance(f, gains, size, near, line)


def rung(looks: Mapping[str, Whitened], tried: Sequence[Resonance], weight: Array, shown: Array) -> Ringing:
    """Loads that ring under resonances of some weight (resonance,); shown: evidence of those seen."""
    ordinate = ordinates_of(looks["force"].channel.time)
    densities = {name: one.densities(ordinate) for name, one in looks.items()}
    noise, smooth = ({name: pair[k] for name, pair in densities.items()} for k in (0, 1))
    power = {name: np.zeros_like(one) for name, one in noise.items()}
    for share, one in zip(weight, tried, strict=True):
        for name, each in noise.items():
            line = share * 2 * one.size[name] * ordinate[0] * one.line
            power[name][one.near] += line[:, None] * each[one.near]
    gained, at = float(np.logaddexp.reduce(shown) - np.log(len(shown))), tried[int(shown.argmax())].frequency
    return Ringing(ordinate, noise, smooth, power, gained, at)


def shape_spectrum(time: Array, shape: Shape) -> Spectrum:
    """Of a shape, summed over its columns, over the size of its errors."""
    y = shape.residual - shape.residual.mean(0)
    most = OUTLIER * np.maximum(y.std(0), np.finfo(float).tiny)
    power = (np.abs(np.fft.rfft(np.clip(y, -most, most), axis=0)[1:-1]) ** 2).sum(1, keepdims=True)
    if shape.color is not None:
        power = power / shape.color.density(2 * np.pi * ordinates_of(time))[:, None]
    return Spectrum(shape.freedoms * power / power.mean(), np.ones_like(power), float(shape.freedoms))
