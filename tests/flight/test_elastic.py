"""The prior of elastic modes, on modes that drawn loads drive: their size, their speed, their damping."""

import numpy as np
import pytest

from forceid.flight.elastic import Elastic, seen_modes, spectra_of, tune_elastic, unlikeliness
from forceid.flight.vibration import Vibration
from forceid.kalman.engines import engine

TIME = np.arange(600) / 500
FREQUENCY = 2 * np.pi * np.array([8.0, 13.0, 21.0])  # rad/s
LOAD, RATE = 40.0, 30.0  # m/s2 on unit modal mass, 1/s


def modes(damping, rate=RATE):
    """Modes of unit modal mass, and their prior under loads alike on all."""
    one = np.ones(3)
    unit = Vibration(FREQUENCY, damping * FREQUENCY, one, rate * one, 2)
    prior = Vibration(FREQUENCY, damping * FREQUENCY, LOAD / unit.load, rate * one, 2)
    return Elastic(FREQUENCY, None, one, one, np.full(3, 1e-3)), prior


def seen(prior, rows, rng):
    """What frames show (time, mode) of modes drawn from a prior."""
    rows = np.tile(rows, (len(TIME), 1, 1))
    model = seen_modes(TIME, rows, prior)
    x = np.linalg.cholesky(model.P0) @ rng.standard_normal(len(model.P0))
    root = np.linalg.cholesky(model.Q[0] + 1e-12 * np.diag(np.diag(model.P0)))
    H, found = np.broadcast_to(model.H, (len(TIME), *model.H.shape[-2:])), []
    for k in range(len(TIME)):
        found.append(H[k] @ x + rng.standard_normal(3))
        x = model.F[0] @ x + root @ rng.standard_normal(len(x))
    return np.array(found), rows


@pytest.mark.parametrize("seed", range(4))
def test_size_and_rate_of_the_loads_are_found_where_markers_tell_modes_apart(seed):
    elastic, prior = modes(0.02)
    observed, rows = seen(prior, 1e4 * np.eye(3), np.random.default_rng(seed))
    found = tune_elastic(TIME, observed, rows, elastic, engine()).vibration
    assert np.exp(np.abs(np.mean(np.log(found.load / LOAD)))) < 1.6
    assert 0.3 < found.rate[0] / RATE < 3.0


def test_modes_that_no_marker_tells_apart_share_the_size_of_their_loads():
    elastic, prior = modes(0.02)
    together = 1e4 * np.array([[1.0, 1.0, 1.0], [0, 0, 0], [0, 0, 0]])
    sizes = []
    for seed in range(6):
        observed, rows = seen(prior, together, np.random.default_rng(seed))
        sizes.append(tune_elastic(TIME, observed, rows, elastic, engine()).vibration.load)
    assert np.exp(np.abs(np.mean(np.log(np.array(sizes) / LOAD)))) < 1.5
    assert np.array(sizes).std() > 0  # each record has its own


def test_damping_narrower_than_a_spectrum_shows_is_told_to_a_factor_of_four():
    found = []
    for damping in (0.002, 0.05):
        elastic, prior = modes(damping)
        each = [
            tune_elastic(
                TIME, *seen(prior, 1e4 * np.eye(3), np.random.default_rng(seed)), elastic, engine()
            ).vibration
            for seed in range(4)
        ]
        found.append(np.exp(np.mean([np.log(one.damping / one.frequency).mean() for one in each])))
    assert 0.0005 < found[0] < 0.008
    assert found[1] > 0.0125


def test_a_frequency_that_spin_has_raised_is_found():
    elastic, prior = modes(0.005)
    told = Elastic(FREQUENCY / 1.03, None, np.ones(3), np.ones(3), np.full(3, 0.02))
    observed, rows = seen(prior, 1e5 * np.eye(3), np.random.default_rng(0))
    found = tune_elastic(TIME, observed, rows, told, engine()).vibration
    np.testing.assert_allclose(found.frequency, FREQUENCY, rtol=0.01)
    same = tune_elastic(TIME, observed, rows, elastic, engine()).vibration
    assert same.frequency[0] == pytest.approx(FREQUENCY[0], rel=0.005)


@pytest.mark.parametrize("order", [1, 2])
def test_slope_of_the_likelihood_is_that_of_its_differences(order):
    elastic, prior = modes(0.02)
    rng = np.random.default_rng(2)
    observed, rows = seen(prior, 1e3 * rng.standard_normal((3, 3)), rng)
    spectra = spectra_of(TIME, observed, rows)
    at = np.concatenate([np.log([LOAD, RATE]), 0.5 * rng.standard_normal(6)])
    slope = unlikeliness(spectra, elastic, order, at)[1]
    step = 1e-5 * np.eye(8)
    found = [
        (unlikeliness(spectra, elastic, order, at + d)[0] - unlikeliness(spectra, elastic, order, at - d)[0])
        / 2e-5
        for d in step
    ]
    np.testing.assert_allclose(slope, found, rtol=1e-5, atol=1e-5 * np.abs(slope).max())


def test_frames_that_show_less_are_left_out_and_too_few_make_no_prior():
    elastic, prior = modes(0.02)
    observed, rows = seen(prior, 1e4 * np.eye(3), np.random.default_rng(1))
    rows[::7], observed[::7, 1:] = 0.0, np.nan
    assert tune_elastic(TIME, observed, rows, elastic, engine()) is not None
    observed[5:] = np.nan
    assert tune_elastic(TIME, observed, rows, elastic, engine()) is None


def test_loads_that_answer_the_motion_are_found_where_they_act_and_nowhere_else():
    _, prior = modes(0.02)
    told = Elastic(FREQUENCY, np.full(3, 0.02), np.ones(3), np.ones(3), np.full(3, 1e-3))
    moved = Vibration(1.15 * FREQUENCY, 0.06 * FREQUENCY, prior.std, prior.rate, 2)
    for seed in range(3):
        free = tune_elastic(TIME, *seen(prior, 1e5 * np.eye(3), np.random.default_rng(seed)), told, engine())
        assert free.spring is None
        answered = tune_elastic(
            TIME, *seen(moved, 1e5 * np.eye(3), np.random.default_rng(seed)), told, engine()
        )
        np.testing.assert_allclose(answered.spring, (1.15**2 - 1) * FREQUENCY**2, rtol=0.5)
        assert (answered.brake > 0).all()
