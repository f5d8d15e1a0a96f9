"""The peers of the chart do their job: on clean tracks their answer is the load."""

from dataclasses import replace

import numpy as np
import pytest
from spinning_body import spinning

from evidence.subjects.flights.cases import LOADS, case_of
from evidence.subjects.flights.peers.differentiators import (
    butterworth,
    numpy_gradient,
    quintic_spline,
    savgol,
    smoothing_spline,
)
from evidence.subjects.flights.peers.entrants import answer_of, best_choices, blind_peer, informed_peer
from evidence.subjects.flights.peers.expert import paths_of
from evidence.subjects.flights.peers.kalman import filterpy_rts, likeliest_rate


@pytest.mark.parametrize("second", [savgol, butterworth])
def test_a_low_pass_finds_slow_loads(second):
    case = case_of("spinning", spinning(6, 500), False)
    paths = paths_of(case.blind)
    wrench = np.hstack(answer_of(paths, second(paths.z, paths.step, cut=6.0)).found)
    error = np.sqrt(((wrench - case.wrench)[case.judged] ** 2).mean(0))
    load = np.sqrt((case.wrench[case.judged] ** 2).mean(0))
    assert (error[[0, 1, 2, 5]] < 0.4 * load[[0, 1, 2, 5]]).all()


@pytest.mark.parametrize(
    ("second", "settings"),
    [
        (numpy_gradient, {}),
        (savgol, {"cut": 20.0}),
        (butterworth, {"cut": 20.0}),
        (smoothing_spline, {"stiffness": 1e-12}),
        (filterpy_rts, {"rate": 20.0}),
        (quintic_spline, {"noise": 1.0}),
    ],
)
def test_second_derivative_of_a_tone(second, settings):
    step = 1 / 250
    t = step * np.arange(400)
    z = np.sin(np.outer(t, [6.0, 9.0])) + 1e-9 * np.random.default_rng(0).standard_normal((400, 2))
    found = second(z, step, **settings)
    found = found[0] if isinstance(found, tuple) else found
    expected = -np.array([36.0, 81.0]) * np.sin(np.outer(t, [6.0, 9.0]))
    np.testing.assert_allclose(found[60:-60], expected[60:-60], atol=2.0)


def test_sums_over_masses_and_a_rigid_fit_agree_on_a_rigid_body():
    recording = spinning(6, 200)
    body = replace(recording.body, mass=np.full(6, 0.2 / 6), total_mass=None, inertia=None, mass_center=None)
    recording = replace(recording, body=body, motion=replace(recording.motion, noise_std={"position": 1.0}))
    a, b = (paths_of(recording, by_mass).z for by_mass in (False, True))
    assert np.abs(a[:, :3] - b[:, :3]).max() < 2e-3
    assert np.abs(a[:, 5] - b[:, 5]).max() < 0.02 * np.abs(a[:, 5]).max()


def test_an_oracle_is_never_worse_than_a_setting_it_may_choose():
    case = case_of("spinning", spinning(6, 300), False)
    cuts = (3.0, 8.0, 15.0, 30.0)
    best = informed_peer("x", savgol, "", "cut", cuts)
    assert best.told
    oracle = np.hstack(best.prepare(case)().found)
    for cut in cuts:
        other = np.hstack(blind_peer("y", savgol, "", cut=cut).prepare(case)().found)
        for part in LOADS.values():
            assert rms(oracle, case, part) <= rms(other, case, part) * (1 + 1e-9)


def rms(wrench, case, part):
    return np.sqrt(np.mean((wrench - case.wrench)[case.judged, part] ** 2))


def test_an_oracle_may_take_another_cut_for_force_than_for_moment():
    case = case_of("spinning", spinning(6, 300), False)
    assert set(best_choices(case, savgol, "cut", (3.0, 30.0))) == {"force", "moment"}


def test_likelihood_follows_a_faster_load_faster():
    step, rng = 1 / 250, np.random.default_rng(1)
    t = step * np.arange(500)
    noise = 1e-3 * rng.standard_normal(500)
    slow, fast = (likeliest_rate(np.sin(w * t) + noise, step, 1e-3) for w in (3.0, 40.0))
    assert fast > 2 * slow
