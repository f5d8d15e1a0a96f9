"""Recordings of sensors alone: force and moment in the axes of the body at the first sample.

Gyros say how the body turns from then on, accelerometers what pulls at it. Where it was, how fast, and how
it stood, nothing says: specific force is blind to all three. So is it to a force that a bias may imitate: one
that stands still in body axes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.config import PriorsSetting, Settings
from forceid.errors import ConfigError
from forceid.estimation.body.cleaning import cleaned
from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.rotors import momentum_inside
from forceid.estimation.body.spin import with_own_tensor
from forceid.estimation.body.thin_mass import as_sphere, with_known_moment
from forceid.estimation.instruments.accelerometer_array import field_of
from forceid.estimation.instruments.clocks import (
    TURN,
    at_samples,
    largest_step,
    refined,
    refined_reference,
)
from forceid.estimation.instruments.on_flight import judge_sensors, named_sensors, sensors_of
from forceid.estimation.loads.rough_look import rough_priors
from forceid.estimation.methods.accelerometers import estimate_field, judge_field
from forceid.estimation.methods.problem import Solution, named
from forceid.estimation.methods.turning_loads import Search, alternatives
from forceid.estimation.verdict.catalogue import note
from forceid.flight.instruments import ACCELEROMETER, GYRO
from forceid.flight.instruments.dead_reckoning import gyro_rate
from forceid.flight.model import Flight
from forceid.flight.path.settling import SETTLED
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.motion import Pose
from forceid.records import Array, Body, Finding, Motion, all_finite
from forceid.rounding import SOLVED
from forceid.significance import SIGMAS, TENTH
from forceid.timing import stage

BIAS_PASSES = 0.5  # claimed error of the force over its size from which a bias passes for force


def is_unmarked(motion: Motion) -> bool:
    """Whether sensors are all there is."""
    return motion.position is None and motion.center is None


def reads_turn(motion: Motion) -> bool:
    """Whether a gyro reads all three axes at once."""
    rate = motion.angular_velocity
    return rate is not None and bool(all_finite(rate).any())


def judge_unmarked(body: Body, motion: Motion, settings: Settings) -> list[Finding]:
    """What sensors alone do not allow."""
    if not reads_turn(motion):
        return judge_field(field_of(body, motion, settings), motion.gravity)
    inertia = inertia_of(body)
    if not np.isfinite(inertia.tensor).all():
        return [note("no-inertia-for-sensors")]
    clean = cleaned(body, motion)[0]
    fastest = gyro_rate(clean.time, sensors_of(body, clean, settings, inertia.center))
    turn = (
        0.0 if fastest is None else float(np.linalg.norm(fastest, axis=1).max() * np.diff(clean.time).max())
    )
    if turn > 2 * np.pi:
        return [note("turns-lost", turn_rad=turn)]
    found = [note("no-place")]
    if clean.specific_force is not None and "specific_force_bias" not in known(motion, settings):
        found.append(note("bias-not-stated", biased=inertia.mass * ACCELEROMETER.offset))
    return found


def known(motion: Motion, settings: Settings) -> dict[str, float]:
    """What is stated of the sensors, by name."""
    return motion.noise_std | settings.noise_std


@stage("flight")
def estimate_unmarked(body: Body, motion: Motion, settings: Settings, engine: Engine) -> Solution:
    """Wrench of a recording of gyros and accelerometers, in the axes of the body at the first sample.

    Of accelerometers alone, in those of the body at each.
    """
    if settings.load_prior != "matern":
        what = f"the load prior '{settings.load_prior}' is tuned on poses, which sensors alone do not show"
        raise ConfigError(what, "load_prior", 'use load_prior = "matern", or add markers')
    if settings.prior != PriorsSetting():
        what = "the numbers of a prior are for poses, which sensors alone do not show"
        raise ConfigError(what, "prior", "leave it out, or add markers")
    if not isinstance(settings.moment_about, str):
        what = "is a point fixed in space, and sensors alone do not show where the body is"
        raise ConfigError(what, "moment_about", "name a node of the body, or mass_center")
    if not reads_turn(motion) and (field := field_of(body, motion, settings)) is not None:
        return estimate_field(body, motion, field, engine)
    kin = unmarked_kinematics(body, motion, settings)
    stated = set(known(motion, settings))
    flight = unmarked_flight(body, motion, settings, kin)
    fine, at = refined(flight)
    rough = rough_priors(flight, slow=True)
    first = refined_reference(flight, fine, at, *rough)
    every = alternatives(first, Search(fine, rough, settings, engine, frozenset(stated)))
    share = np.array([alternative.state.log_likelihood for alternative in every])
    share = np.exp(share - share.max())
    share /= share.sum()
    best = every[int(share.argmax())]
    state = at_samples(mixed([alternative.state for alternative in every], share), at)
    with_body = [float(share @ [a.turning[i] for a in every]) for i in (0, 1)]
    findings = list(judge_sensors(best.flight, state, stated))
    var = np.diagonal(state.pose_cov[-1], axis1=0, axis2=1)[3:]
    off = float(np.degrees(np.sqrt(var.max())))
    findings.append(note("attitude-drifts", drift_deg=off))
    turn = largest_step(flight, fine.time)
    if turn > (1 + SOLVED) * TURN:
        findings.append(note("turn-not-resolved", turn_rad=turn))
    if best.left > TENTH:
        findings.append(note("path-not-at-rest", left=best.left))
    if flight.sensors is None or flight.sensors.of(ACCELEROMETER) is None:
        gone = np.full_like(state.force, np.nan)
        cov = state.wrench_cov.copy()
        cov[:, :3], cov[:, :, :3] = np.nan, np.nan
        state = replace(state, force=gone, wrench_cov=cov)
        findings.append(note("no-accelerometer"))
    else:
        claimed = float(np.sqrt(np.diagonal(state.wrench_cov, axis1=1, axis2=2)[:, :3].mean()))
        size = float(np.sqrt(np.mean(state.force**2)))
        if claimed > BIAS_PASSES * size:
            findings.append(note("bias-as-force", claim=claimed, force=size))
        if "specific_force_bias" not in stated:
            biased = flight.mass * ACCELEROMETER.offset  # a force still in body axes reads as much
            if with_body[0] < 0.5:  # a prior without one: it went into the bias
                cov = state.wrench_cov.copy()
                cov[:, :3, :3] += biased**2 * np.eye(3)
                state = replace(state, wrench_cov=cov)
            still = float(np.linalg.norm(np.einsum("tba,tb->ta", state.rotation, state.force).mean(0)))
            if still > SIGMAS * biased:
                findings.append(note("force-in-bias", force=still, biased=biased))
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
    priors = {"force": best.force, "moment": best.moment}
    tuned = named(kin, priors) | named_sensors(best.flight, state)
    tuned |= {f"{name}_turns_with_body": p for name, p in zip(("force", "moment"), with_body, strict=True)}
    return Solution(kin, deformation, state, engine.name, tuned, {}, tuple(findings), priors)


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
        each = zip(sensors.instruments, sensors.noise_std, strict=True)
        noise = {one.name: std.mean() * np.eye(3) for one, std in each}
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
    cov = np.tile(SETTLED**2 * np.eye(6), (T, 1, 1))
    inertia = np.tile(kin.inertia.tensor, (T, 1, 1))
    sensors = sensors_of(body, motion, settings, kin.inertia.center)
    if sensors is not None:  # the clock is that of the gyros, and of others in one case with them
        bias, doubt, gyro = sensors.bias_std.copy(), np.zeros(len(sensors.instruments)), sensors.of(GYRO)
        for i, one in enumerate(sensors.instruments):
            if f"{one.name}_bias" not in known(motion, settings):  # without markers only this bounds a bias
                bias[i] = np.minimum(bias[i], one.offset)
            if one is not GYRO and gyro is not None:
                both = np.isfinite(gyro) & np.isfinite(sensors.reading[:, i])
                apart = not both.all(2).any(0).all()
                doubt[i] = known(motion, settings).get(f"{one.name}_clock", apart * sensors.clock_std[i])
        sensors = replace(sensors, clock_std=doubt, bias_std=bias)
    inside = np.broadcast_to(momentum_inside(body, motion), (T, 3)).copy()
    return Flight(
        motion.time, center, rotation, cov, kin.inertia.mass, inertia, inside, np.zeros(3), sensors
    )  # fmt: skip
