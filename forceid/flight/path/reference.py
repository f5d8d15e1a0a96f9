"""A flight linearized about a path: translation, and the rotation in errors of an angle.

Source: principal equations 2, 4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.errors import EstimationError
from forceid.flight.attitude import ReferenceTrajectory, between, cubics, turn_along
from forceid.flight.model import Flight, unsettled
from forceid.flight.priors.protocol import CONSTANT, INTEGRAL, LOAD, MOMENTUM, LoadPrior
from forceid.kalman.model import StateSpace, at_all_times, same_at_all_times
from forceid.motion import SHOWN_TURN, substeps
from forceid.principal import cross_matrix as skew
from forceid.records import Array

COARSE = 0.5  # rad from frame to frame, beyond which differences of frames show no rates
UNKNOWN_TURN = 10.0  # rad at the start: some turns, for a path is led there from the first frame that is seen


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

    def part(self, s: slice) -> Reference:
        """The same over some samples."""
        force = None if self.force is None else self.force[s]
        modes = None if self.modes is None else self.modes[s]
        return replace(self, rotation=self.rotation[s], chain=self.chain[s], force=force, modes=modes)


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
    held = prior.chain(np.diff(flight.time), reference.rotation, flight.time[0])
    F, Q, P0 = (a if a.flags.writeable else np.array(a) for a in held)  # to be written over
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
