"""The linear model of a whole flight about a path, with what sensors on the body read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from forceid.flight.instruments.bending import bending
from forceid.flight.instruments.moved import Moved
from forceid.flight.instruments.sensors import (
    Sensors,
    biases_of,
    read_later,
    sensed,
    with_sensor_channels,
)
from forceid.flight.model import CENTER, POSE, ROTATION, Flight
from forceid.flight.modes import bent, with_strain_channels
from forceid.flight.path.reference import Reference, error_angle, rotation_model, translation
from forceid.flight.priors.protocol import LoadPrior
from forceid.kalman.building.process import block_diagonal
from forceid.kalman.model import StateSpace
from forceid.principal import cross_matrix as skew
from forceid.records import Array


def seen_part(
    flight: Flight, prior: LoadPrior, about: Reference | None = None, carrier: Array | None = None
) -> tuple[StateSpace, Array]:
    """One load by itself and what is seen of it: the mass center, or the rotation about a reference.

    carrier (time, 3, 3): rotation of the body, for a force that turns with it.
    """
    if about is None:
        return flight.colored(translation(flight, prior, carrier), CENTER), flight.center
    model = rotation_model(flight, prior, about.restated(prior))
    return flight.colored(model, ROTATION), error_angle(flight, about)


def stack(models: Sequence[StateSpace], R: Array, over: StateSpace | None = None) -> StateSpace:
    """Models side by side, with measurement covariance R (time, channel, channel) across all.

    over: one of models of the same sizes, whose F and Q are written over.
    """
    F = block_diagonal(*(s.F for s in models), over=None if over is None else over.F)
    Q = block_diagonal(*(s.Q for s in models), over=None if over is None else over.Q)
    inputs = [(len(s.x0), np.zeros(1) if s.u is None else s.u) for s in models]
    u = np.concatenate([np.broadcast_to(own, (len(F), size)) for size, own in inputs], 1)
    H = models[0].H if models[0].H.ndim > 2 else block_diag(*(s.H for s in models))
    H = np.pad(H, (*[(0, 0)] * (H.ndim - 1), (0, F.shape[-1] - H.shape[-1])))
    x0, P0 = np.concatenate([s.x0 for s in models]), block_diag(*(s.P0 for s in models))
    return StateSpace(F, Q, H, R, x0, P0, u)


@dataclass(frozen=True)
class Read:
    """What sensors read of a flight about a reference, whatever the sizes of its loads.

    rows (time, channel, state) on the states of both halves, and those of the modes, at the sample; path
    (time, state): of these, where the reference is; beyond (time, channel): what is read beside rows times
    path; by_steady (time, channel, number), steady (number,): as of `Sensed`.
    """

    rows: Array
    path: Array
    beyond: Array
    by_steady: Array
    steady: Array


def read_of(flight: Flight, force: LoadPrior, moment: LoadPrior, reference: Reference) -> Read:
    """What the sensors of a flight along a reference read; the priors say which states hold the loads."""
    flight, sensors = flexed(flight, reference), flight.sensors
    assert sensors is not None
    n, T = force.states, len(flight.time)
    chain = np.zeros((T, n)) if reference.force is None else reference.force
    moved = moved_along(flight, force, replace(reference, force=chain))
    steady = steady_of(sensors, reference)
    seen = sensed(sensors, moved, steady)
    by_theta = seen.by["theta"]
    for prior, by, load in ((force, seen.by["F"], moved.F), (moment, seen.by["T"], moved.T)):
        if prior.body_axes is not None:
            by_theta = by_theta - by @ skew(load)
    rows = np.concatenate([seen.by["F"] @ force.rows, seen.by["T"] @ reference.moment.rows], 2)
    rows[:, :, n : n + 3] += by_theta
    rows[:, :, n + 3 : n + 6] += seen.by["H"] @ reference.moment.axes
    path = np.concatenate([chain, reference.chain], 1)
    beyond = sensors.readings[:, sensors.used] - seen.reading + np.einsum("tcs,s->tc", seen.by_steady, steady)
    if flight.modes is not None:
        by_modes = np.zeros((*rows.shape[:2], flight.modes.path.shape[1]))
        if flight.modes.mounting is not None:
            more, by_modes = bending(sensors, moved, flight.modes, steady)
            beyond -= more
        rows = np.concatenate([rows, by_modes], 2)
        path = np.concatenate([path, flight.modes.path], 1)
    return Read(rows, path, beyond, seen.by_steady, steady)


def linear_flight(
    flight: Flight,
    force: LoadPrior | None,
    moment: LoadPrior,
    reference: Reference,
    halves: tuple[StateSpace, StateSpace] | None = None,
    read: Read | None = None,
    over: StateSpace | None = None,
) -> tuple[StateSpace, Array]:
    """The whole flight as a linear model about a reference, and what it measures (time, channel).

    Channels: mass center, rotation error, what frames tell of the modes beside, and the sensors with what is
    constant about the reference removed. force: None for the rotation by itself. halves: of the mass center,
    and of the rotation about the reference, read: what the sensors read about it, where these are known;
    over: one that such a call has returned of sensors, which is written over: what a search tries and drops
    takes no memory of its own.
    """
    if force is None:
        alone = flight.colored(rotation_model(flight, moment, reference), ROTATION)
        return alone, error_angle(flight, reference)
    flight = flexed(flight, reference)
    if halves is None:
        halves = translation(flight, force, reference.rotation), rotation_model(flight, moment, reference)
    models: tuple[StateSpace, ...] = halves
    z = np.concatenate([flight.center, error_angle(flight, reference)], 1)
    n, N, R = len(halves[0].x0), sum(len(half.x0) for half in halves), flight.pose_cov
    if flight.modes is not None:
        frames, whole = flight.modes.frames, np.isfinite(z).all(1, keepdims=True)
        H = flight.whole(reference.moment.read(reference.chain)[0])
        model = bent(stack(halves, R), n, flight.modes, flight.time, reference.rotation, H)
        theta = error_angle(replace(flight, rotation=frames.rotation), reference)
        z = np.where(whole, np.concatenate([frames.center, theta, frames.observed], 1), np.nan)
        if (strain := flight.modes.gauges) is not None:
            model, z = (
                with_strain_channels(model, strain, N, flight.modes.prior.states),
                np.concatenate([z, strain.reading], 1),
            )
        models, R = (model,), model.R
    if flight.sensors is None:
        return flight.colored(stack(models, R) if len(models) > 1 else models[0], POSE), z
    read = read_of(flight, force, moment, reference) if read is None else read
    rows, chance = read_later(read.rows, flight.sensors, flight.sensors.clock(read.steady), (force, moment))
    observed = read.beyond + np.einsum("tcs,ts->tc", rows, read.path)
    model = stack((*models, biases_of(flight.sensors, np.diff(flight.time))), R, over)
    rows = np.pad(rows, ((0, 0), (0, 0), (0, sum(len(s.x0) for s in models) - rows.shape[2])))
    model = with_sensor_channels(model, flight.sensors, rows, chance, read.by_steady)
    return model, np.concatenate([z, observed], 1)


def flexed(flight: Flight, reference: Reference) -> Flight:
    """The flight with its modes along those of a reference, and the inertia of that shape."""
    if flight.modes is None or reference.modes is None:
        return flight
    modes = replace(flight.modes, path=reference.modes)
    inertia, h = modes.inertia()
    return replace(flight, modes=modes, inertia=inertia, h=h)


def steady_of(sensors: Sensors, reference: Reference) -> Array:
    """The steady numbers of sensors at a reference."""
    return sensors.started(reference.rotation) if reference.steady is None else reference.steady


def moved_along(flight: Flight, force: LoadPrior, reference: Reference) -> Moved:
    """The flight as its sensors meet it along a reference."""
    assert reference.force is not None
    H, T, dT = reference.moment.read(reference.chain)
    _, F, dF = force.read(reference.force)
    if (known := flight.known) is not None:
        H, T, F = flight.whole(H), T + known.moment, F + known.force
        dT = dT + np.gradient(known.moment, flight.time, axis=0)
        dF = dF + np.gradient(known.force, flight.time, axis=0)
    J, h = CubicSpline(flight.time, flight.inertia), CubicSpline(flight.time, flight.h)
    return Moved(
        reference.rotation, H, T, F, flight.mass,
        flight.inertia, J(flight.time, 1), flight.h, h(flight.time, 1), dT, dF,
    )  # fmt: skip
