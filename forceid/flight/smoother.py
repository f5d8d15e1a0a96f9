"""Smoothing of a free flight: poses in, force and moment out, by Gauss-Newton on SO(3).

The linear smoother of the flight about a reference is run again until the reference stands still, whose
fixed point is the most probable flight. Source: principal equations 4b, 4d, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from forceid.errors import EstimationError
from forceid.flight.attitude import turned
from forceid.flight.model import Flight
from forceid.flight.path.linear import flexed, linear_flight, seen_part
from forceid.flight.path.reference import Reference, trajectory_of, translation
from forceid.flight.path.rigid_path import classify_steps, settled_in_batches, step_classes
from forceid.flight.path.settling import led, settled, states_of
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.vibration import ModeState
from forceid.kalman.engines import Engine
from forceid.kalman.model import Filtered, mean_square
from forceid.motion import apply
from forceid.principal import cross_matrix as skew
from forceid.records import Array


@dataclass(frozen=True)
class FlightState:
    """A smoothed (or filtered) flight, world axes: wrench with covariance, mean motion, innovations.

    center, velocity, force, moment, H, omega (time, 3); rotation (time, 3, 3); wrench_cov, pose_cov
    (time, 6, 6); innovation (time, channel) of the pose, whitened, nis (time,) of all channels; reference:
    where it was linearized; sensor_innovation (time, channel) whitened, of the sensors' channels used, and
    their bias (channel,) at the end with bias_std; steady (number,) of the sensors with steady_std, zero
    where not in doubt; modes (time, state): chains of the modes of the body and weights of what follows them,
    modal_cov (time, 6 + 3 mode, 3 mode): of the wrench, and of amplitude, rate and load of each, with these;
    gauge_innovation (time, gauge) whitened, of the strain gauges used; given (time, 6): what force and moment
    have given so far, where one has edges between samples, which its samples do not tell. path: what the
    filter knows, and states given all samples, where covariances, most of the work, are NaN as yet.
    """

    center: Array
    velocity: Array
    rotation: Array
    H: Array
    omega: Array
    force: Array
    moment: Array
    wrench_cov: Array
    pose_cov: Array
    innovation: Array
    nis: Array
    log_likelihood: float
    reference: Reference | None = None
    sensor_innovation: Array = field(default_factory=lambda: np.zeros((0, 0)))
    bias: Array = field(default_factory=lambda: np.zeros(0))
    bias_std: Array = field(default_factory=lambda: np.zeros(0))
    steady: Array = field(default_factory=lambda: np.zeros(0))
    steady_std: Array = field(default_factory=lambda: np.zeros(0))
    modes: Array | None = None
    modal_cov: Array | None = None
    gauge_innovation: Array = field(default_factory=lambda: np.zeros((0, 0)))
    given: Array | None = None
    path: tuple[Filtered, Array] | None = None

    @property
    def claimed(self) -> bool:
        """Whether covariances are known."""
        return self.path is None


def smooth_flight(
    flight: Flight,
    force: LoadPrior | None,
    moment: LoadPrior,
    engine: Engine,
    causal: bool = False,
    first: Reference | None = None,
    claimed: bool = True,
) -> FlightState:
    """Force, moment and mean motion of a flight, smoothed; or, if causal, filtered about the smoothed path.

    force: None for the rotation by itself, where nothing links its errors to those of the center, which stays
    NaN. first: a reference near to it, if one is known; claimed: whether covariances are asked for. Raises
    EstimationError when it does not come to rest.
    """
    if engine.name == "compiled" and flight.modes is None:
        stiff = smooth_long(flight, force, moment, causal)
        if stiff is not None:
            return stiff
    elif engine.name == "compiled" and first is None:  # the rotation as if stiff: near to where it settles
        stiff = smooth_long(replace(flight, modes=None), None, moment, causal)
        first = None if stiff is None else stiff.reference
    f, x, about, _ = settled(flight, force, moment, engine, first)
    state = read_state(flight, about, f.x if causal else x, f, force, moment)
    if causal:
        return with_covariances(flight, state, f.P, force, moment)
    state = replace(state, path=(f.for_smoother(), x))
    return with_claims(flight, state, force, moment, engine) if claimed else state


def with_claims(
    flight: Flight, state: FlightState, force: LoadPrior | None, moment: LoadPrior, engine: Engine
) -> FlightState:
    """A smoothed flight with the covariances that were not asked for."""
    if state.path is None:
        return state
    return with_covariances(flight, state, engine.with_covariances(*state.path).P, force, moment)


def smoothed_once_more(
    flight: Flight, force: LoadPrior, moment: LoadPrior, engine: Engine, about: Reference
) -> FlightState:
    """A flight smoothed about where its path about a reference leads: the same where that is at rest."""
    model, z = linear_flight(flight, force, moment, about)
    further = led(flight, force, moment, about, engine.smooth_states(model, z), 1.0)
    path = engine.smooth(*linear_flight(flight, force, moment, further))
    state = read_state(flight, further, path.x, path.filtered, force, moment)
    return with_covariances(flight, state, path.P, force, moment)


def smooth_long(
    flight: Flight, force: LoadPrior | None, moment: LoadPrior, causal: bool
) -> FlightState | None:
    """`smooth_flight` of a body without modes, compiled throughout; None where only an engine's passes do."""
    loads = [moment] if force is None else [force, moment]
    if (
        flight.sensors is not None
        or flight.color is not None
        or (flight.shared is not None and force is not None)
        or any(load.body_axes is not None or load.tuned.pieces is not None for load in loads)
    ):
        return None
    clock, which = classify_steps(flight.time)
    free = None if force is None else translation(replace(flight, time=clock), force)
    classes = step_classes(clock, which, free, force, moment)
    try:
        found = settled_in_batches(flight, classes, force, moment, partial(trajectory_of, flight), causal)
    except EstimationError:
        return None
    if found is None:
        return None
    path, R, chain = found
    x, rot = path.x, turned(path.x[:, classes.theta : classes.theta + 3], R)
    P, F, H, T = (x @ columns for columns in classes.loads[:4])
    H = flight.whole(H)
    body = apply(rot.swapaxes(1, 2), H) - flight.h
    omega = apply(rot, np.asarray(np.linalg.solve(flight.inertia, body[..., None])[..., 0], float))
    reference, none = Reference(R, chain, moment), np.full((len(x), 3), np.nan)
    center, velocity, F = (none,) * 3 if force is None else (x[:, :3] @ force.axes.T, P / flight.mass, F)
    return FlightState(
        center, velocity, rot, H, omega, F, T, path.wrench_cov, path.pose_cov, of_pose(path.innovation),
        mean_square(path.innovation), path.log_likelihood, reference,
    )  # fmt: skip


