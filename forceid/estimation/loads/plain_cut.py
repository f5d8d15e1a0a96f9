"""Where to cut a record off before it is differentiated twice: by its own spectrum, without a noise model.

Errors of tracks are white, or rise toward low frequencies as a random walk does, by 4 an octave in power;
what a load moves falls by its two integrals alone by 16 an octave. So, from the highest frequency down, the
first octave in which the spectrum of the positions rises by more than STEEP is where the motion begins. Where
it does so from the very top, errors were smoothed at the source, or the load goes on beyond: then the cut is
in the first valley of the spectrum of the acceleration above where the velocity has most.
Winter's residual analysis (Biomechanics and Motor Control of Human Movement, 2.2.4.5) by octaves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from forceid.estimation.verdict.finding import BRIDGED
from forceid.records import Array, Flags, Indices

STEEP = 8.0  # in power, an octave: midway between what errors rise by (4) and what motion does (16)
VALLEY = 4.0  # in power, an octave: as the acceleration of errors like a random walk rises
RATIO_CHANCE = 0.05  # of taking so large a ratio of two levels for real where they are equal
KNOWN_DOF = 40.0  # degrees of freedom by which a level is known to within a quarter
UNKNOWN_DOF = 10.0  # degrees of freedom below which a level says little
OCTAVE = 4  # bands that an octave of frequencies is looked at in
STRETCH = 0.35  # cycles a sample up to which a cut is worth making


@dataclass(frozen=True)
class MotionSpectrum:
    """Spectrum (bin, channel) at `frequency` (bin,) Hz > 0 of a record, over the shape of its noise.

    power: variance a sample of noise that has as much, white above a corner, a walk below;
    moved (bin, channel): what second differences over step^2 make of one of unit variance; dof: chi-square
    degrees of freedom of a bin; step s.
    """

    frequency: Array
    power: Array
    moved: Array
    dof: float
    step: float


@dataclass(frozen=True)
class Cut:
    """A cut-off in Hz, and the noise beside it: its variance a sample as above the cut, and the degrees of
    freedom that is known by.
    """

    frequency: float
    noise: float
    dof: float


def spectrum_of(time: Array, z: Array, corner: Array | float = 0.0) -> MotionSpectrum:
    """Spectrum of a record z (time, channel), no gaps, of which the second differences count.

    corner (channel,) Hz: below it, noise adds up, and rises as 1 + (corner / f)^2; zero for white noise.
    What accelerates alike all the time, as a weight does, has no frequency and is left out.
    """
    frequency, bent, dof, step = second_difference_spectrum(time, z, varying=True)
    f = frequency[1:, None]
    moved = (2 * np.sin(np.pi * f * step) / step) ** 4 * (1 + (np.asarray(corner) / f) ** 2)
    moved = np.broadcast_to(moved, bent[1:].shape)
    return MotionSpectrum(frequency[1:], bent[1:] / moved, moved, dof, step)


def second_difference_spectrum(
    time: Array, z: Array, varying: bool = False
) -> tuple[Array, Array, float, float]:
    """Frequency (bin,) Hz and power (bin, channel) of the second differences of z over step^2; dof; step s.

    varying: without their mean, which the taper would spread over the first bins.

    The first bin and twice the others, summed and over the samples, are the mean square weighted by the
    square of the taper.
    Tapered by sin^4, whose side lobes fall by 30 dB an octave: the noise at high frequencies is larger by
    some 100 dB. An irregular clock is put on a regular one by straight lines.
    """
    n = len(time)
    step = float(np.ptp(time)) / (n - 1)
    regular = time[0] + step * np.arange(n)
    if np.abs(regular - time).max() > 1e-6 * step:
        z = np.stack([np.interp(regular, time, column) for column in z.T], 1)
    bent = np.diff(z, 2, axis=0) / step**2
    taper = tapered(n - 2)
    if varying:
        bent = bent - (taper @ bent) / taper.sum()
    power = np.abs(np.fft.rfft(bent * taper[:, None], axis=0)) ** 2 / (taper**2).sum()
    dof = 2 * float((taper**2).sum() ** 2 / ((taper**4).sum() * (n - 2)))
    return np.asarray(np.fft.rfftfreq(n - 2, step)), np.asarray(power), dof, step


def apiece(time: Array, beside: Array, lost: Indices) -> Array:
    """What a channel has beside a path (sample,), without a line of its own in each part between long gaps.

    lost (sample,): samples of the load that are not given before each. What it gave there is a jump in place
    and slope behind.
    """
    ends = np.flatnonzero(np.diff(lost) > BRIDGED) + 1
    if not len(ends):
        return beside
    parts = zip(np.split(time, ends), np.split(beside, ends), strict=True)
    return np.concatenate([z - np.polyval(np.polyfit(t, z, min(len(t) - 1, 1)), t) for t, z in parts])


def tapered(n: int) -> Array:
    """The taper sin^4 of n samples, 1 in the middle."""
    return np.asarray(np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 4)


def plain_cuts(found: MotionSpectrum) -> list[Cut]:
    """The cut of every channel of a spectrum."""
    cuts = []
    for power, moved in zip(found.power.T, found.moved.T, strict=True):
        band, level, dof = band_means(found, power)
        if (i := motion_begins(level, dof)) is None:
            fastest = int(np.argmax(level * band**2))
            i = first_valley(band_means(found, power * moved)[1], dof, fastest)
        cuts.append(least_risk(found, power, moved, band[i]))
    return cuts


def shows_motion(found: MotionSpectrum) -> bool:
    """Whether the channels of a spectrum, taken together, show motion beside noise.

    >>> t, rng = np.arange(200) / 100, np.random.default_rng(0)
    >>> z = 1e-3 * rng.standard_normal((200, 6))
    >>> shows_motion(spectrum_of(t, z)), shows_motion(spectrum_of(t, z + 0.01 * np.sin(9 * t[:, None])))
    (False, True)
    """
    _, level, dof = band_means(found, found.power.mean(1))
    if len(level) <= OCTAVE:
        return False
    return bool(steep(level, dof * found.power.shape[1]).any())


def band_means(found: MotionSpectrum, power: Array) -> tuple[Array, Array, Array]:
    """Middle (band,) of bands that overlap, Hz, mean of power (bin,) in each, degrees of freedom."""
    f, half = found.frequency, 2 ** (1 / OCTAVE)
    top = max(min(f[-1], STRETCH / found.step) / half, f[0])
    band = top * half ** -np.arange(int(np.log2(top / f[0]) * OCTAVE) + 1)[::-1]
    first = np.minimum(np.searchsorted(f, band / half), len(f) - 1)
    last = np.maximum(np.searchsorted(f, band * half), first + 1)
    total = np.concatenate([[0.0], np.cumsum(power)])
    return band, (total[last] - total[first]) / (last - first), found.dof * (last - first)


def steep(level: Array, dof: Array) -> Flags:
    """Bands (band - OCTAVE,) from which an octave falls as motion does, by more than chance."""
    return np.asarray(
        level[:-OCTAVE]
        > np.maximum(STEEP, fdtri(dof[:-OCTAVE], dof[OCTAVE:], 1 - RATIO_CHANCE)) * level[OCTAVE:]
    )


def motion_begins(level: Array, dof: Array) -> int | None:
    """The band half an octave above the highest octave that rises as motion does; None: it is the top."""
    if len(level) <= OCTAVE:
        return 0
    falls = steep(level, dof)
    if not falls.any():
        return 0
    highest = int(np.flatnonzero(falls)[-1])
    return None if highest == len(falls) - 1 else highest + OCTAVE // 2


def first_valley(level: Array, dof: Array, start: int) -> int:
    """The band of the least level (band,) from `start` to the first octave that rises for good."""
    best = start
    for i in range(start, len(level)):
        if level[i] < level[best]:
            best = i
        grown = max(VALLEY, float(fdtri(dof[i], dof[best], 1 - RATIO_CHANCE)))
        if i >= best + OCTAVE and level[i] > grown * level[best]:
            break
    return best


def least_risk(found: MotionSpectrum, power: Array, moved: Array, about: float) -> Cut:
    """The cut of a quintic spline, within an octave of `about`, whose second derivative errs least.

    By Mallows' risk, sum of w^4 [(1 - G)^2 (P - N) + G^2 N], with the noise N of the octave above. The noise
    returned is that of as many octaves as tell it, or of the first where that is larger by more than chance.
    """
    f = found.frequency
    low = min(int(np.searchsorted(f, 1.4 * about)), max(len(f) - 3, 0))
    octave = min(max(int(np.searchsorted(f, 2.8 * about)), low + int(UNKNOWN_DOF / found.dof)), len(f))
    high = min(max(octave, low + int(KNOWN_DOF / found.dof)), len(f))
    near, wide = float(power[low:octave].mean()), float(power[low:high].mean())
    cuts = about * 2 ** (np.arange(-2 * OCTAVE, 2 * OCTAVE + 1) / (2 * OCTAVE))
    gain = 1 / (1 + (f[:octave, None] / cuts) ** 6)
    left = (power[:octave] - near)[:, None]
    risk = (moved[:octave, None] * ((gain**2 - 2 * gain) * left + gain**2 * near)).sum(0)
    dof = found.dof * (octave - low), found.dof * (high - low)
    louder = near > float(fdtri(*dof, 1 - RATIO_CHANCE)) * wide
    cutoff = float(f"{cuts[np.argmin(risk)]:.12g}")  # of a ladder that axes share, without its rounding
    return Cut(cutoff, near if louder else wide, dof[0] if louder else dof[1])
