"""Clocks of sensors: off by more than a sample, and fine enough for the turn of a body.

A clock that is off is found by what the markers let its sensors expect. The model of a flight takes what a
load adds to the spin over a step to grow as a parabola in time, and a load that turns with the body to turn
about one axis. Both hold where the body turns by little in a step, whatever the sample rate: between samples
that are read stand others at which nothing is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.errors import EstimationError
from forceid.flight.instruments.dead_reckoning import gyro_rate
from forceid.flight.instruments.sensors import sensed
from forceid.flight.model import Flight
from forceid.flight.path.linear import moved_along, steady_of
from forceid.flight.path.reference import Reference
from forceid.flight.path.settling import first_reference, settled
from forceid.flight.priors.protocol import MOMENTUM, LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.motion import free_turn
from forceid.records import Array, Indices

# rad that a body turns in a step: a load that turns with it adds to the spin as a sine does, of which a
# parabola with the right value and mean misses the turn cubed over 72 sqrt(3) at most, a two-thousandth
TURN = 0.4
MOST_STEPS = int(np.ceil(2 * np.pi / TURN))  # between two samples, of a whole turn: no record gets too long
FARTHEST = 0.25  # of the record, by which a clock is looked for


def largest_step(flight: Flight, time: Array) -> float:
    """Largest angle rad that a body turns by in a step of a clock, at the fastest that its gyros read."""
    rate = gyro_rate(flight.time, flight.sensors)
    fastest = 0.0 if rate is None else float(np.linalg.norm(rate, axis=1).max())
    return fastest * float(np.diff(time).max(initial=0.0))


def refined(flight: Flight) -> tuple[Flight, Indices]:
    """The flight of a rigid body on a clock by whose steps it turns by TURN, and where its own samples are.

    By the fastest that the gyros read: a free body that they read slow may be fast in between.
    """
    step = np.diff(flight.time)
    turn = largest_step(flight, flight.time) * step / step.max(initial=0.0)
    parts = np.clip(np.ceil(turn / TURN), 1, MOST_STEPS).astype(int)
    at = np.concatenate([[0], np.cumsum(parts)])
    if len(flight.time) == at[-1] + 1:
        return flight, at
    owner = np.repeat(np.arange(len(step)), parts)
    share = (np.arange(at[-1]) - at[owner]) / parts[owner]
    time = np.append(flight.time[owner] + share * step[owner], flight.time[-1])
    last = np.append(owner, len(step))
    sensors = flight.sensors
    if sensors is not None:
        sensors = replace(sensors, reading=only_at(at, sensors.reading))
    fine = Flight(
        time, only_at(at, flight.center), only_at(at, flight.rotation), flight.pose_cov[last], flight.mass,
        flight.inertia[last], flight.h[last], flight.gravity, sensors,
    )  # fmt: skip
    return fine, at


def only_at(at: Indices, a: Array) -> Array:
    """Values (sample, ...) on a finer clock, NaN where that has no sample."""
    out = np.full((at[-1] + 1, *a.shape[1:]), np.nan)
    out[at] = a
    return out


def refined_reference(
    flight: Flight, fine: Flight, at: Indices, force: LoadPrior, moment: LoadPrior
) -> Reference:
    """Where a fine flight is first linearized: between the samples of its own clock the body turns freely."""
    first = first_reference(flight, moment)
    last = np.searchsorted(at, np.arange(at[-1] + 1), "right") - 1
    H = first.chain[last, MOMENTUM]
    since = fine.time - flight.time[last]
    R = free_turn(since, first.rotation[last], H @ moment.axes.T, fine.inertia, fine.h)[0]
    pushed = np.zeros((len(fine.time), force.states))
    return replace(first, rotation=R, chain=first.chain[last], force=pushed)


def at_samples(state: FlightState, at: Indices) -> FlightState:
    """A state at some samples of its clock; its reference stays on all of them."""
    along = (
        "center", "velocity", "rotation", "H", "omega", "force", "moment", "wrench_cov", "pose_cov",
        "innovation", "nis", "sensor_innovation",
    )  # fmt: skip
    return replace(state, **{name: getattr(state, name)[at] for name in along})


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
