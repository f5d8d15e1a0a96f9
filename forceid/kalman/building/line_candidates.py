"""Frequencies at which a line stands out of whitened innovations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import median_filter

from forceid.kalman.building.lines import Line
from forceid.records import Array
from forceid.significance import MEDIAN, OUTLIER, PATIENCE, SIGMAS

CYCLES_BESIDE = 16  # cycles a record, to either side, over which the level about a line is taken


@dataclass(frozen=True)
class Candidate:
    """A frequency Hz at which a line may be.

    named: beforehand, so that it is not searched for; known: nor is it uncertain, as that of the spin;
    stands: minus the logarithm of the chance that noise stands out as much.
    """

    frequency: float
    named: bool
    known: bool = False
    stands: float = field(default=0.0, compare=False)


def line_candidates(
    time: Array, innovation: Array, spin: float, lines: Iterable[Line] = (), looked: Iterable[float] = ()
) -> list[Candidate]:
    """Frequencies that stand out of whitened innovations (time, channel), strongest first.

    Channels: along x, y, z, and others such behind them, each three a look at the same. They stand out by
    minus the logarithm of the chance that noise gives one channel, or all together, as much. A harmonic
    (once, twice) of the spin (Hz) and a line that the prior holds along other axes need PATIENCE; any other
    frequency more, by the logarithm of how many there are. Not lines that the prior holds along the axis of
    the channel, nor frequencies looked at already.
    """
    span, count = float(np.ptp(time)), len(time)
    step = span / (count - 1)
    frequency = np.fft.rfftfreq(2 * count, step)[1:-1]
    highest = highest_shown(time, innovation)
    v = winsorized(innovation)
    power = np.abs(np.fft.rfft(v, 2 * count, axis=0)[1:-1]) ** 2
    share = power / local_level(v)[1:-1] / np.maximum((v**2).sum(0), 1.0)
    looks = share.reshape(len(share), -1, 3)
    for line in lines:
        near = np.abs(frequency - line.frequency) * span <= 1
        looks[np.ix_(near, np.arange(looks.shape[1]), line.taken)] = 0.0
    joint = looks.sum(2).max(1)  # of three channels, a gamma variate
    stands = np.maximum(share.max(1), joint - np.log1p(joint + 0.5 * joint**2))
    for f in looked:
        stands[np.abs(frequency - f) * span <= 1] = 0.0
    stands[(frequency * span < 2) | (frequency >= highest)] = 0.0  # so slow is any smooth load
    harmonics = [h for h in (spin, 2 * spin) if 0 < h < highest]
    found: list[Candidate] = []
    for h in (*harmonics, *(line.frequency for line in lines)):
        near = np.abs(frequency - h) * span <= 1
        if (best := stands[near].max(initial=0.0)) > PATIENCE:
            found.append(Candidate(h, named=True, known=h in harmonics, stands=best))
        stands[near] = 0.0
    while stands.max(initial=0.0) > PATIENCE + np.log(2 * count):
        k = int(stands.argmax())
        found.append(Candidate(float(frequency[k]), named=False, stands=stands[k]))
        stands[np.abs(frequency - frequency[k]) * span <= 2] = 0.0
    return sorted(found, key=lambda candidate: -candidate.stands)


def is_white(innovation: Array) -> bool:
    """Whether no frequency stands out of whitened innovations (time, channel), slow ones as well."""
    v = winsorized(innovation)
    power = np.abs(np.fft.rfft(v, 2 * len(v), axis=0)) ** 2 / np.maximum((v**2).sum(0), 1.0)
    return bool(power.max(initial=0.0) < PATIENCE + np.log(2 * len(v)))


def highest_shown(time: Array, innovation: Array) -> float:
    """Half the rate, Hz, of the frames that innovations (time, channel) are of: beyond it lines are mirrored.

    >>> highest_shown(np.arange(5) / 10, np.array([[0.1], [np.nan], [0.2], [np.nan], [0.1]])).__round__(9)
    2.5
    """
    told = time[np.isfinite(innovation).any(1)]
    return 0.5 / float(np.median(np.diff(told))) if len(told) > 1 else 0.0


def local_level(v: Array) -> Array:
    """Mean square of innovations (time, channel) about each half cycle a record, over all.

    A line stands out of its neighbors. What a prior without one makes of it is a load far too strong at all
    frequencies about it: there the innovations are small. And where a prior falls short over a band they are
    large there, of a record that is long enough to tell; lines without number would stand out of a white
    level. One, unless the neighbors say otherwise beyond chance. Half of the ordinates of white noise exceed
    log 2 of their mean.
    """
    power = np.abs(np.fft.rfft(v, 2 * len(v), axis=0)) ** 2 / np.maximum((v**2).sum(0), 1.0)
    # relative, of a median of so many that are independent
    chance = SIGMAS / np.log(2) / np.sqrt(2 * CYCLES_BESIDE)
    around = np.stack([median_filter(one, 4 * CYCLES_BESIDE + 1) for one in power.T], 1) / np.log(2)
    quiet = np.clip(around * (1 + chance), 1 / len(v), 1.0)
    return np.asarray(np.where(around > 1 + chance, around, quiet))


def winsorized(innovation: Array) -> Array:
    """Innovations (time, channel) with outliers held back, zero at gaps; what most show is none."""
    v = np.nan_to_num(innovation)
    typical = np.maximum(np.median(np.abs(v), axis=0) / MEDIAN, 1.0)  # of normal samples, their deviation
    return np.asarray(np.clip(v, -OUTLIER * typical, OUTLIER * typical))
