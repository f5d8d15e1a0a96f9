"""Recordings of sensors alone: force and moment in the axes of the body at the first sample.

Gyros say how the body turns from then on, accelerometers what pulls at it. Where it was, how fast, and how
it stood, nothing says: specific force is blind to all three. So is it to a force that a bias may imitate: one
that stands still in body axes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.estimation.deformation import Deformation
from forceid.estimation.flight_smoother import Solution, named
from forceid.estimation.kinematics import Kinematics, inertia_of
from forceid.estimation.sensors import FAMILIES, sensor_reasons, sensors_of, tune_together
from forceid.estimation.verdict import Finding
from forceid.kalman.channels import Start
from forceid.kalman.engines import Engine
from forceid.kalman.flight import Flight, smooth_flight
from forceid.kalman.flight_sensors import gyro_rate
from forceid.kalman.prior import LoadPrior
from forceid.kalman.tuning import Tuned
from forceid.motion.pose import Pose
from forceid.records import Array, Body, Motion

ORDER = 3
RATE = 20.0  # 1/s: where the search for the rate begins
HELD = 1e-4  # m, rad: of the pose that the first sample is given
LOOSE = 0.5  # claimed error of the force over its size from which a bias passes for force


def is_unmarked(motion: Motion) -> bool:
    """Whether sensors are all there is."""
    return motion.position is None and motion.center is None


def judge_unmarked(body: Body, motion: Motion, settings: Settings) -> list[Finding]:
    """What sensors alone do not allow."""
    inertia = inertia_of(body)
    sensors = sensors_of(body, motion, settings, inertia.center)
    if gyro_rate(motion.time, sensors) is None:
        text = (
            "no marker, no mean motion and no gyro of three axes: how the body turns is not observable, and "
            "so neither is the direction of what the other sensors read; add a gyro, or markers"
        )
        return [Finding(text, refuses=True)]
    if not np.isfinite(inertia.tensor).all():
        text = "the inertia tensor is not given, and sensors alone need it; add /body/inertia"
        return [Finding(text, refuses=True)]
    text = (
        "no marker and no mean motion was measured: place, speed and the attitude at the start are not "
        "observable; force and moment stand in the axes of the body at the first sample, and place and speed "
        "are left out; add markers, or a measured pose"
    )
    return [Finding(text)]


def estimate_unmarked(body: Body, motion: Motion, settings: Settings, engine: Engine) -> Solution:
    """Wrench of a recording of gyros and accelerometers, in the axes of the body at the first sample."""
    kin = unmarked_kinematics(body, motion, settings)
    flight = unmarked_flight(body, motion, settings, kin)
    force, moment = rough_priors(flight)
    stated = {name: kin.stated.get(name, False) for name in FAMILIES}
    flight, force, moment = tune_together(flight, force, moment, engine, stated)
    state = smooth_flight(flight, force, moment, engine, settings.method == "filter")
    reasons = list(sensor_reasons(flight, state))
    var = np.diagonal(state.pose_cov[-1], axis1=0, axis2=1)[3:]
    off = float(np.degrees(np.sqrt(var.max())))
    reasons.append(
        f"attitude is reckoned from the gyros: by the end it has drifted by {off:.2g} degrees of standard "
        "error, and turns force and moment in the axes of the start by as much; in body axes they are right"
    )
    if motion.specific_force is None or not np.isfinite(motion.specific_force).any():
        gone = np.full_like(state.force, np.nan)
        cov = state.wrench_cov.copy()
        cov[:, :3], cov[:, :, :3] = np.nan, np.nan
        state = replace(state, force=gone, wrench_cov=cov)
        reasons.append("no accelerometer reads: no force; add one, or markers")
    else:
        claimed = float(np.sqrt(np.diagonal(state.wrench_cov, axis1=1, axis2=2)[:, :3].mean()))
        size = float(np.sqrt(np.mean(state.force**2)))
        if claimed > LOOSE * size:
            reasons.append(
                f"biases of the accelerometers pass for force: its claimed error is {claimed:.2g} N beside "
                f"{size:.2g} N; state noise_std.specific_force_bias from a record at rest"
            )
    lost = np.full_like(state.center, np.nan)
    pose_cov = state.pose_cov.copy()
    pose_cov[:, :3], pose_cov[:, :, :3] = np.nan, np.nan
    state = replace(state, center=lost, velocity=lost, pose_cov=pose_cov)
    T = len(kin.time)
    none = np.zeros((T, 0))
    deformation = Deformation(none, none, flight.inertia, flight.h)
    priors = {"force": force, "moment": moment}
    return Solution(kin, deformation, state, engine.name, named(kin, priors), {}, tuple(reasons))


def unmarked_kinematics(body: Body, motion: Motion, settings: Settings) -> Kinematics:
    """Kinematics of a recording that shows no pose: mass, shape and the noise of its sensors."""
    inertia, T, nodes = inertia_of(body), len(motion.time), len(body.node)
    X = np.zeros((nodes, 3)) if body.position is None else body.position - inertia.center
    lost, unseen = np.full((T, 3), np.nan), np.full((T, 3, 3), np.nan)
    cov, empty = np.tile(np.eye(6), (T, 1, 1)), np.zeros((T, 0))
    pose = Pose(lost, unseen, cov, np.full((T, nodes, 3), np.nan), np.full(T, np.nan), np.zeros(T))
    known = motion.noise_std | settings.noise_std
    sensors = sensors_of(body, motion, settings, inertia.center)
    noise = {}
    if sensors is not None:
        read = [name for name in FAMILIES if getattr(motion, name) is not None]
        noise = {name: float(sensors.noise_std[FAMILIES.index(name)].mean()) for name in read}
    stated = {name: name in known for name in noise}
    none = np.zeros((0, nodes, 3))
    return Kinematics(
        motion.time, inertia, X, np.zeros(nodes, bool), pose, none, empty, empty, "rigid", noise, stated, True
    )


def unmarked_flight(body: Body, motion: Motion, settings: Settings, kin: Kinematics) -> Flight:
    """The flight that starts at a pose taken for granted, without weight, and is seen by its sensors only."""
    T = len(motion.time)
    center, rotation = np.full((T, 3), np.nan), np.full((T, 3, 3), np.nan)
    center[0], rotation[0] = 0.0, np.eye(3)
    cov = np.tile(HELD**2 * np.eye(6), (T, 1, 1))
    inertia = np.tile(kin.inertia.tensor, (T, 1, 1))
    sensors = sensors_of(body, motion, settings, kin.inertia.center)
    nothing = np.zeros((T, 3))
    return Flight(
        motion.time, center, rotation, cov, kin.inertia.mass, inertia, nothing, np.zeros(3), sensors
    )  # fmt: skip


def rough_priors(flight: Flight) -> tuple[LoadPrior, LoadPrior]:
    """Priors of force and moment of about the size that the sensors show, for a search to begin with."""
    sensors, time = flight.sensors, flight.time
    omega = gyro_rate(time, sensors)
    assert sensors is not None
    assert omega is not None
    span, alpha = float(np.ptp(time)), np.gradient(omega, time, axis=0)
    H = np.einsum("tij,tj->ti", flight.inertia, omega)
    T = np.einsum("tij,tj->ti", flight.inertia, alpha) + np.cross(omega, H)
    pulled = np.einsum("sab,tsb->tsa", sensors.rotation, sensors.specific_force)
    swept = np.cross(alpha[:, None], sensors.position)
    swept = swept + np.cross(omega[:, None], np.cross(omega[:, None], sensors.position))
    f = pulled - swept
    F = flight.mass * f[np.isfinite(f).all(2)]
    return prior(F, 0.0, span), prior(T, float(np.abs(H).max()), span)


def prior(load: Array, momentum: float, span: float) -> LoadPrior:
    """A prior of loads of the size of `load` (sample, 3), with momentum of about that size at the start."""
    size = float(np.sqrt(np.mean(load**2))) if load.size else 1.0
    size = size or 1.0
    first = (10 * max(momentum, size * span)) ** 2
    tuned = Tuned(ORDER, np.full(3, size), np.full(3, max(RATE, 3 / span)), 1.0, False, 0.0)
    return LoadPrior(tuned, np.eye(3), Start(1.0, first, (10 * size) ** 2))
