"""Thrown boxes that a gyro and an accelerometer alone watch: they end, and the truth lies in the claims."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.drawn.thrown_box import draw_throw, stated_settings, write_throw
from evidence.judged import LOADS, judged_part, rms
from forceid.config import load_settings
from forceid.estimation.loads.rough_look import rough_priors
from forceid.estimation.methods.imu_only import unmarked_flight, unmarked_kinematics
from forceid.estimation.methods.turning_loads import with_left_over
from forceid.estimation.run import estimate_recording
from forceid.files.stored.hdf5 import read_motion
from forceid.flight.model import unsettled
from forceid.flight.smoother import smooth_flight
from forceid.kalman import engine
from forceid.significance import QUANTILE, TENTH

# seed and number of a draw of a short record: what pushes, how often it is sampled, how fast it turns
BODY_55 = 1, 31  # 55 Hz, 3.6 rev/s
WORLD_95 = 2, 25  # 95 Hz, 1.6 rev/s
BODY_25 = 21, 50  # 25 Hz, 9.6 rev/s
BODY_17 = 0, 6  # 17 Hz, 0.4 rev/s


def thrown_box(seed, number, folder):
    thrown = draw_throw(np.random.default_rng([seed, number]))
    write_throw(folder / "box.h5", thrown)
    return thrown, folder / "box.h5"


@pytest.mark.parametrize("which", [WORLD_95, BODY_17])
@pytest.mark.long
def test_a_thrown_box_without_markers_ends_with_force_and_moment_within_their_claims(which, tmp_path):
    thrown, path = thrown_box(*which, tmp_path)
    found = estimate_recording(read_motion(path), load_settings(None, **stated_settings(thrown)))
    assert found.verdict.level in ("ok", "degraded")  # biases that are not stated are in the claim
    for load in LOADS:
        truth = getattr(thrown, load)
        error, claim = (judged_part(a) for a in (getattr(found, load) - truth, getattr(found, f"{load}_std")))
        assert np.mean(np.abs(error) < QUANTILE * claim) > 0.8
        assert np.sqrt(np.mean((error / claim) ** 2)) < 1.7
        assert rms(error) < 0.5 * rms(truth)


@pytest.mark.parametrize("turns", [False, True])
def test_the_path_of_a_thrown_box_comes_to_rest_under_any_prior_with_biases_unknown(turns, tmp_path):
    _, path = thrown_box(*BODY_55, tmp_path)
    recording, settings = read_motion(path), load_settings()
    kin = unmarked_kinematics(recording.body, recording.motion, settings)
    flight = unmarked_flight(recording.body, recording.motion, settings, kin)
    body_axes = np.eye(3) if turns else None
    force, moment = (replace(prior, body_axes=body_axes) for prior in rough_priors(flight))
    state = smooth_flight(flight, force, moment, engine())
    _, left = with_left_over(flight, force, moment, engine(), state)
    assert left < TENTH
    assert "add a gyro" not in " ".join(unsettled(flight))


@pytest.mark.long
def test_a_load_that_turns_with_a_box_is_told_where_that_turns_by_radians_between_samples(tmp_path):
    thrown, path = thrown_box(*BODY_25, tmp_path)
    step = np.diff(thrown.time)
    assert np.linalg.norm(thrown.omega, axis=1).max() * step.max() > 2
    found = estimate_recording(read_motion(path), load_settings(load_axes="body", **stated_settings(thrown)))
    z = (found.moment - thrown.moment) / np.sqrt(np.diagonal(found.wrench_cov, axis1=1, axis2=2)[:, 3:])
    assert np.sqrt(np.mean(z[4:-4] ** 2)) < 1.7
    assert np.abs(found.moment - thrown.moment)[4:-4].max() < 0.1 * np.abs(thrown.moment).max()
    assert "turn-not-resolved" not in found.verdict.codes


@pytest.mark.long
@pytest.mark.filterwarnings("error")
def test_a_gyro_alone_tells_the_moment_and_says_that_no_force_is_told(tmp_path):
    _, path = thrown_box(*BODY_17, tmp_path)
    recording = read_motion(path)
    gyro = replace(recording, motion=replace(recording.motion, specific_force=None))
    found = estimate_recording(gyro, load_settings(load_axes="body"))
    assert np.isnan(found.force).all()
    assert np.isfinite(found.moment).all()
    assert "no-accelerometer" in found.verdict.codes
