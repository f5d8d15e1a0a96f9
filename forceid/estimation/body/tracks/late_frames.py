"""Frames that come early or late against their times: errors along the motion, of place and turn together.

A frame that is late by d shows the pose of another time: it is off by d times velocity and spin. What all
markers share is not in what no motion makes; along the motion, and not across it, differences show it.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import uniform_filter1d
from scipy.special import binom

from forceid.estimation.body.tracks.bridging import straight
from forceid.flight.path.reference import COARSE
from forceid.kalman.building.line_candidates import winsorized
from forceid.motion import ORDER, Pose, log, second_order
from forceid.records import Array
from forceid.significance import PATIENCE, SIGMAS, TENTH

DELAYS = np.geomspace(1e-4, 1.0, 81)  # that are tried, as parts of a frame


def lateness(time: Array, pose: Pose) -> tuple[float, Array] | None:
    """Standard deviation of the delays (s), and velocity and spin (time, 6) of the frames, world axes.

    pose: of every frame, with the covariance that its markers give it. None unless delays are e^PATIENCE
    times as likely as errors that are as large across the motion as along it; nor on an irregular clock, nor
    where turns from frame to frame are so large that their differences show no rate, or errors of a turn move
    the mass center by their square, which is not along the motion either.
    """
    seen = np.flatnonzero(np.isfinite(pose.center).all(1) & np.isfinite(pose.rotation).all((1, 2)))
    if len(seen) < 4 * ORDER or np.ptp(np.diff(time)) > DELAYS[0] * np.ptp(time):
        return None
    if second_order(pose.cov[seen]).max() > TENTH:
        return None
    step, R = float(np.median(np.diff(time))), pose.rotation[seen]
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(log(R[1:] @ R[:-1].mT), 0)])
    path = np.concatenate([pose.center[seen], turned], 1)
    if np.linalg.norm(np.diff(turned, axis=0), axis=1).max() > COARSE:
        return None
    each = sliding_window_view(path, ORDER + 1, axis=0)
    steady = np.ptp(sliding_window_view(seen, ORDER + 1), axis=1) == ORDER
    if steady.sum() < 2 * ORDER:
        return None
    k = np.arange(ORDER + 1)
    signed = np.asarray((-1.0) ** k * binom(ORDER, k), np.float64)
    weight = np.asarray(signed / np.linalg.norm(signed), np.float64)
    # so many differences in a row tell as much as one by itself
    overlap = float((np.correlate(weight, weight, "full") ** 2).sum())
    d, rate = (each @ weight)[steady], ((each[..., -1] - each[..., 0]) / (ORDER * step))[steady]
    cov = pose.cov[seen][ORDER // 2 : len(seen) - ORDER // 2][steady]
    v, own = rate[:, :3], np.finfo(float).tiny
    across = d[:, :3] - v * ((d[:, :3] * v).sum(1) / ((v**2).sum(1) + own))[:, None]
    expected = np.trace(cov[:, :3, :3], axis1=1, axis2=2) * 2 / 3
    cov = cov * max(1.0, float((across**2).sum(1).mean() / expected.mean()))
    whitened = np.linalg.solve(cov, rate[..., None])[..., 0]
    told, along = (whitened * rate).sum(1), (whitened * d).sum(1)
    v = winsorized((along / np.sqrt(told + own))[:, None])[:, 0]  # a blow is long over for most frames
    if not stands_throughout(v, weight):
        return None
    along = np.sqrt(told) * v
    var = (DELAYS[:, None] * step) ** 2
    gain = 0.5 * (var * along**2 / (1 + var * told) - np.log1p(var * told)).sum(1) / overlap
    best = int(gain.argmax())
    if gain[best] < PATIENCE:
        return None
    speed = uniform_filter1d(np.gradient(path, time[seen], axis=0), 2 * ORDER + 1, axis=0, mode="nearest")
    return float(DELAYS[best] * step), straight(time, time[seen], speed)


def stands_throughout(v: Array, weight: Array) -> bool:
    """Whether differences v (time,) by weights, white of size one before, are larger at most frequencies.

    Delays of frames have nothing to do with each other. An oscillation is larger at one frequency alone, and
    a load that varies smoothly at low ones. Half of the ordinates of white noise exceed log 2 of their mean.
    """
    expected = np.abs(np.fft.rfft(weight, len(v))) ** 2
    power = np.abs(np.fft.rfft(v)) ** 2 / len(v)
    shown = expected > TENTH * expected.max()
    level = np.median(power[shown] / expected[shown]) / np.log(2)
    return bool(level > 1 + SIGMAS / np.log(2) / np.sqrt(shown.sum()))
