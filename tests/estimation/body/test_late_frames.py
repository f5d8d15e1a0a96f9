"""Frames that come early or late, on drawn bodies that fly and turn about a fixed axis under drawn loads."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.body.tracks.late_frames import lateness
from forceid.estimation.run import estimate_recording
from forceid.records import Body, Motion, Recording

STEP, FRAMES = 0.005, 300


def thrown(seed, late, noise=3e-4, step=STEP, on_a_line=False, ripple=0.0):
    """A recording whose frames are `late` steps rms off their times; force and moment at these.

    on_a_line: markers lie within 2 mm of a line that passes the mass center at 0.2 m; ripple rad: of a turn
    about the axis, at 0.3 cycles a frame, of which the moment is not given.
    """
    rng = np.random.default_rng([21, seed])
    said = step * np.arange(FRAMES)
    time = said + late * step * rng.standard_normal(FRAMES)
    axis, J = rng.standard_normal(3), np.diag(rng.uniform(0.02, 0.05, 3))
    axis /= np.linalg.norm(axis)
    mass, X = 2.0, rng.uniform(-0.15, 0.15, (8, 3))
    if on_a_line:
        X = X * [0.013, 0.013, 1.0] + [0.2, 0.0, 0.0]
    w, size, phase, v = (
        rng.uniform(4, 12, 3),
        rng.uniform(1, 4, 3),
        rng.uniform(0, 6, 3),
        rng.uniform(-3, 3, 3),
    )
    spin, swing, beat = rng.uniform(3, 9), rng.uniform(0.1, 0.4), rng.uniform(4, 9)
    center = v * time[:, None] - size * np.cos(w * time[:, None] + phase) / mass / w**2
    angle = spin * time + swing * np.sin(beat * time) + ripple * np.sin(2 * np.pi * 0.3 * time / step)
    R = Rotation.from_rotvec(angle[:, None] * axis).as_matrix()
    x = center[:, None] + X @ R.mT + noise * rng.standard_normal((FRAMES, 8, 3))
    force = size * np.cos(w * said[:, None] + phase)
    R = Rotation.from_rotvec((spin * said + swing * np.sin(beat * said))[:, None] * axis).as_matrix()
    turned = R @ J @ R.mT @ axis
    rate, gains = spin + swing * beat * np.cos(beat * said), -swing * beat**2 * np.sin(beat * said)
    moment = gains[:, None] * turned + rate[:, None] ** 2 * np.cross(axis, turned)
    known = {"total_mass": mass, "mass_center": np.zeros(3), "inertia": J, "internal_momentum": np.zeros(3)}
    body = Body(tuple("abcdefgh"), X, **known)
    return Recording(body, Motion(said, x, gravity=np.zeros(3))), force, moment


def test_frames_on_time_are_hardly_ever_called_late():
    found = []
    for seed in range(60):
        recording, _, _ = thrown(seed, 0.0)
        kin = kinematics(recording.body, recording.motion, load_settings(model="rigid"))
        found.append(lateness(kin.time, kin.pose))
    assert sum(one is not None for one in found) <= 1


def test_errors_of_a_turn_that_move_the_mass_center_by_their_square_are_not_called_late():
    for seed in range(12):
        recording, _, _ = thrown(seed, 0.0, on_a_line=True)
        kin = kinematics(recording.body, recording.motion, load_settings(model="rigid"))
        assert lateness(kin.time, kin.pose) is None


def test_an_oscillation_along_the_motion_is_not_called_late():
    for seed in range(12):
        recording, _, _ = thrown(seed, 0.0, ripple=3e-2)
        kin = kinematics(recording.body, recording.motion, load_settings(model="rigid"))
        assert lateness(kin.time, kin.pose) is None


@pytest.mark.parametrize("late", [0.03, 0.1, 0.3])
def test_how_late_frames_are_is_found_to_a_quarter(late):
    ratio = []
    for seed in range(12):
        recording, _, _ = thrown(seed, late)
        kin = kinematics(recording.body, recording.motion, load_settings(model="rigid"))
        found = lateness(kin.time, kin.pose)
        assert found is not None
        ratio.append(found[0] / (late * STEP))
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.12)
    assert np.min(ratio) > 0.7
    assert np.max(ratio) < 1.4


@pytest.mark.long
@pytest.mark.parametrize("late", [0.05, 0.2])
def test_force_and_moment_of_late_frames_are_known_as_claimed(late):
    over, said = [], []
    for seed in range(6):
        recording, force, moment = thrown(seed, late)
        found = estimate_recording(recording, load_settings())
        inner = slice(40, -40)
        for off, std in ((found.force - force, found.force_std), (found.moment - moment, found.moment_std)):
            over.append(np.mean(off[inner] ** 2) / np.mean(std[inner] ** 2))
        said.append(found.verdict.level)
        assert "frames-late" in found.verdict.codes
    assert 0.3 < np.sqrt(np.mean(over)) < 1.2
    assert np.sqrt(np.max(over)) < 2.0
    assert said.count("ok") >= 5
