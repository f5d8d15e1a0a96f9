"""Against differences of positions and rotations, and readings that are known without any integration."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.errors import ConfigError
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.scenes.flights.instrumented import Parameters, fly, readings
from forceid.scenes.recipe import SceneRecipe, simulate
from forceid.sections import validate

RATE = 2000.0
TIME = np.arange(1000) / RATE


def recipe(**changes):
    return SceneRecipe(scene="instrumented", duration=0.5, sample_rate=200.0, noise_std=1e-3, **changes)


def test_accelerometers_read_the_second_derivative_of_their_place_without_gravity(differentiate):
    p = Parameters()
    truth = fly(p, TIME).truth
    R = Rotation.from_quat(truth["orientation"]).as_matrix()
    _, read = readings(p, truth)
    for i, (X, turn) in enumerate(zip(np.array(p.sensor_position), p.sensor_turn, strict=True)):
        place = truth["center"] + R @ X
        a = differentiate(differentiate(place, 1 / RATE), 1 / RATE) - np.array(p.gravity)
        axes = (R @ Rotation.from_rotvec(turn).as_matrix())[8:-8]
        np.testing.assert_allclose(read[8:-8, i], np.einsum("tab,ta->tb", axes, a), atol=2e-5)


def test_gyros_read_the_rate_of_the_rotation_in_their_own_axes(differentiate):
    p = Parameters()
    truth = fly(p, TIME).truth
    R = Rotation.from_quat(truth["orientation"]).as_matrix()
    read, _ = readings(p, truth)
    for i, turn in enumerate(p.sensor_turn):
        axes = R @ Rotation.from_rotvec(turn).as_matrix()
        spin = axes[4:-4].mT @ differentiate(axes, 1 / RATE)
        vee = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], -1)
        np.testing.assert_allclose(read[4:-4, i], vee, atol=1e-8)


def test_a_body_that_spins_about_a_principal_axis_without_loads_reads_the_pull_to_the_axis():
    p = Parameters(
        inertia=((6e-4, 0, 0), (0, 1.1e-3, 0), (0, 0, 1.5e-3)), force=(), moment=(), spin=(0.0, 0.0, 30.0),
        sensor_position=((0.05, 0.0, 0.02),), sensor_turn=((0.0, 0.0, 0.0),), gyro_bias=((0.0, 0.0, 0.0),),
        accelerometer_bias=((0.0, 0.0, 0.0),),
    )  # fmt: skip
    gyro, read = readings(p, fly(p, TIME).truth)
    np.testing.assert_allclose(gyro[:, 0], [[0.0, 0.0, 30.0]] * len(TIME), atol=1e-9)
    np.testing.assert_allclose(read[:, 0], [[-45.0, 0.0, 0.0]] * len(TIME), atol=1e-8)


def test_momentum_changes_as_the_stated_loads_say(differentiate):
    p = Parameters()
    truth = fly(p, TIME).truth
    weight = p.total_mass * np.array(p.gravity)
    rate = p.total_mass * differentiate(truth["velocity"], 1 / RATE) - weight
    np.testing.assert_allclose(rate, truth["force"][4:-4], atol=1e-8)
    rate = differentiate(truth["angular_momentum"], 1 / RATE)
    np.testing.assert_allclose(rate, truth["moment"][4:-4], atol=1e-8)
    first = p.force[0]
    swing = np.array(first.amplitude) * np.sin(2 * np.pi * first.frequency * TIME[:, None])
    np.testing.assert_allclose(fly(Parameters(force=(first,)), TIME).truth["force"], swing, atol=1e-12)


def test_readings_carry_the_stated_noise_about_their_biases():
    quiet, noisy = (
        simulate(recipe(parameters={"gyro_noise": s * 0.02, "accelerometer_noise": s * 0.1})) for s in (0, 1)
    )
    p = Parameters()
    exact = readings(p, quiet.truth)
    for name, without, bias, std in zip(
        ("angular_velocity", "specific_force"), exact, (p.gyro_bias, p.accelerometer_bias), (0.02, 0.1),
        strict=True,
    ):  # fmt: skip
        offset = getattr(quiet.motion, name) - without
        np.testing.assert_allclose(offset, np.broadcast_to(bias, offset.shape), atol=1e-12)
        noise = getattr(noisy.motion, name) - getattr(quiet.motion, name)
        assert noise.std() == pytest.approx(std, rel=0.1)
        assert noisy.motion.noise_std[name] == std
    assert set(quiet.motion.noise_std) == {"position"}


def test_each_family_has_its_own_rate_and_is_nan_between():
    motion = simulate(recipe(parameters={"sensor_every": 2, "marker_every": 5})).motion
    sample = np.arange(100)
    for name, every in (("angular_velocity", 2), ("specific_force", 2), ("position", 5)):
        seen = np.isfinite(getattr(motion, name)).all((1, 2))
        np.testing.assert_array_equal(seen, sample % every == 0)


def test_a_recording_of_sensors_only_goes_through_a_file(tmp_path):
    made = simulate(recipe(parameters={"markers": False}))
    write_motion(tmp_path / "sensors.h5", made)
    read = read_motion(tmp_path / "sensors.h5")
    assert read.motion.position is None
    assert read.motion.noise_std == made.motion.noise_std
    for name in ("angular_velocity", "specific_force"):
        np.testing.assert_array_equal(getattr(read.motion, name), getattr(made.motion, name))
    np.testing.assert_allclose(read.body.sensor_position, made.body.sensor_position)
    np.testing.assert_allclose(read.body.sensor_rotation, made.body.sensor_rotation)


def test_mean_motion_with_sensors_keeps_its_channels():
    motion = simulate(recipe(measure="mean_motion", orientation_noise_std=1e-3)).motion
    assert motion.center.shape == (100, 3)
    assert motion.specific_force.shape == (100, 2, 3)
    assert set(motion.noise_std) == {"center", "orientation", "angular_velocity", "specific_force"}


def test_every_sensor_has_a_place_a_turn_and_biases():
    with pytest.raises(ConfigError, match="1 sensor_turn for 2 sensors"):
        validate(Parameters, {"sensor_turn": [[0, 0, 0]]}, "body.toml")
