"""Difference, Savitzky-Golay and spline: their windows, what they recover, and what they claim."""

from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.subjects.flights.failures.sensing import jitter
from evidence.subjects.flights.trial import answered_flight
from forceid.config import load_settings
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.loads.channels import force_channel
from forceid.estimation.methods.classic import (
    choose_force,
    choose_moment,
    cut_by_filter,
    estimate_classic,
    local_bias,
    louder,
    measured_angular_channel,
    spin,
)
from forceid.estimation.run import estimate_recording
from forceid.flight.color import LowPassed
from forceid.kalman.engines import engine
from forceid.motion.derivative import derivatives
from forceid.motion.window import Window, WindowChoice, windows

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


@pytest.mark.parametrize("method", ROUTES)
@pytest.mark.parametrize("late", [0.3, 0.9])
def test_frames_that_come_late_by_more_than_markers_show_are_in_the_claim(method, late):
    over = []
    for seed in range(4):
        case = jitter(late, np.random.default_rng([seed, 2027]))
        over.append(answered_flight(estimate_recording, method, "auto", case).over)
    assert np.sqrt(np.mean(np.square(over), 0)).max() < 2.0


def test_markers_that_err_alone_leave_the_noise_as_they_show_it():
    recording = cf.toss()
    kin = seen(recording)
    assert louder(force_channel(kin, recording.motion.gravity)) == 1.0
    assert louder(measured_angular_channel(kin)) == 1.0


def test_windows_that_bridge_lost_samples_claim_the_bias_of_their_length():
    time = cf.clock(200)
    choice = WindowChoice(Window("savgol", 4, 10, 10 * (time[1] - time[0])), time, time, 0.5)
    seen_at = np.delete(np.arange(200), np.arange(96, 104))
    z = np.full((200, 1), np.nan)
    z[seen_at] = np.sin(time[seen_at])[:, None]
    growth = local_bias(time, derivatives(time, z, choice.window), choice, time[96:104])[:, 0, 0]
    assert growth[:80] == pytest.approx(1.5)
    assert growth[150:] == pytest.approx(1.5)
    assert growth[100] > 3.0


@pytest.mark.parametrize(("cut", "taken"), [(40.0, False), (6.0, True)])
def test_a_filter_matters_where_the_window_follows_what_it_took(cut, taken):
    kin = seen(cf.toss())
    step = float(np.median(np.diff(kin.time)))
    filtered = replace(kin, color=LowPassed(4, cut, step))
    window = Window("savgol", 4, round(0.07 / step), 0.07)
    assert cut_by_filter(filtered, derivatives(kin.time, kin.pose.center, window)) is taken
    assert not cut_by_filter(kin, derivatives(kin.time, kin.pose.center, window))
