"""Gyros and accelerometers of a recording beside its markers, and in their place."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid import kalman
from forceid.config import load_settings
from forceid.errors import DataError
from forceid.estimation.body.deformation import smooth_deformation
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.inspection import inspect_recording
from forceid.estimation.instruments.on_flight import fused, judge_sensors, sensors_of, with_sensors
from forceid.estimation.loads.ascent import bfgs_maximum
from forceid.estimation.loads.channels import flight_of, force_channel, moment_channel, tune_channel
from forceid.estimation.methods.imu_only import estimate_unmarked, is_unmarked, judge_unmarked
from forceid.estimation.run import estimate_recording
from forceid.estimation.verdict.finding import judge_recording
from forceid.estimation.verdict.tracks import lost_frames
from forceid.files.validate import check_recording
from forceid.flight.smoother import smooth_flight
from forceid.scenes.recipe import SceneRecipe, simulate

ENGINE, PLAIN = kalman.engine(), load_settings()
MIDDLE = slice(20, -20)


@cache
def recorded(seed=3, duration=0.5, stated_noise=True, **parameters):
    recipe = SceneRecipe(
        scene="instrumented", duration=duration, sample_rate=320.0, noise_std=5e-4, seed=seed,
        stated_noise=stated_noise, parameters=parameters,
    )  # fmt: skip
    return simulate(recipe)


def by_markers(recording):
    """The flight that markers show, and the priors tuned on it."""
    kin = kinematics(recording.body, recording.motion, PLAIN)
    gravity = recording.motion.gravity
    deformation = smooth_deformation(kin, ENGINE)
    priors = {
        "force": tune_channel(force_channel(kin, gravity), (1.0, 1.0), ()),
        "moment": tune_channel(moment_channel(kin, deformation), (1.0, 1.0), ()),
    }
    return kin, flight_of(kin, deformation, gravity), priors


def with_all(recording):
    kin, flight, priors = by_markers(recording)
    flight, priors = fused(flight, priors, kin, recording.body, recording.motion, PLAIN, ENGINE)
    return flight, smooth_flight(flight, priors["force"], priors["moment"], ENGINE)


def off(state, truth):
    """Error of the wrench, and what is claimed of it, (time, 6)."""
    error = np.hstack([state.force - truth["force"], state.moment - truth["moment"]])
    return error[MIDDLE], np.sqrt(np.diagonal(state.wrench_cov, axis1=1, axis2=2))[MIDDLE]


def rms(values):
    return np.array([np.sqrt(np.mean(values[:, i : i + 3] ** 2)) for i in (0, 3)])


@pytest.mark.long
def test_sensors_beside_rare_markers_halve_the_error_and_more_and_say_how_large_it_is():
    recording = recorded(marker_every=4)
    _, flight, priors = by_markers(recording)
    alone, _ = off(smooth_flight(flight, priors["force"], priors["moment"], ENGINE), recording.truth)
    flight, state = with_all(recording)
    error, claimed = off(state, recording.truth)
    assert (rms(error) < rms(alone) * [0.6, 0.3]).all(), rms(error) / rms(alone)
    assert (rms(error) / rms(claimed) > 0.6).all()
    assert (rms(error) / rms(claimed) < 1.25).all()
    assert judge_sensors(flight, state) == ()


@pytest.mark.long
def test_noise_that_nobody_stated_is_found():
    recording = recorded(stated_noise=False, marker_every=4)
    flight, state = with_all(recording)
    np.testing.assert_allclose(flight.sensors.noise_std, [[0.02, 0.02], [0.1, 0.1]], rtol=0.15)
    assert np.nanmean(state.sensor_innovation**2) == pytest.approx(1.0, abs=0.1)


@pytest.mark.long
def test_a_sensor_that_stands_elsewhere_than_stated_is_named():
    recording = recorded(seed=4, marker_every=4)
    shifted = recording.body.sensor_position + np.array([[0.02, 0.0, 0.0], [0.0, 0.0, 0.0]])
    flight, state = with_all(replace(recording, body=replace(recording.body, sensor_position=shifted)))
    named = [f.values["sensors"] for f in judge_sensors(flight, state) if f.code == "bias-wanders"]
    assert "accelerometers" in named  # a lever that is wrong turns with the body, as no constant bias does


def test_without_sensors_or_rotation_nothing_changes():
    recording = recorded(marker_every=2)
    kin, flight, priors = by_markers(recording)
    motion = replace(recording.motion, specific_force=None, angular_velocity=None)
    assert fused(flight, priors, kin, recording.body, motion, PLAIN, ENGINE) == (flight, priors)
    blind = replace(kin, attitude=False)
    assert fused(flight, priors, blind, recording.body, recording.motion, PLAIN, ENGINE) == (flight, priors)
    assert with_sensors(flight, kin, recording.body, motion, PLAIN) is flight


def test_sensors_stand_where_the_body_says_from_its_mass_center_on():
    recording = recorded()
    body, motion = recording.body, recording.motion
    sensors = sensors_of(body, motion, PLAIN, np.array([0.01, 0.0, 0.0]))
    np.testing.assert_allclose(sensors.position, body.sensor_position - [[0.01, 0, 0]])
    turned = Rotation.from_quat(body.sensor_rotation).as_matrix()
    np.testing.assert_allclose(sensors.rotation, turned)
    np.testing.assert_array_equal(sensors.noise_std, [[0.02, 0.02], [0.1, 0.1]])
    told = load_settings(noise_std={"angular_velocity": 0.05, "specific_force_bias": 0.4})
    sensors = sensors_of(body, motion, told, np.zeros(3))
    np.testing.assert_array_equal(sensors.noise_std[0], [0.05, 0.05])
    np.testing.assert_array_equal(sensors.bias_std[1], [0.4, 0.4])
    gyros = replace(body, sensor_position=None, sensor_rotation=None)
    only = sensors_of(gyros, replace(motion, specific_force=None), PLAIN, np.zeros(3))
    assert only.used.tolist() == [True] * 6


def test_an_accelerometer_without_a_place_and_a_turn_that_is_none_are_errors():
    recording = recorded()
    homeless = replace(recording.body, sensor_position=None)
    with pytest.raises(DataError, match=r"/body/sensor_position is missing"):
        check_recording(replace(recording, body=homeless), "a.h5")
    with pytest.raises(DataError, match=r"/body/sensor_position is missing"):
        sensors_of(homeless, recording.motion, PLAIN, np.zeros(3))
    askew = replace(recording.body, sensor_rotation=2 * recording.body.sensor_rotation)
    with pytest.raises(DataError, match=r"/body/sensor_rotation has 2 quaternions off unit norm"):
        check_recording(replace(recording, body=askew), "a.h5")


@pytest.mark.long
def test_without_markers_force_and_moment_in_body_axes_are_right_and_the_rest_is_left_out():
    recording = recorded(markers=False, duration=0.3)
    body, motion, truth = recording.body, recording.motion, recording.truth
    assert is_unmarked(motion)
    told = load_settings(noise_std={"specific_force_bias": 0.3, "angular_velocity_bias": 0.05})
    (finding,) = judge_unmarked(body, motion, told)
    assert finding.level == "ok"  # what is not observable is not given, and what is not stated is claimed
    assert "place, speed and the attitude at the start are not observable" in finding.text
    state = (solution := estimate_unmarked(body, motion, told, ENGINE)).state
    into = Rotation.from_quat(truth["orientation"])
    for name, bound in (("force", 0.05), ("moment", 0.05)):
        true = into.apply(truth[name], inverse=True)[MIDDLE]
        found = np.einsum("tba,tb->ta", state.rotation, getattr(state, name))[MIDDLE]
        assert np.sqrt(np.mean((found - true) ** 2)) < bound * np.sqrt(np.mean(true**2))
    assert np.isnan(state.center).all()
    assert np.isnan(state.velocity).all()
    np.testing.assert_allclose(state.rotation[0], np.eye(3), atol=1e-3)
    assert "attitude-drifts" in [finding.code for finding in solution.findings]


def test_sensors_that_say_nothing_of_force_or_turn_are_refused():
    recording = recorded(markers=False)
    only = replace(recording.motion, angular_velocity=None, specific_force=None)
    (finding,) = judge_unmarked(recording.body, only, PLAIN)
    assert finding.code == "no-gyro"
    assert "add accelerometers, a gyro, or markers" in finding.text


def test_climbing_finds_the_top_of_a_hill_that_is_no_parabola():
    top = np.array([1.3, -0.8, 0.1])
    found = bfgs_maximum(lambda p: -float(np.sum(np.cosh(p - top)) * 10), np.zeros(3))
    np.testing.assert_allclose(found, top, atol=0.1)


def estimated(recording, **settings):
    return estimate_recording(recording, load_settings(lines="none", **settings))


@pytest.mark.long
def test_clocks_that_are_off_by_many_samples_are_found_said_and_no_longer_matter():
    late = {"gyro_clock": 0.0221, "accelerometer_clock": -0.0094}
    shape = {"marker_every": 4, "duration": 0.35}
    found, recording = estimated(recorded(**shape, **late)), recorded(**shape)
    for name, off in (("gyro", 0.0221), ("accelerometer", -0.0094)):
        std = found.tuned[f"clock_offset_{name}_std"]
        assert abs(found.tuned[f"clock_offset_{name}"] - off) < 4 * std < 2e-3
    assert any("the gyros read 22" in r and "later" in r for r in found.verdict.reasons)
    assert any("the accelerometers read 9" in r and "earlier" in r for r in found.verdict.reasons)
    error = np.hstack([found.force - recording.truth["force"], found.moment - recording.truth["moment"]])
    claimed = np.hstack([found.force_std, found.moment_std])
    assert (rms(error[MIDDLE]) < 1.4 * rms(claimed[MIDDLE])).all()


@pytest.mark.long
def test_a_gyro_bridges_rare_markers_past_half_a_turn_and_nothing_is_amiss():
    spin = (1.0, 2.0, 1.1 * np.pi * 80.0)
    recording = recorded(marker_every=4, duration=0.3, spin=spin)
    found = estimated(recording)
    assert found.verdict.level == "ok", found.verdict.reasons
    off = np.abs(found.angular_velocity - recording.truth["angular_velocity"])
    assert off.max() < 0.01 * spin[2]


def bare(recording):
    return replace(recording, motion=replace(recording.motion, angular_velocity=None, specific_force=None))


def spinning(share, duration=0.375):
    recipe = SceneRecipe(
        scene="instrumented", duration=duration, sample_rate=80.0, noise_std=5e-4, seed=1,
        parameters={"spin": (1.0, 2.0, share * np.pi * 80.0)},
    )  # fmt: skip
    return simulate(recipe)


@pytest.mark.long
@pytest.mark.parametrize("share", [0.9, 0.97])
def test_just_below_half_a_turn_a_frame_thirty_frames_of_markers_alone_are_right(share):
    recording = bare(spinning(share))
    found = estimated(recording)
    off = np.abs(found.angular_velocity - recording.truth["angular_velocity"])[4:-4]
    assert off.max() < 0.01 * share * np.pi * 80.0
    error = (found.moment - recording.truth["moment"])[4:-4]
    assert np.sqrt(np.mean(error**2)) < np.sqrt(np.mean(recording.truth["moment"][4:-4] ** 2))


def test_just_above_half_a_turn_without_a_gyro_the_other_reading_is_named():
    recording = bare(spinning(1.06))
    kin = kinematics(recording.body, recording.motion, PLAIN)
    (found,) = judge_recording(kin, recording.motion)
    assert "what is read as 37.6 rev/s may be 42.4 rev/s the other way" in found.text
    with_gyro = spinning(1.06)
    assert judge_recording(kin, with_gyro.motion) == []


def test_frames_that_markers_and_sensors_both_miss_are_lost_and_no_others():
    motion = recorded(marker_every=4).motion
    gap = {name: getattr(motion, name).copy() for name in ("position", "angular_velocity", "specific_force")}
    gap["position"][40:60] = np.nan
    kin = kinematics(recorded().body, replace(motion, **gap), PLAIN)
    assert not lost_frames(kin, replace(motion, **gap)).any()
    gap["specific_force"][45:50] = np.nan
    np.testing.assert_array_equal(np.flatnonzero(lost_frames(kin, replace(motion, **gap))), np.arange(45, 50))


def test_an_inspection_of_sensors_alone_says_what_they_do_not_show():
    found = inspect_recording(recorded(markers=False), PLAIN)
    assert found.force
    assert found.moment
    assert found.rank == 0
    assert found.noise_std == {"angular_velocity": 0.02, "specific_force": 0.1}
    assert "place, speed and the attitude at the start are not observable" in found.warnings[0]
    assert "a force does that turns with the body" in found.warnings[1]
    assert found.force_bandwidth_hz > 20.0
    assert found.moment_bandwidth_hz > 5.0
    recording = recorded(markers=False)
    blind = inspect_recording(
        replace(recording, motion=replace(recording.motion, angular_velocity=None)), PLAIN
    )
    assert not blind.force
    assert not blind.moment
