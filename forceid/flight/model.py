"""A flight as a linear model about a reference: poses in, force and moment as states, with angular momentum.

State: mass center c, momentum P, force chain; rotation error theta, angular momentum H about the mass
center, moment chain; all but theta (world) along fixed axes of the load's prior. Only the rotation is
nonlinear. It is linearized about a reference, R = exp([theta]x) R_ref (error on the left). Modes follow with
their chains; sensors add rows about the same reference, and their biases and steady numbers to the end of the
state. Source: principal equations 4b, 4d, 4f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from forceid.errors import EstimationError
from forceid.flight.attitude import ReferenceTrajectory, between, cubics, turn_along
from forceid.flight.color import Color, SharedErrors, root_of
from forceid.flight.instruments.bending import bending
from forceid.flight.instruments.gyro import GYRO
from forceid.flight.instruments.moved import Moved
from forceid.flight.instruments.sensors import (
    Sensors,
    biases_of,
    read_later,
    sensed,
    with_sensor_channels,
)
from forceid.flight.modes import FlyingModes, bent, with_strain_channels
from forceid.flight.priors.protocol import CONSTANT, INTEGRAL, LOAD, MOMENTUM, LoadPrior
from forceid.kalman.building.process import block_diagonal
from forceid.kalman.model import StateSpace, at_all_times, same_at_all_times
from forceid.motion import SHOWN_TURN, substeps
from forceid.principal import cross_matrix as skew
from forceid.records import Array, KnownPart

CENTER, ROTATION, POSE = slice(0, 3), slice(3, 6), slice(0, 6)  # in the covariance of a pose
UNKNOWN_TURN = 10.0  # rad at the start: some turns, for a path is led there from the first frame that is seen
LOOK_AFTER = 4  # steps towards where a flight rests, until it is looked at how well they do
COARSE = 0.5  # rad from frame to frame, beyond which differences of frames show no rates


@dataclass(frozen=True)
class Flight:
    """What is seen of a flight, and the inertia it moves with.

    time (time,) s; center (time, 3) m and rotation (time, 3, 3) body to world, NaN where not seen; pose_cov
    (time, 6, 6), center first, world axes, rotation as a left error (rad); mass kg; inertia (time, 3, 3)
    kg m2 of the current shape and h (time, 3) kg m2/s, angular momentum of the deformation, both in
    body axes and about the mass center; gravity (3,) m/s2; sensors: those on the body;
    modes: in which it bends, None for none. With them center, rotation and pose_cov are those of the frames
    with the deformation taken out, inertia and h those along the path of the modes. known: what known loads
    bring beside those that are states; their path is no part of the center; color: of the errors of poses and
    of what frames say of the modes, None for white ones; shared: errors of the center beside those, None for
    none.
    """

    time: Array
    center: Array
    rotation: Array
    pose_cov: Array
    mass: float
    inertia: Array
    h: Array
    gravity: Array
    sensors: Sensors | None = None
    modes: FlyingModes | None = None
    known: KnownPart | None = None
    color: Color | None = None
    shared: SharedErrors | None = None

    def colored(self, model: StateSpace, errors: slice) -> StateSpace:
        """A model whose channels begin with some of (center, rotation), with the color of their errors.

        Behind the poses come channels of modes, with unit errors, and what is read otherwise.
        """
        if self.shared is not None and errors.start == 0:
            model = self.shared.colored(model, np.diff(self.time))
        if self.color is None:
            return model
        seen = np.isfinite(self.rotation).all((1, 2), keepdims=True)
        R = np.where(seen, np.nan_to_num(self.rotation), np.eye(3))
        turn, poses = np.zeros((len(R), 6, 6)), errors.stop - errors.start
        turn[:, :3, :3] = turn[:, 3:, 3:] = R
        cov = np.broadcast_to(model.R, (len(R), *model.R.shape[-2:]))[:, :poses, :poses]
        root = root_of(cov, turn[:, errors, errors])
        modes = (
            0 if self.modes is None or errors.stop < 6 or errors.start else self.modes.frames.rows.shape[1]
        )
        wide = np.zeros((len(R), model.R.shape[-1], poses + modes))
        wide[:, :poses, :poses], wide[:, poses : poses + modes, poses:] = root, np.eye(modes)
        return self.color.beside(model, wide, np.diff(self.time))

    def whole(self, H: Array) -> Array:
        """Angular momentum (time, 3), world axes, of all loads, from that of the unknown ones."""
        return H if self.known is None else H + self.known.momentum


def unsettled(flight: Flight) -> tuple[str, str]:
    """What does not come to rest, and what to do about it."""
    step = "raise the sample rate, or state a noise_std nearer to the truth"
    if flight.sensors is None or flight.sensors.of(GYRO) is None:
        step += "; past half a turn a frame, add a gyro"
    return "the smoother on rotations", step


@dataclass(frozen=True)
class Reference:
    """Where a flight is linearized: rotation (time, 3, 3) and the moment chain (time, state), theta = 0.

    moment: the prior whose chain it is; force (time, state): the chain of the force, which sensors are
    linearized about as well, None for none; steady (number,): of the sensors (`Sensors`), modes (time,
    state): chains of the modes, each None for those that the flight begins with.
    """

    rotation: Array
    chain: Array
    moment: LoadPrior
    force: Array | None = None
    steady: Array | None = None
    modes: Array | None = None

    def restated(self, prior: LoadPrior) -> Reference:
        """The same, its chain as another prior holds it, of the same kernel and with other lines."""
        return replace(self, chain=prior.restated(self.chain, self.moment), moment=prior)

    def under(self, prior: LoadPrior) -> Reference:
        """The same motion and moment under another prior, its moment a constant for the step that follows."""
        H, T, _ = self.moment.read(self.chain)
        chain = np.zeros((len(H), prior.states))
        chain[:, MOMENTUM], chain[:, CONSTANT] = H @ prior.axes, T @ prior.axes
        return replace(self, chain=chain, moment=prior, force=None)


def translation(flight: Flight, prior: LoadPrior, carrier: Array | None = None) -> StateSpace:
    """Linear model of the mass center under force and weight: c' = P / m, P' = F + m g.

    carrier (time, 3, 3): rotation of the body, for a force that turns with it.
    """
    step = np.diff(flight.time)
    F, Q, P0 = prior.chain(step, carrier, flight.time[0])
    scale = np.ones(len(P0))
    scale[:3] = 1 / flight.mass  # the chain holds m c
    F, Q = (a[:1] if same_at_all_times(a) else a for a in (F, Q))
    F, Q = F * scale[:, None] / scale, Q * np.outer(scale, scale)
    P0 = P0 * np.outer(scale, scale)
    u, gravity = np.zeros((len(step), len(P0))), flight.gravity @ prior.axes
    u[:, :3] = 0.5 * step[:, None] ** 2 * gravity
    u[:, MOMENTUM] = flight.mass * step[:, None] * gravity
    x0, H = np.zeros(len(P0)), np.zeros((3, len(P0)))
    if (seen := np.isfinite(flight.center).all(1)).any():
        x0[:3] = flight.center[seen][0] @ prior.axes
    H[:, :3] = prior.axes
    F, Q = at_all_times(F, len(step)), at_all_times(Q, len(step))
    return StateSpace(F, Q, H, flight.pose_cov[:, :3, :3], x0, P0, u)


def trajectory_of(flight: Flight, R: Array, H: Array, T: Array, dT: Array) -> ReferenceTrajectory:
    """The flight about a rotation, momentum, moment and its rate, in substeps for its fastest turn.

    Those of the unknown loads, which known ones add to.
    """
    step = np.diff(flight.time)
    if flight.known is not None:
        b, c = flight.known.over_steps(step)
        H, T, dT = flight.whole(H), T + b, dT + c
    inertia, h = cubics(flight.time, flight.inertia), cubics(flight.time, flight.h)
    body = (R[:-1].swapaxes(1, 2) @ H[:-1, :, None])[..., 0] - h[3]
    J = np.broadcast_to(inertia[3], (len(step), 3, 3))
    far = float((np.linalg.norm(np.linalg.solve(J, body[..., None])[..., 0], axis=1) * step).max())
    if not far < SHOWN_TURN:
        raise EstimationError(f"does not settle: it turns by {far:.0f} rad in a step", *unsettled(flight))
    n = substeps(step, body, J)
    return ReferenceTrajectory(step, R, H, T, dT, inertia, h, n)


def pushed(flight: Flight, reference: Reference, Y: Array, H: Array) -> ReferenceTrajectory:
    """The flight about its reference, under a moment b + 2 c s in each step, of H = b s + c s^2 with Y and H.

    A moment that oscillates between two samples is not known by its value and rate at the first, and one that
    turns with the body has more of a rate in world axes than its states.
    """
    s = np.diff(flight.time)[:, None]
    b, c = 6 * Y / s**2 - 2 * H / s, 3 * H / s**2 - 6 * Y / s**3
    T, dT = (np.concatenate([a, a[-1:]]) for a in (b, 2 * c))
    return trajectory_of(flight, reference.rotation, reference.moment.read(reference.chain)[0], T, dT)


@dataclass(frozen=True)
class TurnStep:
    """What moves the rotation error over each step, world axes, a left error: theta becomes d_theta theta +
    by_H H + by_Y Y + by_more h + offset.

    H: angular momentum at its start; Y, h: what a moment adds over it to the second and the first of its
    integrals. d_theta, by_H, by_Y, by_more (step, 3, 3); offset (step, 3).
    """

    d_theta: Array
    by_H: Array
    by_Y: Array
    by_more: Array
    offset: Array


def turn_step(flight: Flight, reference: Reference, Y: Array, h: Array) -> TurnStep:
    """The same about a reference whose moment adds Y and h (step, 3) over each step.

    A load moves both, as H = b s + c s^2 with that Y and h at the end does, and the rotation by what such an
    H turns it; J^-1 Y where the step is short.
    """
    s = np.diff(flight.time)[:, None, None]
    R, d_theta, d_H = turn_along(pushed(flight, reference, Y, h))
    by_Y, by_more = 6 * (d_H[1] - d_H[2] / s) / s**2, (3 * d_H[2] / s - 2 * d_H[1]) / s
    H = reference.chain[:-1, MOMENTUM] @ reference.moment.axes.T
    moved = np.einsum("tij,tj->ti", np.concatenate([d_H[0], by_Y, by_more], 2), np.concatenate([H, Y, h], 1))
    return TurnStep(d_theta, d_H[0], by_Y, by_more, between(R, reference.rotation[1:]) - moved)


def added_moment(prior: LoadPrior, F: Array, chain: Array) -> tuple[Array, Array]:
    """What a load adds over each step to the second and the first of its integrals (step, 3), world axes.

    F (step, state, state) and chain (time, state) of its prior.
    """
    load = chain[:-1, LOAD, None]
    Y, h = ((F[:, rows, LOAD] @ load)[..., 0] @ prior.axes.T for rows in (INTEGRAL, MOMENTUM))
    return Y, h


def rotation_model(flight: Flight, prior: LoadPrior, reference: Reference) -> StateSpace:
    """Linear model of the rotation error and the angular momentum about a reference."""
    F, Q, P0 = map(np.array, prior.chain(np.diff(flight.time), reference.rotation, flight.time[0]))
    Y, h = added_moment(reference.moment, F, reference.chain)
    turn = turn_step(flight, reference, Y, h)
    by_Y, by_H = turn.by_Y @ prior.axes, turn.by_more @ prior.axes
    theta = INTEGRAL  # in place of Y
    F[:, theta, LOAD] = by_Y @ F[:, INTEGRAL, LOAD] + by_H @ F[:, MOMENTUM, LOAD]
    F[:, theta, MOMENTUM], F[:, theta, theta] = turn.by_H @ prior.axes, turn.d_theta
    if prior.body_axes is not None:  # its states say where it stands in the body: in the world theta turns it
        F[:, MOMENTUM, theta] = -skew(h)
        F[:, theta, theta] -= by_Y @ skew(Y) + by_H @ skew(h)
    Q[:, theta] = by_Y @ Q[:, INTEGRAL] + by_H @ Q[:, MOMENTUM]
    Q[:, :, theta] = Q[:, :, INTEGRAL] @ by_Y.swapaxes(1, 2) + Q[:, :, MOMENTUM] @ by_H.swapaxes(1, 2)
    P0[:3, :3] = UNKNOWN_TURN**2 * np.eye(3)
    u = np.zeros((len(F), len(P0)))
    u[:, :3] = turn.offset
    return StateSpace(F, Q, np.eye(3, len(P0)), flight.pose_cov[:, 3:, 3:], np.zeros(len(P0)), P0, u)


def error_angle(flight: Flight, reference: Reference) -> Array:
    """Measured rotation error theta (time, 3) from a reference, NaN where no rotation is seen."""
    return between(flight.rotation, reference.rotation)


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
