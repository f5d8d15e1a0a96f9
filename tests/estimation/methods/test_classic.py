"""Difference, Savitzky-Golay and spline: their windows, what they recover, and what they claim."""

import closed_forms as cf
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.methods.classic import (
    choose_force,
    choose_moment,
    estimate_classic,
    measured_angular_channel,
    spin,
)
from forceid.kalman.engines import engine
from forceid.motion.window import windows

ROUTES = ("difference", "savgol", "spline")


def solved(recording, method, **settings):
    return estimate_classic(
        recording.body, recording.motion, load_settings(method=method, **settings), engine()
    )


def seen(recording, **settings):
    return kinematics(recording.body, recording.motion, load_settings(**settings))


@pytest.mark.parametrize("method", ROUTES)
def test_steady_wrench_is_recovered_within_its_claims(method):
    recording = cf.toss()
    state = solved(recording, method).state
    std = np.sqrt(np.diagonal(state.wrench_cov, axis1=1, axis2=2))
    error = np.hstack([state.force, state.moment]) - np.hstack(
        [recording.truth["force"], recording.truth["moment"]]
    )
    assert cf.rms(error / std) < 1.2
    assert cf.rms(error[:, :3]) < 0.02 * np.linalg.norm(cf.FORCE)
    assert cf.rms(error[:, 3:]) < 0.15 * cf.INERTIA[2, 2] * cf.SPIN[1]


@pytest.mark.parametrize("method", ROUTES)
def test_steady_force_without_noise_is_exact(method):
    recording = cf.toss(noise=1e-12)
    state = solved(recording, method).state
    np.testing.assert_allclose(state.force, recording.truth["force"], atol=2e-4)


@pytest.mark.parametrize("method", ROUTES)
def test_breathing_body_needs_the_rate_of_its_inertia(method):
    recording = cf.toss(breath=0.05, noise=3e-5)
    moment = recording.truth["moment"]
    deforming = solved(recording, method).state.moment
    rigid = solved(recording, method, model="rigid").state.moment
    inner = slice(10, -10)
    assert cf.rms((deforming - moment)[inner]) < 0.2 * cf.rms(moment)
    assert cf.rms((rigid - moment)[inner]) > 0.5 * cf.rms(moment)


def test_quieter_record_gets_a_shorter_window():
    # a force that changes is what a long window blurs
    def force_window(noise):
        recording = cf.toss(noise=noise)
        t = recording.motion.time
        shake = np.outer(np.sin(40 * t) / 40**2, [5.0, 0, 0])
        kin = seen(cf.seen_as(recording, recording.motion.position + shake[:, None]))
        return choose_force(kin, cf.GRAVITY, windows("savgol", t)).window.seconds

    assert force_window(1e-5) < force_window(1e-3)


def test_force_and_moment_get_each_the_window_that_they_call_for():
    recording = cf.waved(cf.toss(breath=0.03))
    solution = solved(recording, "savgol")
    assert {"force_window_s", "moment_window_s", "noise_std_position"} <= set(solution.tuned)
    kin, candidates = seen(recording), windows("savgol", recording.motion.time)
    moment = choose_moment(measured_angular_channel(kin), candidates)
    assert solution.tuned["moment_window_s"] == moment.window.seconds
    assert solution.tuned["force_window_s"] == choose_force(kin, cf.GRAVITY, candidates).window.seconds


@pytest.mark.parametrize("method", ROUTES)
def test_spin_comes_from_the_axes_of_the_body(method):
    recording = cf.toss()
    kin = seen(recording)
    window = windows(method, kin.time)[-1 if method == "spline" else 4]
    omega, rotation = spin(kin, window)
    truth = (cf.SPIN[0] + cf.SPIN[1] * kin.time)[:, None] * cf.AXIS
    assert cf.rms(omega - truth) < 0.15
    R = Rotation.from_matrix(rotation) * Rotation.from_quat(recording.truth["orientation"]).inv()
    assert cf.rms(R.magnitude()) < 2e-2
    np.testing.assert_allclose(
        rotation @ rotation.swapaxes(1, 2), np.tile(np.eye(3), (120, 1, 1)), atol=1e-12
    )


@pytest.mark.parametrize("method", ROUTES)
def test_engine_is_not_used(method):
    recording = cf.toss(cf.clock(40))
    a = estimate_classic(recording.body, recording.motion, load_settings(method=method), engine("numpy"))
    b = estimate_classic(recording.body, recording.motion, load_settings(method=method), engine("filterpy"))
    np.testing.assert_array_equal(a.state.force, b.state.force)
    assert a.engine == b.engine == "scipy"
