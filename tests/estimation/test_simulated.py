"""The motion that a found load produces is the one that was measured, to its noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.cli.app import main
from forceid.config import load_settings
from forceid.errors import DataError, EstimationError
from forceid.estimation import fly_again, recording_of
from forceid.estimation.run import estimate_recording
from forceid.files import is_result, read_motion, write_result
from forceid.records import Estimate, Flown, Verdict
from forceid.scenes import load_recipe, simulate


def exact(time, force, moment, J, H0, R, v0):
    """An estimate that knows its load and its motion."""
    n = len(time)
    flown = Flown(
        np.zeros((n, 3)), R, np.tile(1e-8 * np.eye(6), (n, 1, 1)), np.tile(J, (n, 1, 1)), np.zeros((n, 3))
    )
    zeros = np.zeros((n, 3))
    return Estimate(
        time, force, moment, np.zeros((n, 6, 6)), zeros, zeros + v0, R, zeros, H0 + zeros,
        np.zeros((n, 0, 3)), np.zeros((0, 3)), np.zeros(n), np.zeros((n, 0)), 2.0,
        np.array([0, 0, -9.81]), (), "smoother", "rigid", "numpy", 0.0, "mass_center", Verdict(), flown=flown,
    )  # fmt: skip


def test_a_constant_force_makes_a_parabola_and_a_free_top_its_cone():
    t = np.linspace(0.0, 2.0, 201)
    J, H0 = np.diag([0.02, 0.02, 0.03]), np.array([0.1, 0.0, 0.3])
    # a symmetric top: turns about H at H / Jx, and about its own axis at the rest of its spin
    tilt = np.arctan2(0.1, 0.3)
    along = H0 / np.linalg.norm(H0)
    R0 = Rotation.identity()
    own = (1 / 0.03 - 1 / 0.02) * np.linalg.norm(H0) * np.cos(tilt)
    turns = [
        Rotation.from_rotvec(along * np.linalg.norm(H0) / 0.02 * s)
        * R0
        * Rotation.from_rotvec([0, 0, own * s])
        for s in t
    ]
    q = np.array([turn.as_quat(canonical=True) for turn in turns])
    force = np.tile([1.0, 0.0, 2.0], (len(t), 1))
    e = exact(t, force, np.zeros_like(force), J, H0, q, np.array([3.0, 0.0, 1.0]))
    center = np.array([3.0, 0, 1]) * t[:, None] + 0.5 * t[:, None] ** 2 * np.array([0.5, 0.0, 1.0 - 9.81])
    e = replace(
        e, flown=replace(e.flown, center=center), angular_velocity=np.tile([5.0, 0.0, 10.0], (len(t), 1))
    )
    found = fly_again(e)
    assert np.abs(found.center - center).max() < 1e-9
    assert found.rms[1] < 2e-6


@pytest.mark.parametrize("scene", ["frisbee", pytest.param("wobbling_drop", marks=pytest.mark.long)])
def test_a_found_load_flies_to_the_noise_of_its_record(scene, tmp_path):
    recording = simulate(load_recipe(f"data/synthetic/{scene}.toml"))
    found = estimate_recording(recording, load_settings())
    again = fly_again(found)
    assert 0.9 < again.misfit < 1.1
    wrong = replace(found, force=1.05 * found.force)
    assert fly_again(wrong).misfit > 5.0


def test_what_shows_no_pose_or_another_point_is_refused(tmp_path):
    t = np.linspace(0, 1, 20)
    zeros, q = np.zeros((20, 3)), np.tile([0.0, 0, 0, 1], (20, 1))
    e = exact(t, zeros, zeros, np.eye(3), np.zeros(3), q, np.zeros(3))
    with pytest.raises(DataError, match="no poses"):
        fly_again(replace(e, flown=None))
    with pytest.raises(DataError, match="expected the mass center"):
        fly_again(replace(e, moment_about="n1"))
    with pytest.raises(EstimationError, match="too far off to be flown again"):
        fly_again(replace(e, force=zeros + 1e308, mass=0.1))
    jump = np.where(np.arange(20)[:, None] == 9, 1e308, zeros)  # itself a number, its slope none
    with pytest.raises(EstimationError, match="too far off to be flown again"):
        fly_again(replace(e, moment=jump))
    with pytest.raises(EstimationError, match="too far off to be flown again"):
        fly_again(replace(e, angular_velocity=zeros * np.nan))
    with pytest.raises(EstimationError, match=r"turns by 1.73e\+300 rad/s"):
        fly_again(replace(e, angular_velocity=jump / 1e8))


def test_the_command_writes_the_motion_that_a_result_produces(tmp_path, capsys):
    t = np.linspace(0, 1, 60)
    force, q = np.tile([0.5, 0.0, 19.62], (60, 1)), np.tile([0.0, 0, 0, 1], (60, 1))
    center = 0.125 * t[:, None] ** 2 * np.array([1.0, 0, 0])
    e = exact(t, force, np.zeros_like(force), np.eye(3), np.zeros(3), q, np.zeros(3))
    write_result(tmp_path / "r.h5", replace(e, flown=replace(e.flown, center=center)))
    assert is_result(tmp_path / "r.h5")
    assert main(["simulate", str(tmp_path / "r.h5"), "-o", str(tmp_path / "m.h5")]) == 0
    assert "off by" in capsys.readouterr().out
    motion = read_motion(tmp_path / "m.h5").motion
    assert np.abs(motion.center - center).max() < 1e-9
    assert main(["simulate", str(tmp_path / "r.h5"), "-o", str(tmp_path / "m.h5"), "--seed", "3"]) == 2
    assert recording_of(fly_again(e), e, "x").body.total_mass == 2.0
