"""Difference, Savitzky-Golay and spline: their windows, what they recover, and what they claim."""

import closed_forms as cf
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.subjects.flights.failures.noise import smoothed_before
from evidence.subjects.flights.failures.sensing import jitter
from evidence.subjects.flights.trial import answered_flight
from forceid.config import load_settings
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.loads.channels import force_channel
from forceid.estimation.methods.classic import (
    choose_force,
    choose_moment,
    estimate_classic,
    louder,
    measured_angular_channel,
    spin,
)
from forceid.estimation.methods.window_bias import bias_of
from forceid.estimation.run import estimate_recording
from forceid.kalman.engines import engine
from forceid.motion.derivative import derivatives
from forceid.motion.window import Window, WindowChoice, choose_window, windows

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


@pytest.mark.long
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


TIME = np.arange(240) / 200
RATE = 12.0  # 1/s, of a Matern load


def drawn(rng, noise, seen):
    """Path (time, 3), seen or not, of a load of order 3, and the load: a sum of waves, in closed form."""
    w = np.geomspace(0.05 * RATE, 20 * RATE, 400)
    size = np.sqrt(np.gradient(w) / (RATE**2 + w**2) ** 3 * 16 * RATE**5 / (3 * np.pi))
    a, b = size[:, None] * rng.standard_normal((2, len(w), 3))
    c, s = np.cos(TIME[:, None] * w), np.sin(TIME[:, None] * w)
    path = -(c @ (a / w[:, None] ** 2) + s @ (b / w[:, None] ** 2))
    path += noise * rng.standard_normal(path.shape)
    return np.where(seen[:, None], path, np.nan), c @ a + s @ b


def gap(rng):
    return (TIME < 0.5) | (TIME > 0.6)


def scattered(rng):
    return rng.random(len(TIME)) > 0.6


@pytest.mark.long
@pytest.mark.parametrize("method", ROUTES)
@pytest.mark.parametrize("lost", [gap, scattered])
def test_what_a_window_takes_across_gaps_is_claimed(method, lost):
    over, noise = [], 1e-4
    for seed in range(12):
        rng = np.random.default_rng([seed, 31])
        seen = lost(rng)
        z, load = drawn(rng, noise, seen)

        def estimate(window, z=z):
            d = derivatives(TIME, z, window)
            return d.second, noise**2 * d.gain[:, :, 2, 2]

        choice = choose_window(windows(method, TIME), estimate)
        own = estimate(choice.window)[1].sum(1)
        bias = bias_of(TIME, seen, choice, own)
        near = slice(30, 210)
        off = ((choice.target - load) ** 2).sum(1)[near]
        over.append(np.nanmean(off) / np.nanmean((own + bias)[near]))
    assert 0.2 < np.sqrt(np.mean(over)) < 1.3


def test_a_gap_costs_the_samples_beside_it_and_no_others():
    seen = gap(None)
    window = Window("savgol", 4, 10, 0.05)
    choice = WindowChoice(
        window, np.sin(9 * TIME)[:, None], TIME, 1.0, True, Window("savgol", 4, 7, 0.035), 1.0
    )
    d = derivatives(TIME, np.where(seen, TIME, np.nan)[:, None], window)
    bias = bias_of(TIME, seen, choice, d.gain[:, 0, 2, 2] * 1e-9)
    assert np.ptp(bias[20:80]) < 0.01 * bias[50]
    assert bias[99] > 3 * bias[50]


@pytest.mark.long
@pytest.mark.parametrize("method", ROUTES)
def test_what_a_filter_took_at_the_source_is_claimed(method):
    over = []
    for seed in range(3):
        case = smoothed_before(15, np.random.default_rng([seed, 2028]))
        found = answered_flight(estimate_recording, method, "auto", case)
        assert found.verdict == "ok"
        over.append(found.over)
    assert np.max(over) < 2.0


def test_so_few_frames_that_nothing_is_told_are_said():
    recording = cf.toss()
    x = recording.motion.position.copy()
    for kept, said in ((15, True), (60, False)):
        lost = np.ones(len(x), bool)
        lost[np.linspace(0, len(x) - 1, kept).astype(int)] = False
        found = solved(cf.seen_as(recording, np.where(lost[:, None, None], np.nan, x)), "savgol").findings
        assert ("gaps-in-windows" in [f.code for f in found]) is said