def of_pose(innovation: Array) -> Array:
    """Innovations (time, channel) of which six are those of the pose, of a rotation by itself as well."""
    alone = innovation.shape[1] == 3
    return np.pad(innovation, ((0, 0), (3, 0)), constant_values=np.nan) if alone else innovation


def smooth_translation(
    flight: Flight, force: LoadPrior, engine: Engine, causal: bool = False, carrier: Array | None = None
) -> FlightState:
    """Force and mass center of a flight whose rotation is not seen; what belongs to rotation is NaN.

    carrier (time, 3, 3): rotation of the body, for a force that turns with it.
    """
    path = engine.smooth(*seen_part(flight, force, carrier=carrier))
    f = path.filtered
    x, P = (f.x, f.P) if causal else (path.x, path.P)
    own, out = slice(force.states), force.rows
    x, P = x[:, own], P[:, own, own]
    P_world, F, _ = force.read(x)
    none = np.full((len(x), 3), np.nan)
    wrench_cov, pose_cov = np.full((2, len(x), 6, 6), np.nan)
    wrench_cov[:, :3, :3] = out @ P @ out.T
    pose_cov[:, :3, :3] = force.axes @ P[:, :3, :3] @ force.axes.T
    return FlightState(
        x[:, :3] @ force.axes.T, P_world / flight.mass, np.full((len(x), 3, 3), np.nan), none, none, F, none,
        wrench_cov, pose_cov, f.innovation, f.nis, f.log_likelihood,
    )  # fmt: skip


