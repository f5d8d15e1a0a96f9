"""Smoothing of a free flight: poses in, force and moment out, with angular momentum as the state.

State: mass center c, momentum P, force chain; rotation error theta, angular momentum H about the mass
center, moment chain; all but theta (world) along fixed axes of the load's prior. Only the rotation is
nonlinear. It is linearized about a reference, R = exp([theta]x) R_ref (error on the left), and the linear
smoother is run again until the reference stands still: Gauss-Newton on SO(3), whose fixed point is the
most probable flight. Gyros and accelerometers add rows about the same reference, and their biases to the end
of the state. Source: principal equations 4b, 4d, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation, Slerp

from forceid.errors import EstimationError
from forceid.kalman.engines import Engine
from forceid.kalman.flight_sensors import Moved, Sensors, gyro_rate, reckoned, sensed, with_sensors
from forceid.kalman.lines import Line
from forceid.kalman.model import Filtered, Smoothed, StateSpace
from forceid.kalman.prior import LoadPrior, along_world, chain_along, load_rows
from forceid.motion.pose import exp, log
from forceid.principal.operator import cross_matrix as skew
from forceid.records import Array

SUBSTEP = 0.1  # rad that one integration step may turn
ITERATIONS = 40
STANDSTILL = 1e-6  # of the standard deviation of a measured rotation
SETTLED = 1e-4  # rad: a path that rounding keeps moving by less is taken


@dataclass(frozen=True)
class Flight:
    """What is seen of a flight, and the inertia it moves with.

    time (time,) s; center (time, 3) m and rotation (time, 3, 3) body to world, NaN where not seen; pose_cov
    (time, 6, 6), center first, world axes, rotation as a left error (rad); mass kg; inertia (time, 3, 3)
    kg m2 of the current shape and h (time, 3) kg m2/s, angular momentum of the deformation, both in
    body axes and about the mass center; gravity (3,) m/s2; sensors: gyros and accelerometers on the body.
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


@dataclass(frozen=True)
class Reference:
    """Where a flight is linearized: rotation (time, 3, 3) and the moment chain (time, state), theta = 0.

    axes (3, 3): of the chain, as columns in world axes; lines: the last states of the chain, two each;
    force (time, state): the chain of the force, which sensors are linearized about as well, None for none.
    """

    rotation: Array
    chain: Array
    axes: Array = field(default_factory=lambda: np.eye(3))
    lines: tuple[Line, ...] = ()
    force: Array | None = None


def translation(flight: Flight, prior: LoadPrior) -> StateSpace:
    """Linear model of the mass center under force and weight: c' = P / m, P' = F + m g."""
    step = np.diff(flight.time)
    F, Q, P0 = chain_along(prior, step)
    scale = np.ones(len(P0))
    scale[:3] = 1 / flight.mass  # the chain holds m c
    F, Q, P0 = F * scale[:, None] / scale, Q * np.outer(scale, scale), P0 * np.outer(scale, scale)
    u, gravity = np.zeros((len(step), len(P0))), flight.gravity @ prior.axes
    u[:, :3] = 0.5 * step[:, None] ** 2 * gravity
    u[:, 3:6] = flight.mass * step[:, None] * gravity
    x0, H = np.zeros(len(P0)), np.zeros((3, len(P0)))
    if (seen := np.isfinite(flight.center).all(1)).any():
        x0[:3] = flight.center[seen][0] @ prior.axes
    H[:, :3] = prior.axes
    return StateSpace(F, Q, H, flight.pose_cov[:, :3, :3], x0, P0, u)


