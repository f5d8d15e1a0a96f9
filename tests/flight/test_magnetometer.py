"""A magnetometer on bodies that tumble under drawn loads: rotations by DOP853."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from flights import GRAVITY, INERTIA, MASS, drawn_path, prior, seen
from scipy.optimize import approx_fprime
from scipy.spatial.transform import Rotation
from test_flight_sensors import exp, moved_at

from forceid import kalman
from forceid.cli.app import main
from forceid.config import load_settings
from forceid.estimation.instruments.on_flight import sensors_of
from forceid.estimation.run import estimate_recording
from forceid.files import write_motion
from forceid.flight.instruments import GYRO, MAGNETOMETER
from forceid.flight.instruments.sensors import Sensors, sensed
from forceid.flight.smoother import smooth_flight
from forceid.records import Body, Motion, Recording

FORCE, MOMENT = prior(std=1.0, rate=20.0), prior(std=0.05, rate=30.0)
SLOW = prior(std=1.0, rate=20.0, order=3), prior(std=0.05, rate=20.0, order=3)
AXES = Rotation.from_rotvec([[0.3, -0.4, 1.1]])
S = AXES.as_matrix()
FIELD = 4.8e-5 * np.array([0.4, 0.1, -0.9])  # T, as at 50 degrees north
NOISE = 2e-7  # T, of a cheap part
MARKERS = np.array([[0.12, 0, 0], [-0.1, 0.03, 0.01], [0, 0.09, -0.02], [0.02, -0.08, 0.02], [0.01, 0, 0.06]])
ENGINE = kalman.engine("auto")


def read_field(R, rng):
    """Readings (time, 1, 3) along rotations, with a bias drawn and kept, and noise; and that bias."""
    bias = 2e-5 * rng.standard_normal(3)
    noise = NOISE * rng.standard_normal((len(R), 3))
    return (np.einsum("ba,tcb,c->ta", S[0], R, FIELD) + bias + noise)[:, None], bias


def flown(seed, every=4, **more):
    """A flight that frames show at every few samples, with its magnetometer; wrench, rotation and bias."""
    rng = np.random.default_rng(seed)
    time, center, R, wrench = drawn_path(FORCE, MOMENT, rng, **more)
    flight = seen(time, center, R, rng)
    read, bias = read_field(R, rng)
    size = np.full(1, np.abs(read).max())
    at, noise = np.zeros((1, 3)), np.full((1, 1), NOISE)
    sensors = Sensors((MAGNETOMETER,), read[:, None], at, S, noise, size[None], number_std=size)
    hidden = np.arange(len(time)) % every > 0
    flight.center[hidden], flight.rotation[hidden] = np.nan, np.nan
    return replace(flight, sensors=sensors), wrench, R, bias


def recorded(seed, hidden, count=160):
    """A recording of five markers that are not seen in the frames `hidden`, and a magnetometer."""
    rng = np.random.default_rng(seed)
    time, center, R, wrench = drawn_path(SLOW[0], SLOW[1], rng, count)
    x = center[:, None] + np.einsum("tab,nb->tna", R, MARKERS) + 5e-4 * rng.standard_normal((count, 5, 3))
    x[hidden] = np.nan
    body = Body(
        node=tuple("abcde"), position=MARKERS, total_mass=MASS, mass_center=np.zeros(3), inertia=INERTIA,
        internal_momentum=np.zeros(3), sensor_rotation=AXES.as_quat(),
    )  # fmt: skip
    std = {"position": 5e-4, "magnetic_field_clock": 1e-9}
    motion = Motion(
        time, position=x, magnetic_field=read_field(R, rng)[0], gravity=GRAVITY, noise_std=std
    )  # fmt: skip
    return Recording(body, motion, truth={"time": time, "force": wrench[:, :3], "moment": wrench[:, 3:]})


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def test_rows_are_the_derivatives_of_the_field_in_the_axes_of_the_sensor():
    rng = np.random.default_rng(0)
    R, (H, T, F) = exp([0.4, 1.0, -0.7]), 1e-2 * rng.standard_normal((3, 3))
    one = np.ones((1, 1))
    sensors = Sensors((MAGNETOMETER,), np.zeros((1, 1, 1, 3)), np.ones((1, 3)), S, one, one)

    def read(v):
        return sensed(sensors, moved_at(exp(v[:3]) @ R, H, T, F), np.append(1 + v[3:], 0.0)).reading[0]

    found = sensed(sensors, moved_at(R, H, T, F), np.append(np.ones(3), 0.0))
    np.testing.assert_allclose(found.reading[0], (R @ S[0]).T @ np.ones(3), atol=1e-14)
    rows = np.concatenate([found.by["theta"], found.by_steady[..., :3]], 2)[0]
    np.testing.assert_allclose(rows, approx_fprime(np.zeros(6), read, 1e-7), atol=1e-6)
    assert not any(found.by[load].any() for load in ("H", "T", "F"))


def test_between_rare_frames_the_moment_is_nearer_to_the_truth_and_as_far_off_as_claimed():
    alone, beside, claimed, off = [], [], [], []
    for seed in range(5):
        flight, wrench, _, bias = flown(seed)
        states = [smooth_flight(f, FORCE, MOMENT, ENGINE) for f in (replace(flight, sensors=None), flight)]
        for errors, state in zip((alone, beside), states, strict=True):
            errors.append(rms(state.moment - wrench[:, 3:]))
        claimed.append(np.mean(np.diagonal(states[1].wrench_cov, axis1=1, axis2=2)[:, 3:]))
        off += [*(states[1].steady[:3] - FIELD) / states[1].steady_std[:3]]
        off += [*(states[1].bias - bias) / states[1].bias_std]
    assert (np.array(beside) <= alone).all()
    assert 0.8 < rms(beside) / np.sqrt(np.mean(claimed)) < 1.3
    assert rms(off) < 1.5  # field and bias of every flight


def test_past_half_a_turn_a_frame_it_counts_the_turns_that_frames_cannot():
    """Frames at every fourth sample, 240 degrees on: alone they say 120 degrees back."""
    fast = 2 * np.pi / (6 * 0.005)
    flight, wrench, R, _ = flown(1, spin=np.array([0.3, 0.5, fast]), count=100)
    alone, beside = (smooth_flight(f, FORCE, MOMENT, ENGINE) for f in (replace(flight, sensors=None), flight))
    spin = [np.median(np.einsum("tba,tb->ta", R, state.omega)[:, 2]) for state in (alone, beside)]
    assert spin == pytest.approx([-fast / 2, fast], rel=0.1)
    error = beside.moment - wrench[:, 3:]
    assert 0.8 < rms(error) / np.sqrt(np.diagonal(beside.wrench_cov, axis1=1, axis2=2)[:, 3:].mean()) < 1.3
    assert rms(error) < 0.3 * rms(alone.moment - wrench[:, 3:])


def estimates(recording):
    """Without and with the magnetometer: error of the moment N m, that over its claim, and what was found."""
    found = []
    for field in (None, recording.motion.magnetic_field):
        motion = replace(recording.motion, magnetic_field=field)
        estimate = estimate_recording(replace(recording, motion=motion), load_settings(model="rigid"))
        error = estimate.moment - recording.truth["moment"]
        found.append((rms(error), rms(error / estimate.moment_std), estimate))
    return found


@pytest.mark.long
def test_a_field_of_unknown_direction_is_found_and_frames_between_which_it_is_read_are_not_lost():
    (_, _, alone), (_, _, beside) = estimates(recorded(3, np.arange(100) % 4 > 0, 100))
    field = np.array([beside.tuned[f"magnetic_field_world_{axis}"] for axis in "xyz"])
    claimed = np.array([beside.tuned[f"magnetic_field_world_{axis}_std"] for axis in "xyz"])
    assert (np.abs(field - FIELD) < 4 * claimed).all()
    assert (claimed < 2e-7).all()  # T
    assert "frames-lost" in alone.verdict.codes
    assert "frames-lost" not in beside.verdict.codes


@pytest.mark.long
def test_estimates_of_drawn_records_are_nearer_with_it_and_as_far_off_as_claimed():
    alone, beside = np.transpose(
        [[found[:2] for found in estimates(recorded(seed, np.arange(160) % 4 > 0))] for seed in range(16)],
        (1, 0, 2),
    )
    assert rms(beside[:, 0]) < 0.95 * rms(alone[:, 0])
    assert 0.8 < rms(beside[:, 1]) < 1.3


def test_without_frames_the_heading_about_the_field_drifts_and_the_rest_does_not():
    """Gyros beside it and the pose of the first sample: what these drift by is a turn about B."""
    about, across = [], []
    for seed in range(3):
        flight, _, R, _ = flown(seed, every=10**6)
        rate = Rotation.from_matrix(R[:-1].swapaxes(1, 2) @ R[1:]).as_rotvec() / np.diff(flight.time)[:, None]
        gyro = np.vstack([rate, rate[-1:]]) @ S[0] + np.random.default_rng(seed).normal(0, 0.2, R[:, 0].shape)
        sensors = replace(
            flight.sensors, instruments=(GYRO, MAGNETOMETER),
            reading=np.stack([gyro[:, None], flight.sensors.reading[:, 0]], 1),
            noise_std=np.array([[0.2], [NOISE]]), bias_std=np.array([[0.3], [1e-7]]),
        )  # fmt: skip
        flight.rotation[0] = R[0]
        held = replace(flight, sensors=sensors, pose_cov=1e-8 * np.tile(np.eye(6), (len(R), 1, 1)))
        P = smooth_flight(held, FORCE, MOMENT, ENGINE).pose_cov[-1, 3:, 3:]
        n = FIELD / np.linalg.norm(FIELD)
        about.append(n @ P @ n)
        across.append((np.trace(P) - about[-1]) / 2)
    assert np.sqrt(np.mean(about) / np.mean(across)) > 3, (about, across)


def test_its_noise_is_found_by_differences_and_its_place_is_not_asked_for():
    recording = recorded(1, np.zeros(160, bool))
    sensors = sensors_of(recording.body, recording.motion, load_settings(), np.zeros(3))
    assert sensors.instruments == (MAGNETOMETER,)
    np.testing.assert_allclose(sensors.noise_std, NOISE, rtol=0.2)


@pytest.mark.parametrize(("units", "cut", "said"), [("m", False, "has units 'm'"), ("T", True, "has shape")])
def test_a_wrong_unit_or_shape_of_the_field_is_one_line_and_exit_code_3(tmp_path, capsys, units, cut, said):
    path = tmp_path / "a.h5"
    write_motion(path, recorded(0, np.zeros(160, bool)))
    with h5py.File(path, "r+") as f:
        field = f["motion/magnetic_field"]
        if cut:
            values = field[:, 0]
            del f["motion/magnetic_field"]
            field = f["motion"].create_dataset("magnetic_field", data=values)
        field.attrs["units"] = units
    assert main(["estimate", str(path), "-o", str(tmp_path / "out.h5")]) == 3
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "/motion/magnetic_field" in error
    assert said in error
