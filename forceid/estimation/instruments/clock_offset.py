"""Clocks of sensors that are off by more than a sample: found by what the markers let them expect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.errors import EstimationError
from forceid.flight.instruments.sensors import sensed
from forceid.flight.model import Flight, moved_along, steady_of
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import settled
from forceid.kalman.engines import Engine
from forceid.records import Array

FARTHEST = 0.25  # of the record, by which a clock is looked for


def align_clocks(flight: Flight, force: LoadPrior, moment: LoadPrior, engine: Engine) -> Flight:
    """A flight whose sensors are put on the samples at which they most likely read, to a whole step.

    The lag of sensors of a kind is the one at which they read what comes nearest to what the flight of the
    markers alone lets them read, biases aside. As it was where clocks agree, where the clock of the recording
    is irregular, and where markers alone do not settle.
    """
    sensors, step = flight.sensors, np.diff(flight.time)
    if sensors is None or not len(sensors.clocked) or np.ptp(step) > 1e-3 * np.median(step):
        return flight
    try:
        about = settled(replace(flight, sensors=None), force, moment, engine)[3]
    except EstimationError:
        return flight
    expected = sensed(sensors, moved_along(flight, force, about), steady_of(sensors, about)).reading
    shifted, reading = sensors.shifted.copy(), sensors.reading.copy()
    read = sensors.readings[:, sensors.used]
    for i in sensors.clocked:
        lag = best_lag(read[:, sensors.kind == i], expected[:, sensors.kind == i])
        reading[:, i] = later_by(reading[:, i], lag)
        shifted[i] = lag * float(np.median(step))
    return replace(flight, sensors=replace(sensors, reading=reading, shifted=shifted))


def best_lag(read: Array, expected: Array) -> int:
    """Samples by which `read` (time, channel) is behind its time: where it comes nearest to `expected`.

    >>> t = np.arange(100)[:, None]
    >>> best_lag(np.sin(0.1 * (t + 3)) + 5, np.sin(0.1 * t))
    3
    """

    def miss(lag: int) -> float:
        off = later_by(read, lag) - expected
        off = off - np.nanmean(off, 0)
        return float(np.nanmean(off**2))

    most = int(FARTHEST * len(read))
    return min(sorted(range(-most, most + 1), key=abs), key=miss)


def later_by(values: Array, lag: int) -> Array:
    """Values (time, ...) put on samples so many later; NaN where none come."""
    out = np.full_like(values, np.nan)
    kept = slice(max(lag, 0), len(values) + min(lag, 0))
    out[kept] = values[max(-lag, 0) : len(values) - max(lag, 0)]
    return out
