"""Recordings of sensors alone: force and moment in the axes of the body at the first sample.

Gyros say how the body turns from then on, accelerometers what pulls at it. Where it was, how fast, and how
it stood, nothing says: specific force is blind to all three. So is it to a force that a bias may imitate: one
that stands still in body axes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.deformation import Deformation
from forceid.estimation.flight_smoother import Solution, named
from forceid.estimation.inertia import inertia_of
from forceid.estimation.joint_tuning import FAMILIES, on_axes, tune_together
from forceid.estimation.kinematics import Kinematics
from forceid.estimation.rough_priors import rough_priors
from forceid.estimation.sensors import named_sensors, sensor_reasons, sensors_of
from forceid.estimation.spin import with_own_tensor
from forceid.estimation.thin_mass import as_sphere, with_known_moment
from forceid.estimation.verdict import Finding
from forceid.kalman.dead_reckoning import gyro_rate
from forceid.kalman.engines import Engine
from forceid.kalman.flight import FlightState, smooth_flight
from forceid.kalman.flight_model import Flight
from forceid.kalman.prior import LoadPrior
from forceid.motion.pose import Pose, log
from forceid.records import Array, Body, Motion

HELD = 1e-4  # m, rad: of the pose that the first sample is given
# rad/s, m/s2: the most that data sheets of the cheapest parts allow a gyro and an accelerometer at rest, 20
# degrees a second and 80 thousandths of gravity: without markers nothing else bounds a bias
OFFSET = 0.35, 0.8
COARSE = (
    1.0  # rad a sample: a parabola in time then misses a sixth of what a load that turns adds to the spin
)
LEFT = 0.1  # of a standard deviation: a path that moves by less is at rest
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
    found = [Finding(text)]
    if sensors is not None and 1 in sensors.family and f"{FAMILIES[1]}_bias" not in known(motion, settings):
        text = (
            "biases of the accelerometers are not stated, and one that all of them share reads as a force "
            "does that turns with the body: such a force is not told apart from one; state "
            "noise_std.specific_force_bias from a record at rest"
        )
        found.append(Finding(text))
    return found


def known(motion: Motion, settings: Settings) -> dict[str, float]:
    """What is stated of the sensors, by name."""
    return motion.noise_std | settings.noise_std


def estimate_unmarked(body: Body, motion: Motion, settings: Settings, engine: Engine) -> Solution:
    """Wrench of a recording of gyros and accelerometers, in the axes of the body at the first sample."""
    kin = unmarked_kinematics(body, motion, settings)
    stated = set(known(motion, settings))
    flight = unmarked_flight(body, motion, settings, kin)
    every = alternatives(flight, settings, engine, stated)
    share = np.array([alternative.state.log_likelihood for alternative in every])
    share = np.exp(share - share.max())
    share /= share.sum()
    best = every[int(share.argmax())]
    flight, force, moment = best.flight, best.force, best.moment
    state = mixed([alternative.state for alternative in every], share)
    with_body = [float(share @ [a.turning[i] for a in every]) for i in (0, 1)]
    reasons = list(sensor_reasons(flight, state, stated))
    var = np.diagonal(state.pose_cov[-1], axis1=0, axis2=1)[3:]
    off = float(np.degrees(np.sqrt(var.max())))
    reasons.append(
        f"attitude is reckoned from the gyros: by the end it has drifted by {off:.2g} degrees of standard "
        "error, and turns force and moment in the axes of the start by as much; in body axes they are right"
    )
    rate, step = gyro_rate(motion.time, flight.sensors), float(np.median(np.diff(motion.time)))
    turn = 0.0 if rate is None else step * float(np.linalg.norm(rate, axis=1).max())
    if turn > COARSE:
        reasons.append(
            f"the body turns by {turn:.2g} rad between two samples: what a load that turns with it does in "
            "between is not resolved, and claimed errors may be many times too small; raise the sample rate"
        )
    if best.left > LEFT:
        reasons.append(
            "the path of the rotation does not come to rest: what it still moves by is "
            f"{best.left:.2g} times the error claimed of it otherwise, and a part of the claim; raise the "
            "sample rate, or state noise_std.angular_velocity_bias from a record at rest"
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
        elif "specific_force_bias" not in stated and with_body[0] < 0.5:
            turning = float(np.linalg.norm(common_bias(flight, state)) * flight.mass)
            reasons.append(
                f"a force of up to {turning:.2g} N that turns with the body may be among the biases of the "
                "accelerometers, and is not in the claimed error"
            )
    if kin.inertia.point:
        state = with_known_moment(state, kin.inertia, None)
    elif kin.inertia.line is not None:
        state = with_own_tensor(state, kin.inertia, kin.noise["angular_velocity"])
    lost = np.full_like(state.center, np.nan)
    pose_cov = state.pose_cov.copy()
    pose_cov[:, :3], pose_cov[:, :, :3] = np.nan, np.nan
    state = replace(state, center=lost, velocity=lost, pose_cov=pose_cov)
    T = len(kin.time)
    none = np.zeros((T, 0))
    deformation = Deformation(none, none, flight.inertia, flight.h)
    priors = {"force": force, "moment": moment}
    tuned = named(kin, priors) | named_sensors(flight, state)
    tuned |= {f"{name}_turns_with_body": p for name, p in zip(("force", "moment"), with_body, strict=True)}
    return Solution(kin, deformation, state, engine.name, tuned, {}, tuple(reasons))


@dataclass(frozen=True)
class Alternative:
    """A flight smoothed with force and moment slow in body axes where `turning` says so, else in fixed.

    left: what its path still moves by, over its claimed error.
    """

    turning: tuple[bool, bool]
    flight: Flight
    force: LoadPrior
    moment: LoadPrior
    state: FlightState
    left: float


def alternatives(flight: Flight, settings: Settings, engine: Engine, stated: set[str]) -> list[Alternative]:
    """Every alternative that the record bears: each load slow in body axes, or in fixed ones where those are
    not ruled out by load_axes. EstimationError: it bears none.
    """
    found: list[Alternative] = []
    failed: Exception | None = None
    for turning in ((True, True), (True, False), (False, True), (False, False)):
        if settings.load_axes == "body" and not all(turning):
            continue
        near = max(found, key=lambda a: a.state.log_likelihood, default=None)
        try:
            tried = tuned_and_smoothed(flight, turning, settings, engine, stated, near)
        except (EstimationError, np.linalg.LinAlgError) as error:
            failed = error
            continue
        if np.isfinite(tried.state.log_likelihood):
            found.append(tried)
    if not found:
        what = f"bears no estimate ({failed})"
        raise EstimationError(what, "the record of the sensors", "raise the sample rate, or record longer")
    return found


def tuned_and_smoothed(
    flight: Flight,
    turning: tuple[bool, bool],
    settings: Settings,
    engine: Engine,
    stated: set[str],
    near: Alternative | None = None,
) -> Alternative:
    """One alternative, tuned from another that is near. No bias is taken to wander unasked: it would pass for
    a load that does.
    """
    start = rough_priors(flight) if near is None else (near.force, near.moment)
    force, moment = (
        replace(prior, carried=np.eye(3) if turns else None)
        for prior, turns in zip(start, turning, strict=True)
    )
    first = None if near is None else near.state.reference
    stays = {f"{family}_walk" for family in FAMILIES}
    was = force, moment
    flight, force, moment = tune_together(flight, *was, engine, stated | stays, first)
    if first is not None and first.force is not None:
        pushed, chain = on_axes(first.force, was[0], force), on_axes(first.chain, was[1], moment)
        first = replace(first, force=pushed, chain=chain, axes=moment.axes)
    causal = settings.method == "filter"
    state, left = with_left_over(smooth_flight(flight, force, moment, engine, causal, first))
    return Alternative(turning, flight, force, moment, state, left)


def mixed(states: list[FlightState], share: Array) -> FlightState:
    """The likeliest state with the mean wrench of all, and a covariance that holds what they differ by."""
    wrench = np.stack([np.hstack([state.force, state.moment]) for state in states])
    mean = np.einsum("s,sta->ta", share, wrench)
    off = wrench - mean
    cov = np.einsum("s,stab->tab", share, np.stack([state.wrench_cov for state in states]))
    cov += np.einsum("s,sta,stb->tab", share, off, off)
    return replace(
        states[int(share.argmax())], force=mean[:, :3], moment=mean[:, 3:], wrench_cov=cov
    )  # fmt: skip


def with_left_over(state: FlightState) -> tuple[FlightState, float]:
    """A state that claims what its path still moves by as well, and that over its claim before, at most.

    The loads turn with the path.
    """
    assert state.reference is not None
    step = log(state.rotation @ state.reference.rotation.swapaxes(1, 2))
    before = np.sqrt(np.diagonal(state.pose_cov, axis1=1, axis2=2)[:, 3:])
    pose = np.concatenate([np.zeros_like(step), step], 1)
    wrench = np.concatenate([np.cross(step, state.force), np.cross(step, state.moment)], 1)
    pose_cov, wrench_cov = (
        cov + off[:, :, None] * off[:, None]
        for cov, off in ((state.pose_cov, pose), (state.wrench_cov, wrench))
    )
    return replace(state, pose_cov=pose_cov, wrench_cov=wrench_cov), float((np.abs(step) / before).max())


def common_bias(flight: Flight, state: FlightState) -> Array:
    """What the biases of the accelerometers have in common (3,) m/s2, body axes, over those of three axes."""
    assert flight.sensors is not None
    every = np.full(len(flight.sensors.used), np.nan)
    every[flight.sensors.used] = state.bias
    biases = every.reshape(2, -1, 3)[1]
    whole = np.isfinite(biases).all(1)
    turned = np.einsum("sab,sb->sa", flight.sensors.rotation[whole], biases[whole])
    return np.asarray(turned.mean(0)) if whole.any() else np.zeros(3)


def unmarked_kinematics(body: Body, motion: Motion, settings: Settings) -> Kinematics:
    """Kinematics of a recording that shows no pose: mass, shape and the noise of its sensors."""
    inertia, T, nodes = inertia_of(body), len(motion.time), len(body.node)
    X = np.zeros((nodes, 3)) if body.position is None else body.position - inertia.center
    inertia = as_sphere(inertia, X)
    lost, unseen = np.full((T, 3), np.nan), np.full((T, 3, 3), np.nan)
    cov, empty = np.tile(np.eye(6), (T, 1, 1)), np.zeros((T, 0))
    pose = Pose(lost, unseen, cov, np.full((T, nodes, 3), np.nan), np.full(T, np.nan), np.zeros(T))
    sensors = sensors_of(body, motion, settings, inertia.center)
    noise = {}
    if sensors is not None:
        read = [name for name in FAMILIES if getattr(motion, name) is not None]
        noise = {name: float(sensors.noise_std[FAMILIES.index(name)].mean()) for name in read}
    stated = {name: name in known(motion, settings) for name in noise}
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
    if sensors is not None:  # the clock is that of the gyros, and of accelerometers in one case with them
        both = np.isfinite(sensors.angular_velocity) & np.isfinite(sensors.specific_force)
        apart = not both.all(2).any(0).all()
        stated = known(motion, settings).get(f"{FAMILIES[1]}_clock")
        doubt = stated if stated is not None else apart * sensors.clock_std[1]
        bias = sensors.bias_std.copy()
        for i, name in enumerate(FAMILIES):
            if f"{name}_bias" not in known(motion, settings):
                bias[i] = np.minimum(bias[i], OFFSET[i])
        sensors = replace(sensors, clock_std=np.array([0.0, doubt]), bias_std=bias)
    nothing = np.zeros((T, 3))
    return Flight(
        motion.time, center, rotation, cov, kin.inertia.mass, inertia, nothing, np.zeros(3), sensors
    )  # fmt: skip
