"""Gyros and accelerometers of a recording beside its markers, and in their place."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid import kalman
from forceid.config import load_settings
from forceid.errors import DataError
from forceid.estimation.deformation import smooth_deformation
from forceid.estimation.kinematics import kinematics
from forceid.estimation.load_channels import flight_of, force_channel, moment_channel, tune_channel
from forceid.estimation.sensors import climb, fused, sensor_reasons, sensors_of, with_sensors
from forceid.estimation.unmarked import estimate_unmarked, is_unmarked, judge_unmarked
from forceid.files.validate import check_recording
from forceid.kalman.flight import smooth_flight
from forceid.scenes.recipe import SceneRecipe, simulate

ENGINE, PLAIN = kalman.engine(), load_settings()
MIDDLE = slice(20, -20)


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


def test_sensors_beside_rare_markers_halve_the_error_and_more_and_say_how_large_it_is():
    recording = recorded(marker_every=4)
    _, flight, priors = by_markers(recording)
    alone, _ = off(smooth_flight(flight, priors["force"], priors["moment"], ENGINE), recording.truth)
    flight, state = with_all(recording)
    error, claimed = off(state, recording.truth)
    assert (rms(error) < rms(alone) * [0.6, 0.3]).all(), rms(error) / rms(alone)
    assert (rms(error) / rms(claimed) > 0.6).all()
    assert (rms(error) / rms(claimed) < 1.25).all()
    assert sensor_reasons(flight, state) == ()


def test_noise_that_nobody_stated_is_found():
    recording = recorded(stated_noise=False, marker_every=4)
    flight, state = with_all(recording)
    np.testing.assert_allclose(flight.sensors.noise_std, [[0.02, 0.02], [0.1, 0.1]], rtol=0.15)
    assert np.nanmean(state.sensor_innovation**2) == pytest.approx(1.0, abs=0.1)


def test_a_sensor_that_stands_elsewhere_than_stated_is_named():
    recording = recorded(seed=4, marker_every=4)
    shifted = recording.body.sensor_position + np.array([[0.02, 0.0, 0.0], [0.0, 0.0, 0.0]])
    flight, state = with_all(replace(recording, body=replace(recording.body, sensor_position=shifted)))
    (reason,) = sensor_reasons(flight, state)
    assert "innovations of the accelerometers" in reason


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
    assert only.used.tolist() == [True] * 6 + [False] * 6


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


def test_without_markers_force_and_moment_in_body_axes_are_right_and_the_rest_is_left_out():
    recording = recorded(markers=False)
    body, motion, truth = recording.body, recording.motion, recording.truth
    assert is_unmarked(motion)
    (finding,) = judge_unmarked(body, motion, PLAIN)
    assert not finding.refuses
    assert "place, speed and the attitude at the start are not observable" in finding.text
    told = load_settings(noise_std={"specific_force_bias": 0.3, "angular_velocity_bias": 0.05})
    state = (solution := estimate_unmarked(body, motion, told, ENGINE)).state
    into = Rotation.from_quat(truth["orientation"])
    for name, bound in (("force", 0.05), ("moment", 0.05)):
        true = into.apply(truth[name], inverse=True)[MIDDLE]
        found = np.einsum("tba,tb->ta", state.rotation, getattr(state, name))[MIDDLE]
        assert np.sqrt(np.mean((found - true) ** 2)) < bound * np.sqrt(np.mean(true**2))
    assert np.isnan(state.center).all()
    assert np.isnan(state.velocity).all()
    np.testing.assert_allclose(state.rotation[0], np.eye(3), atol=1e-3)
    assert any("drifted by" in reason for reason in solution.reasons)


def test_sensors_that_cannot_say_how_the_body_turns_are_refused():
    recording = recorded(markers=False)
    (finding,) = judge_unmarked(recording.body, replace(recording.motion, angular_velocity=None), PLAIN)
    assert finding.refuses
    assert "add a gyro" in finding.text


def test_climbing_finds_the_top_of_a_hill_that_is_no_parabola():
    top = np.array([1.3, -0.8, 0.1])
    found = climb(lambda p: -float(np.sum(np.cosh(p - top)) * 10), np.zeros(3))
    np.testing.assert_allclose(found, top, atol=0.1)