def with_translation(state: FlightState, free: FlightState) -> FlightState:
    """The rotation with force and mass center smoothed by themselves: no error links them."""
    wrench_cov, pose_cov = state.wrench_cov.copy(), state.pose_cov.copy()
    for cov, own in ((wrench_cov, free.wrench_cov), (pose_cov, free.pose_cov)):
        cov[:, :3, :3], cov[:, :3, 3:], cov[:, 3:, :3] = own[:, :3, :3], 0.0, 0.0
    innovation = np.concatenate([free.innovation, state.innovation[:, 3:]], 1)
    return replace(
        state, center=free.center, velocity=free.velocity, force=free.force, wrench_cov=wrench_cov,
        pose_cov=pose_cov, innovation=innovation, nis=mean_square(innovation),
        log_likelihood=state.log_likelihood + free.log_likelihood,
    )  # fmt: skip


def read_state(
    flight: Flight, reference: Reference, x: Array, f: Filtered, force: LoadPrior | None, moment: LoadPrior
) -> FlightState:
    """The physical quantities in states x (time, state), without covariances; f: what the filter knows.

    The states of the moment stand behind those of the force.
    """
    flight, n = flexed(flight, reference), states_of(force)
    rot = turned(x[:, n : n + 3], reference.rotation)
    center, momentum, F = (np.full((len(x), 3), np.nan),) * 3
    if force is not None:
        center, (momentum, F, _) = x[:, :3] @ force.axes.T, force.read(x[:, :n])
    end = n + reference.chain.shape[1]
    H, T, _ = reference.moment.read(x[:, n:end])
    H = flight.whole(H)
    h = (rot @ flight.h[..., None])[..., 0]
    omega = np.asarray(np.linalg.solve(rot @ flight.inertia @ rot.swapaxes(1, 2), (H - h)[..., None])[..., 0])
    white, modes, deformed, gauged = of_pose(f.innovation), None, 6, 6
    if flight.modes is not None:
        modes, deformed = x[:, end:][:, : flight.modes.path.shape[1]], 6 + len(flight.modes.prior.std)
        gauged = deformed if (gauges := flight.modes.gauges) is None else deformed + len(gauges.rows)
        end += modes.shape[1] + gauged - deformed
    sensors, unknown = flight.sensors, np.full((len(x), 6, 6), np.nan)
    steady = np.zeros(0) if sensors is None else sensors.steady_in(x[-1])
    bias = x[-1, end : end + white.shape[1] - gauged]
    return FlightState(
        center, momentum / flight.mass, rot, H, omega, F, T, unknown, unknown, white[:, :6], f.nis,
        f.log_likelihood, reference, white[:, gauged:], bias, 0 * bias, steady, 0 * steady, modes,
        gauge_innovation=white[:, deformed:gauged],
    )  # fmt: skip


def with_covariances(
    flight: Flight, state: FlightState, P: Array, force: LoadPrior | None, moment: LoadPrior
) -> FlightState:
    """A state with what covariances P (time, state, state) of what it was read from say of it."""
    n, about = states_of(force), state.reference
    assert about is not None
    end = n + about.chain.shape[1]
    read_wrench, read_pose = np.zeros((len(P), 6, P.shape[-1])), np.zeros((6, P.shape[-1]))
    read_wrench[:, 3:, n:end], read_pose[3:, n : n + 3] = about.moment.rows, np.eye(3)
    if force is not None:
        read_wrench[:, :3, :n], read_pose[:3, :3] = force.rows, force.axes
    for part, prior, load in ((slice(0, 3), force, state.force), (slice(3, 6), moment, state.moment)):
        if prior is not None and prior.body_axes is not None:  # turned by what the rotation is off
            read_wrench[:, part, n : n + 3] = -skew(load)
    modal_cov = None
    if flight.modes is not None:
        chains = np.arange(end, end + flight.modes.own).reshape(-1, flight.modes.prior.states)
        moving = chains[:, : len(ModeState)].ravel()
        modal_cov = np.concatenate([read_wrench @ P[:, :, moving], P[:, moving[:, None], moving]], 1)
        end += flight.modes.path.shape[1] + state.gauge_innovation.shape[1]
    std, sensors = np.sqrt(np.maximum(np.diagonal(P[-1]), 0.0)), flight.sensors
    return replace(
        state, wrench_cov=read_wrench @ P @ read_wrench.mT, pose_cov=read_pose @ P @ read_pose.T,
        bias_std=std[end : end + len(state.bias)], modal_cov=modal_cov, path=None,
        steady_std=state.steady_std if sensors is None else sensors.steady_in(std),
    )  # fmt: skip
