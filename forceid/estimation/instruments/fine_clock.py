"""A clock fine enough for the turn of a body: samples at which nothing is read, between those that are.

The model of a flight takes what a load adds to the spin over a step to grow as a parabola in time, and a load
that turns with the body to turn about one axis. Both hold where the body turns by little in a step, whatever
the sample rate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.flight.instruments.dead_reckoning import gyro_rate
from forceid.flight.model import Flight, Reference
from forceid.flight.priors.protocol import MOMENTUM, LoadPrior
from forceid.flight.smoother import FlightState, first_reference
from forceid.motion import free_turn
from forceid.records import Array, Indices

# rad that a body turns in a step: a load that turns with it adds to the spin as a sine does, of which a
# parabola with the right value and mean misses the turn cubed over 72 sqrt(3) at most, a two-thousandth
TURN = 0.4
MOST_STEPS = int(np.ceil(2 * np.pi / TURN))  # between two samples, of a whole turn: no record gets too long


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
