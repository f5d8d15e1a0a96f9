"""What a flight can be flown again from, and what the air does along it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.config import Settings
from forceid.estimation.loads.channels import flight_of
from forceid.estimation.methods.in_segments import SEGMENTS
from forceid.estimation.methods.problem import Smoothing, Solution
from forceid.flight.path.linear import flexed, linear_flight, seen_part
from forceid.flight.priors.protocol import MOMENTUM
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine, engine
from forceid.principal import cross_matrix
from forceid.records import Aero, Array, Flown, Motion

MOTION, WRENCH = slice(0, 9), slice(9, 15)  # velocity, rotation, angular velocity; force, moment
COUNTED = {
    True: "errors of force, moment, velocity, orientation and angular velocity",
    False: "errors of force and moment alone",
}


def flown_of(solution: Solution, motion: Motion) -> Flown | None:
    """The poses of a recording as its frames show them; None where neither markers nor poses are."""
    kin = solution.kinematics
    if motion.position is None and motion.center is None:
        return None
    flight = flight_of(kin, solution.deformation, motion.gravity)
    inertia = np.broadcast_to(flight.inertia, (len(flight.time), 3, 3))
    h = np.broadcast_to(flight.h, (len(flight.time), 3))
    turned = canonical_quaternions(flight.rotation)
    if kin.model == SEGMENTS:  # whose mean rotation is that of a fit, which no moment turns
        turned = np.full_like(turned, np.nan)
    return Flown(flight.center, turned, flight.pose_cov, inertia, h, motion.wind)


def air_of(settings: Settings, solution: Solution, state: FlightState, motion: Motion) -> Aero | None:
    """What the air does along a solved flight, the moment about the mass center. Raises as `aero_of`.

    None where the settings do not ask for it.
    """
    if settings.aero is None:
        return None
    from forceid.aero import aero_of  # only flights in air pay for it

    cov, counted = np.zeros((len(motion.time), 15, 15)), False
    if solution.smoothing is not None and np.isfinite(state.force).any():
        cov, counted = motion_cov(solution.smoothing, state, engine(settings.engine)), True
    cov[:, WRENCH, WRENCH] += beyond(state.wrench_cov, cov[:, WRENCH, WRENCH])
    flight = (state.center, state.velocity, state.rotation, state.omega)
    wrench = state.force, state.moment
    return aero_of(settings.aero, flight, wrench, cov, motion.gravity, motion.wind, COUNTED[counted])


def beyond(claimed: Array, plain: Array) -> Array:
    """What a covariance (time, 6, 6) claims beyond a plain one, nothing where it claims less."""
    values, axes = np.linalg.eigh(np.nan_to_num(claimed - plain))
    return np.asarray(axes * np.maximum(values, 0.0)[:, None] @ axes.mT)


def motion_cov(smoothing: Smoothing, state: FlightState, passes: Engine) -> Array:
    """Covariance (time, 15, 15) of velocity, rotation (left error), angular velocity, force and moment.

    Of the states of one smoother about where the flight came to rest: omega = R J^-1 (R^T H - h) errs by
    J^-1 dH + (J^-1 [H]x - [omega]x) theta, J in world axes. Source: principal equations 4b, 4f.
    """
    force, n = smoothing.priors["force"], smoothing.priors["force"].states
    flight = smoothing.flight
    if state.reference is None:
        path = passes.smooth(*seen_part(flight, force))
        read = np.zeros((15, n))
        read[:3, MOMENTUM], read[9:12] = force.axes / flight.mass, force.rows
        return read @ path.P[:, :n, :n] @ read.T
    reference, moment = state.reference, smoothing.priors["moment"]
    flight = flexed(flight, reference)
    P = passes.smooth(*linear_flight(flight, force, moment, reference)).P
    end = n + reference.chain.shape[1]
    R = state.rotation
    J = np.linalg.inv(R @ flight.inertia @ R.mT)
    read = np.zeros((len(P), 15, P.shape[1]))
    read[:, :3, MOMENTUM], read[:, 3:6, n : n + 3] = force.axes / flight.mass, np.eye(3)
    read[:, 6:9, n + 3 : n + 6] = J @ reference.moment.axes
    read[:, 6:9, n : n + 3] = J @ cross_matrix(state.H) - cross_matrix(state.omega)
    read[:, 9:12, :n], read[:, 12:15, n:end] = force.rows, reference.moment.rows
    for part, prior, load in ((slice(9, 12), force, state.force), (slice(12, 15), moment, state.moment)):
        if prior.body_axes is not None:  # turned by what the rotation is off
            read[:, part, n : n + 3] = -cross_matrix(load)
    return np.asarray(read @ P @ read.mT)


def canonical_quaternions(rotation: Array) -> Array:
    """Quaternions (time, 4) [x y z w] with w >= 0 of rotation matrices; NaN stays NaN."""
    q = np.full((len(rotation), 4), np.nan)
    seen = np.isfinite(rotation).all((1, 2))
    if seen.any():
        q[seen] = Rotation.from_matrix(rotation[seen]).as_quat(canonical=True)
    return q