def turn(flight: Flight, reference: Reference) -> tuple[Array, Array, Array]:
    """One step of the rotation from each sample of the reference: R (time - 1, 3, 3), and its derivatives.

    R' = [omega]x R with omega = J^-1 (H - h) by Runge-Kutta-Munthe-Kaas of order 4; d theta / d theta from
    theta' = J^-1 [H]x theta + J^-1 delta H, and that by delta H which grows over the step as 1, s and s^2,
    (3, time - 1, 3, 3).
    """
    time, step = flight.time, np.diff(flight.time)
    J_of, h_of = CubicSpline(time, flight.inertia), CubicSpline(time, flight.h)
    H, T, dT = along_world(reference.chain[:-1], reference.axes, reference.lines)
    R = reference.rotation[:-1]

    def omega(R: Array, s: Array) -> tuple[Array, Array, Array]:
        H_s = H + T * s[:, None] + 0.5 * dT * s[:, None] ** 2
        J_inv = np.asarray(np.linalg.inv(R @ J_of(time[:-1] + s) @ R.swapaxes(1, 2)))
        h = (R @ h_of(time[:-1] + s)[..., None])[..., 0]
        return np.einsum("tij,tj->ti", J_inv, H_s - h), J_inv, H_s

    turned = np.linalg.norm(omega(R, 0 * step)[0], axis=1) * step
    n = max(1, int(np.ceil(turned.max() / SUBSTEP)))
    h, d_theta, d_H = step / n, np.tile(np.eye(3), (len(step), 1, 1)), np.zeros((3, len(step), 3, 3))
    for i in range(n):
        s, hv = i * h, h[:, None]
        k1, _, _ = omega(R, s)
        k2 = bend(0.5 * hv * k1, omega(exp(0.5 * hv * k1) @ R, s + 0.5 * h)[0])
        w, J_inv, H_s = omega(exp(0.5 * hv * k2) @ R, s + 0.5 * h)
        k3 = bend(0.5 * hv * k2, w)
        k4 = bend(hv * k3, omega(exp(hv * k3) @ R, s + h)[0])
        R = exp(hv / 6 * (k1 + 2 * k2 + 2 * k3 + k4)) @ R
        a = J_inv @ skew(H_s) * h[:, None, None]
        half, whole = np.eye(3) + 0.5 * a + a @ a / 8, np.eye(3) + a + a @ a / 2 + a @ a @ a / 6
        grown = np.stack([h, h * (s + 0.5 * h), h * ((s + 0.5 * h) ** 2 + h**2 / 12)])
        d_theta, d_H = whole @ d_theta, whole @ d_H + half @ J_inv * grown[..., None, None]
    return R, d_theta, d_H


def bend(phi: Array, omega: Array) -> Array:
    """Rate of the rotation vector phi of a body that turns at omega, both world axes, small phi."""
    return omega - 0.5 * np.cross(phi, omega) + np.cross(phi, np.cross(phi, omega)) / 12


def rotation(flight: Flight, prior: LoadPrior, reference: Reference) -> StateSpace:
    """Linear model of the rotation error and the angular momentum about a reference."""
    step = np.diff(flight.time)
    F, Q, P0 = chain_along(prior, step)
    R, d_theta, d_H = turn(flight, reference)
    # the chain's first state Y is the integral of H: a load moves both, as H = b s + c s^2 with that Y and H
    # at the end does, and the rotation by what such an H turns it; J^-1 Y where the step is short
    s = step[:, None, None]
    by_Y, by_H = 6 * (d_H[1] - d_H[2] / s) / s**2 @ prior.axes, (3 * d_H[2] / s - 2 * d_H[1]) / s @ prior.axes
    start = d_H[0] @ prior.axes
    F[:, :3, 6:] = by_Y @ F[:, :3, 6:] + by_H @ F[:, 3:6, 6:]
    F[:, :3, 3:6], F[:, :3, :3] = start, d_theta
    Q[:, :3] = by_Y @ Q[:, :3] + by_H @ Q[:, 3:6]
    Q[:, :, :3] = Q[:, :, :3] @ by_Y.swapaxes(1, 2) + Q[:, :, 3:6] @ by_H.swapaxes(1, 2)
    P0[:3, :3] = np.eye(3)  # rad2: as good as unknown
    u = np.zeros((len(step), len(P0)))
    defect = log(R @ reference.rotation[1:].swapaxes(1, 2))
    u[:, :3] = defect - np.einsum("tij,tj->ti", F[:, :3], reference.chain[:-1])
    return StateSpace(F, Q, np.eye(3, len(P0)), flight.pose_cov[:, 3:, 3:], np.zeros(len(P0)), P0, u)


def error_angle(flight: Flight, reference: Reference) -> Array:
    """Measured rotation error theta (time, 3) from a reference, NaN where no rotation is seen."""
    seen = np.all(np.isfinite(flight.rotation), axis=(1, 2))
    theta = np.full((len(seen), 3), np.nan)
    theta[seen] = log(flight.rotation[seen] @ reference.rotation[seen].swapaxes(1, 2))
    return theta


def seen_part(flight: Flight, prior: LoadPrior, about: Reference | None = None) -> tuple[StateSpace, Array]:
    """One load by itself and what is seen of it: the mass center, or the rotation about a reference."""
    if about is None:
        return translation(flight, prior), flight.center
    new = 2 * (len(prior.lines) - len(about.lines))  # lines at rest, behind those of the reference
    wider = replace(about, chain=np.pad(about.chain, ((0, 0), (0, new))), lines=prior.lines)
    return rotation(flight, prior, wider), error_angle(flight, about)


