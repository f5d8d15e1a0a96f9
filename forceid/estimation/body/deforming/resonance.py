"""Resonances in what is white without them: of any frequency, damping and size, all as likely beforehand.

An oscillation far below the noise of a sample stands out of that of a record, where a smooth prior shows
none of it. Source: Whittle (1953), as of `forceid.flight.whittle`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from forceid.records import Array, Indices
from forceid.significance import OUTLIER, TENTH

LOUDEST = 100.0  # largest power over the noise at the peak: ten standard deviations
RING_DAMPINGS = (0.02, 0.06)  # of critical, of bodies that ring: steel in its joints, and rubber
RINGING_SIZES = np.geomspace(TENTH, LOUDEST, 7)  # over the noise at the peak, two a decade
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


def ordinates_of(time: Array) -> Array:
    """Frequencies (ordinate,) Hz of a record, without that of its mean and the highest."""
    return np.asarray(np.fft.rfftfreq(len(time), float(np.median(np.diff(time))))[1:-1], float)


def near_resonances(time: Array, frequencies: Array) -> Iterator[tuple[float, Indices, Array]]:
    """Of resonances at some frequencies (frequency,) Hz, of each damping, which ordinates of a record are
    near to it, and its line (near,) there.
    """
    span, ordinate = float(np.ptp(time)), ordinates_of(time)
    for f in frequencies.tolist():
        for damping in RING_DAMPINGS:
            width = damping * f + 0.25 / span  # Hz; no line is narrower than a record shows it
            near = np.flatnonzero(np.abs(ordinate - f) < RING_WIDTHS * width)
            yield f, near, width**2 / (width**2 + (ordinate[near] - f) ** 2)


def by_size(spectrum: Spectrum, near: Indices, line: Array) -> Array:
    """Log-likelihood (size, column) that resonances of a shape line (near,) gain at some ordinates."""
    ratio = 1 + RINGING_SIZES[:, None, None] * (line[:, None] * spectrum.noise[near])
    gained = (1 - 1 / ratio) * spectrum.power[near] - spectrum.count * np.log(ratio)
    return np.asarray(gained.sum(1))


def ringing_gain(time: Array, q: Array, var: float) -> Array:
    """Log-likelihood (mode,) of amplitudes q (time, mode) that ring, each at a frequency of its own, over
    that of white noise of variance var; none where a record is too short to hold two of their periods.
    """
    ordinate = ordinates_of(time)
    highest = ordinate.max(initial=np.finfo(float).tiny)
    tried = np.exp(np.arange(np.log(2 / np.ptp(time)), np.log(highest), NEXT_RING))
    if not tried.size or not q.shape[1]:
        return np.zeros(q.shape[1])
    y = q - np.nanmean(q, axis=0)
    y = np.nan_to_num(np.clip(y, *(k * OUTLIER * np.nanstd(q, axis=0) for k in (-1, 1))))
    power = np.abs(np.fft.rfft(y, axis=0)[1:-1]) ** 2 / (var * np.isfinite(q).sum(0))
    spectrum = Spectrum(power, np.ones((len(power), 1)), 1.0)
    each = np.concatenate([by_size(spectrum, near, line) for _, near, line in near_resonances(time, tried)])
    return np.asarray(np.logaddexp.reduce(each) - np.log(len(each)))
