"""What innovations say of a model: their size, their color, and lines that it leaves."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from forceid.estimation.verdict.catalogue import note
from forceid.records import Array, Finding, Level
from forceid.significance import DENIED, PATIENCE, SIGMAS

NIS_BAND = (0.6, 1.3)  # mean squared innovation over its covariance
AMISS = 1.5  # errors over those claimed, from which on a claim is too small to be called right
COLOR = 0.2  # autocorrelation of whitened innovations, beyond three standard errors, that is called color


def judge_innovations(
    time: Array,
    innovation: Array,
    nis: Array,
    reach: Array,
    exceeds: Array | None = None,
    wild_said: bool = False,
) -> list[Finding]:
    """Whether the innovations (time, channel) are as they were predicted to be, as far as claims rest on it.

    reach (channel,): load, over its claimed standard deviation, that moves a channel by one standard
    deviation of its measurement at 1 rad/s; exceeds (6,): variance of the wrench that they show over that
    claimed, NaN or None where they do not: then they have to be white, and as large as predicted; wild_said:
    whether wild ones have been named already.
    """
    if innovation.shape[1] == 0 or not np.isfinite(nis).any():
        return []
    found = []
    level, beyond = float(np.nanmean(nis)), np.full(6, np.nan) if exceeds is None else exceeds
    told = bool(np.isfinite(beyond).any())
    if told and (worst := float(np.nanmax(beyond))) > AMISS**2:
        k = int(np.nanargmax(beyond))
        load, axis = ("force", "moment")[k // 3], "xyz"[k % 3]
        found.append(note("innovations-in-band", load=load, axis=axis, times=np.sqrt(worst)))
    at_stake: Level = "ok" if told else "degraded"
    if not NIS_BAND[0] < level < NIS_BAND[1]:
        code = "innovations-small" if level < 1 else "innovations-large"
        found.append(note(code, at_stake, times=np.sqrt(level)))
    if (wild := wild_innovation(time, innovation, nis)) is not None and not wild_said:
        found.append(note("innovation-wild", sigma=wild[0], time_s=wild[1]))
    color, channel = lag_one_correlation(innovation)
    if color:
        found.append(note("innovations-correlated", at_stake, channel=channel, correlation=color))
    line, channel = strongest_line(time, innovation, reach)
    if line:
        found.append(note("innovations-line", channel=channel, frequency_hz=line))
    return found


CHANNELS = ("center x", "center y", "center z", "rotation x", "rotation y", "rotation z")


def wild_innovation(time: Array, innovation: Array, nis: Array) -> tuple[float, float] | None:
    """Largest whitened innovation, in standard deviations, and its time s; None where that may be chance.

    Chance is what the largest of so many exceeds in one record of ten thousand.
    """
    size = np.abs(np.nan_to_num(innovation)).max(1)
    k = int(size.argmax())
    limit = float(ndtri(1 - 0.5 * DENIED / max(np.isfinite(innovation).sum(), 1)))
    return (float(size[k]), float(time[k])) if size[k] > limit * max(np.sqrt(np.nanmean(nis)), 1.0) else None


def lag_one_correlation(innovation: Array) -> tuple[float, str]:
    """Largest lag-one autocorrelation of whitened innovations and its channel, if it is not chance."""
    worst, where = 0.0, ""
    for j, v in enumerate(innovation.T):
        pair = np.isfinite(v[1:]) & np.isfinite(v[:-1])
        size = np.abs(np.nan_to_num(v)).max(initial=0.0)
        if pair.sum() < 20 or size == 0:  # a channel that is met exactly has no color
            continue
        w = v / size
        r = float(np.mean(w[1:][pair] * w[:-1][pair]) / np.mean(w[np.isfinite(w)] ** 2))
        # as slow errors, so small ones cost less than the white ones that are claimed
        if float(np.nanmean(v**2)) * (1 + abs(r)) < 1 - abs(r):
            continue
        if abs(r) > max(COLOR, SIGMAS / np.sqrt(pair.sum())) and abs(r) > abs(worst):
            worst, where = r, CHANNELS[j]
    return worst, where


def strongest_line(time: Array, innovation: Array, reach: Array) -> tuple[float, str]:
    """Frequency Hz and channel of the line in the innovations that hides most load, zero where none does."""
    most, at, where = SIGMAS, 0.0, ""
    frequency = np.fft.rfftfreq(len(time), float(np.median(np.diff(time))))[1:-1]
    for j, v in enumerate(np.nan_to_num(innovation).T):
        power = np.abs(np.fft.rfft(v)[1:-1]) ** 2
        if len(power) < 8 or power.max() <= 2 * PATIENCE * max(power.mean(), 1e-300):
            continue
        k = int(power.argmax())
        hidden = 2 * np.sqrt(power[k]) / len(v) * (2 * np.pi * frequency[k]) ** 2 * reach[j]
        if hidden > most:
            most, at, where = hidden, float(frequency[k]), CHANNELS[j]
    return at, where