def stack(a: StateSpace, b: StateSpace, R: Array) -> StateSpace:
    """Two models side by side, with measurement covariance R (time, channel, channel) across both."""
    n, m = len(a.x0), len(b.x0)
    F, Q = (np.zeros((len(a.F), n + m, n + m)) for _ in range(2))
    for wide, left, right in ((F, a.F, b.F), (Q, a.Q, b.Q)):
        wide[:, :n, :n], wide[:, n:, n:] = left, right
    u = np.concatenate([np.broadcast_to(s.u, (len(F), len(s.x0))) for s in (a, b)], 1)  # type: ignore[arg-type]
    H, P0 = block_diag(a.H, b.H), block_diag(a.P0, b.P0)
    return StateSpace(F, Q, H, R, np.concatenate([a.x0, b.x0]), P0, u)


def linear_flight(
    flight: Flight, force: LoadPrior, moment: LoadPrior, reference: Reference
) -> tuple[StateSpace, Array]:
    """The whole flight as a linear model about a reference, and what it measures (time, channel).

    Channels: mass center, rotation error, and the sensors with what is constant about the reference removed.
    """
    free = translation(flight, force)
    model = stack(free, rotation(flight, moment, reference), flight.pose_cov)
    z = np.concatenate([flight.center, error_angle(flight, reference)], 1)
    if flight.sensors is None:
        return model, z
    n, N = len(free.x0), len(model.x0)
    chain = np.zeros((len(z), n)) if reference.force is None else reference.force
    H, T, _ = along_world(reference.chain, reference.axes, reference.lines)
    to_F, to_T = load_rows(n, force.axes, force.lines), load_rows(N - n, reference.axes, reference.lines)
    J, h = CubicSpline(flight.time, flight.inertia), CubicSpline(flight.time, flight.h)
    moved = Moved(
        reference.rotation, H, T, chain @ to_F.T, flight.mass,
        flight.inertia, J(flight.time, 1), flight.h, h(flight.time, 1),
    )  # fmt: skip
    y, by_theta, by_H, by_T, by_F = sensed(flight.sensors, moved)
    rows = np.concatenate([by_F @ to_F, by_T @ to_T], 2)
    rows[:, :, n : n + 3] += by_theta
    rows[:, :, n + 3 : n + 6] += by_H @ reference.axes
    about = np.concatenate([chain, reference.chain], 1)
    told = flight.sensors.readings[:, flight.sensors.used] - y + np.einsum("tcs,ts->tc", rows, about)
    return with_sensors(model, flight.sensors, rows), np.concatenate([z, told], 1)


