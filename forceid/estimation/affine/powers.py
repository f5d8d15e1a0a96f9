"""What a record shows of load and noise at every frequency, from innovations whitened under a rough prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forceid.flight.channels import CHANNEL_SAMPLES, driven, load_chain, start_of
from forceid.flight.priors.protocol import Kernel
from forceid.kalman.building.process import Process, resonator
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.significance import OUTLIER


@dataclass(frozen=True)
class Axes:
    """What loads drive, z'' = load: z (time, axis), with noise_var (time, axis) and drift (axis,)."""

    time: Array
    z: Array
    noise_var: Array
    drift: Array


@dataclass(frozen=True)
class Resonance:
    """A line of std (axis,) N m at frequency w rad/s, whose phase is forgotten at bandwidth 1/s."""

    w: float
    bandwidth: float
    std: Array


def richest(seen: Axes) -> Axes:
    """Of a long record, the CHANNEL_SAMPLES in a row of which most are seen; a shorter one as it is."""
    if len(seen.time) <= CHANNEL_SAMPLES:
        return seen
    count = np.concatenate([[0], np.cumsum(np.isfinite(seen.z).all(1))])
    first = int((count[CHANNEL_SAMPLES:] - count[:-CHANNEL_SAMPLES]).argmax())
    part = slice(first, first + CHANNEL_SAMPLES)
    return Axes(seen.time[part], seen.z[part], seen.noise_var[part], seen.drift)


@dataclass(frozen=True)
class Powers:
    """Two-sided power of total, noise and prior (frequency, axis) of loads, per rad/s, at w rad/s."""

    w: Array
    total: Array
    noise: Array
    prior: Array


def powers(kernel: Kernel, seen: Axes, engine: Engine, resonances: Sequence[Resonance] = ()) -> Powers:
    """What a record shows of load and noise at every frequency, under a prior that whitens it roughly."""
    time, step = seen.time, float(np.median(np.diff(seen.time)))
    w: Array = 2 * np.pi * np.fft.rfftfreq(len(time), step)[1:].astype(float)
    lines = [resonator(s.w / (2 * np.pi), s.std, s.bandwidth) for s in resonances]
    chain = load_chain(kernel.process, start_of(time, seen.z, 1.0), lines)
    white = np.empty((len(w), seen.z.shape[1]))
    for a in range(seen.z.shape[1]):
        own = Process(chain.A[a][None], chain.Qc[a][None], chain.P0[a][None], chain.output)
        m = driven(own, 1.0, seen.noise_var[:, a, None], seen.drift[a, None], np.diff(time))
        m = StateSpace(m.F[:, 0], m.Q[:, 0], m.H[:, 0], m.R[:, 0], m.x0[0], m.P0[0])
        innovation = engine.filter(m, seen.z[:, a, None]).innovation[:, 0]
        v = np.clip(np.nan_to_num(innovation), -OUTLIER, OUTLIER)
        white[:, a] = np.abs(np.fft.rfft(v)[1:]) ** 2 / np.isfinite(innovation).sum()
    difference = (2 * np.sin(0.5 * w * step) / step)[:, None]
    known = np.isfinite(seen.z)
    var = known.sum(0) / np.where(known, 1 / seen.noise_var, 0.0).sum(0)  # of frames that show the most
    noise = step * var * difference**4 + seen.drift * difference**2
    prior = kernel.density(w[:, None])
    for s in resonances:
        near, far = (s.bandwidth / (s.bandwidth**2 + (w + sign * s.w) ** 2) for sign in (-1, 1))
        prior += s.std**2 * (near + far)[:, None]
    return Powers(w, white * (prior + noise), np.asarray(noise), np.asarray(prior))