@dataclass(frozen=True)
class FlightState:
    """A smoothed (or filtered) flight, world axes: wrench with covariance, mean motion, innovations.

    center, velocity, force, moment, H, omega (time, 3); rotation (time, 3, 3); wrench_cov, pose_cov
    (time, 6, 6); innovation (time, channel) of the pose, whitened, nis (time,) of all channels; reference:
    where it was linearized; sensor_innovation (time, channel) whitened, of the sensors' channels used, and
    their bias (channel,) with bias_std.
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


def smooth_flight(
    flight: Flight,
    force: LoadPrior,
    moment: LoadPrior,
    engine: Engine,
    causal: bool = False,
) -> FlightState:
    """Force, moment and mean motion of a flight, smoothed; or, if causal, filtered about the smoothed path.

    Raises EstimationError when the reference does not come to rest.
    """
    reference = first_reference(flight, moment)
    n, m = (3 * (p.tuned.order + 3) + 2 * len(p.lines) for p in (force, moment))
    seen = np.isfinite(flight.rotation).all((1, 2))
    rest = STANDSTILL * float(np.sqrt(np.median(np.trace(flight.pose_cov[seen, 3:, 3:], axis1=1, axis2=2))))
    size = np.inf
    for _ in range(ITERATIONS):
        model, z = linear_flight(flight, force, moment, reference)
        x = engine.smooth_states(model, z)
        turned = x[:, n : n + 3]
        previous = reference
        turned_to = exp(turned) @ reference.rotation
        reference = Reference(turned_to, at_rest(x[:, n : n + m]), moment.axes, moment.lines, x[:, :n])
        last, size = size, float(np.abs(turned).max())
        if size < rest or (size < SETTLED and size > 0.5 * last):  # at rest, or moved by rounding alone
            break
    if size > SETTLED:
        raise EstimationError(
            f"does not settle: its last step turned the path by {size:.1e} rad",
            "the smoother on rotations",
            "raise the sample rate, or state a noise_std nearer to the truth",
        )
    path = engine.smooth(model, z)
    return read(flight, previous, path.filtered if causal else path, path.filtered, n, force)


def smooth_translation(
    flight: Flight, force: LoadPrior, engine: Engine, causal: bool = False
) -> FlightState:
    """Force and mass center of a flight whose rotation is not seen; what belongs to rotation is NaN."""
    path = engine.smooth(translation(flight, force), flight.center)
    f = path.filtered
    x, P = (f.x, f.P) if causal else (path.x, path.P)
    P_world, F, _ = along_world(x, force.axes, force.lines)
    none = np.full((len(x), 3), np.nan)
    wrench_cov, pose_cov = np.full((2, len(x), 6, 6), np.nan)
    out = load_rows(x.shape[1], force.axes, force.lines)
    wrench_cov[:, :3, :3] = out @ P @ out.T
    pose_cov[:, :3, :3] = force.axes @ P[:, :3, :3] @ force.axes.T
    return FlightState(
        x[:, :3] @ force.axes.T, P_world / flight.mass, np.full((len(x), 3, 3), np.nan), none, none, F, none,
        wrench_cov, pose_cov, f.innovation, f.nis, f.log_likelihood,
    )  # fmt: skip


def read(
    flight: Flight, reference: Reference, path: Smoothed | Filtered, f: Filtered, n: int, force: LoadPrior
) -> FlightState:
    """The physical quantities in the state of a path; its moment part starts at state n."""
    x, rot = path.x, exp(path.x[:, n : n + 3]) @ reference.rotation
    axes = force.axes
    P, F, _ = along_world(x[:, :n], axes, force.lines)
    end = n + reference.chain.shape[1]
    H, T, _ = along_world(x[:, n:end], reference.axes, reference.lines)
    read_wrench, read_pose = np.zeros((2, 6, x.shape[1]))
    read_wrench[:3, :n] = load_rows(n, axes, force.lines)
    read_wrench[3:, n:end] = load_rows(end - n, reference.axes, reference.lines)
    read_pose[:3, :3], read_pose[3:, n : n + 3] = axes, np.eye(3)
    h = (rot @ flight.h[..., None])[..., 0]
    omega = np.asarray(np.linalg.solve(rot @ flight.inertia @ rot.swapaxes(1, 2), (H - h)[..., None])[..., 0])
    P_all, white = path.P, f.innovation
    return FlightState(
        x[:, :3] @ axes.T, P / flight.mass, rot, H, omega, F, T,
        read_wrench @ P_all @ read_wrench.T, read_pose @ P_all @ read_pose.T,
        white[:, :6], f.nis, f.log_likelihood, reference,
        white[:, 6:], x[-1, end:], np.sqrt(np.maximum(np.diagonal(P_all[-1])[end:], 0.0)),
    )  # fmt: skip


def first_reference(flight: Flight, moment: LoadPrior) -> Reference:
    """Measured rotations, bridged across gaps, with H from their differences and no moment.

    Where gyros read, H is theirs, and the bridges are laid by dead reckoning: any number of turns between two
    frames.
    """
    time = flight.time
    chain = np.zeros((len(time), 3 * (moment.tuned.order + 3) + 2 * len(moment.lines)))
    rate = gyro_rate(time, flight.sensors)
    if rate is not None:
        H_body = np.einsum("tij,tj->ti", flight.inertia, rate) + flight.h
        rot = reckoned(time, steps_of(flight, H_body), flight.rotation)
        chain[:, 3:6] = np.einsum("tij,tj->ti", rot, H_body) @ moment.axes
        return Reference(rot, chain, moment.axes, moment.lines)
    seen = np.isfinite(flight.rotation).all((1, 2))
    bridge = Slerp(time[seen], Rotation.from_matrix(flight.rotation[seen]))
    rot = bridge(np.clip(time, *time[seen][[0, -1]])).as_matrix()
    omega = log(rot[1:] @ rot[:-1].swapaxes(1, 2)) / np.diff(time)[:, None]
    omega = np.concatenate([omega[:1], 0.5 * (omega[1:] + omega[:-1]), omega[-1:]])
    h = (rot @ flight.h[..., None])[..., 0]
    H = np.einsum("tij,tj->ti", rot @ flight.inertia @ rot.swapaxes(1, 2), omega) + h
    chain[:, 3:6] = H @ moment.axes
    return Reference(rot, chain, moment.axes, moment.lines)


def steps_of(flight: Flight, H: Array) -> Array:
    """Turns (time - 1, 3, 3) from each sample to the next, body axes, of H (time, 3) in body axes.

    Without a moment over the step, by the equations of the top: exact for a free one, however far it turns.
    """
    chain = np.zeros((len(H), 15))
    chain[:, 3:6] = H
    return turn(flight, Reference(np.tile(np.eye(3), (len(H), 1, 1)), chain))[0]


def at_rest(chain: Array) -> Array:
    """The chain with its rotation error taken into the reference."""
    return np.concatenate([np.zeros_like(chain[:, :3]), chain[:, 3:]], 1)
