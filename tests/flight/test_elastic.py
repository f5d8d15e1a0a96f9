"""The prior of elastic modes, on modes that drawn loads drive: their size, their speed, their damping."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from forceid.flight import elastic_spectra
from forceid.flight.elastic import seen_modes, tune_elastic
from forceid.flight.elastic_spectra import Elastic, scored, spectra_of, unlikeliness
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


@pytest.mark.skipif(elastic_spectra.compiled is None, reason="nothing was compiled")
def test_compiled_likelihood_of_modes_is_that_in_numpy(monkeypatch):
    rng = np.random.default_rng(3)
    observed, rows = seen(modes(0.02)[1], 1e3 * rng.standard_normal((3, 3)), rng)
    spectra = spectra_of(TIME, observed, rows)
    p, moves = rng.uniform(0.1, 2, (len(spectra.count), 3)), rng.standard_normal((len(spectra.count), 2, 3))
    compiled = spectra.misfit(p, moves)
    monkeypatch.setattr(elastic_spectra, "compiled", None)
    for one, other in zip(compiled, spectra.misfit(p, moves), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def test_second_slopes_in_the_mean_are_those_of_spectra_as_expected():
    """Where the cross spectra are what the densities make of them, the slope vanishes, and changes so."""
    rng = np.random.default_rng(4)
    observed, rows = seen(modes(0.02)[1], 1e3 * rng.standard_normal((3, 3)), rng)
    spectra = spectra_of(TIME, observed, rows)
    p = rng.uniform(0.1, 2, (len(spectra.count), 3))
    D, moves = spectra.rows, rng.standard_normal((len(p), 1, 3)) * p[:, None]
    expected = replace(spectra, power=np.eye(3) + (D * p[:, None]) @ D.T)
    _, slope, bend = expected.misfit(p, moves)
    assert np.abs(slope).max() < 1e-8 * bend.max()
    step = 1e-6
    ahead, behind = (expected.misfit(p + side * step * moves[:, 0], moves)[1] for side in (1, -1))
    assert bend.sum() == pytest.approx((ahead - behind).sum() / (2 * step), rel=1e-5)


@pytest.mark.parametrize("detuned", [1e-3, 0.1])
@pytest.mark.parametrize("seed", range(3))
def test_the_search_comes_as_far_as_that_of_scipy(seed, detuned):
    rng = np.random.default_rng(seed)
    observed, rows = seen(modes(0.02)[1], 1e3 * rng.standard_normal((3, 3)), rng)
    one = np.ones(3)
    elastic, spectra = Elastic(FREQUENCY, None, one, one, detuned * one), spectra_of(TIME, observed, rows)
    at, high = np.zeros(8), np.append([20.0, 10.0], np.full(6, 3.0))
    at[:2] = np.log([LOAD, RATE])
    tries = []

    def value(x):
        tries.append(x)
        return unlikeliness(spectra, elastic, 2, x)

    found, _ = scored(value, at, -high, high)
    count = len(tries)
    best = minimize(
        lambda x: value(x)[:2], at, jac=True, method="L-BFGS-B", bounds=list(zip(-high, high, strict=True))
    )
    assert found < best.fun + 0.5  # of a log-likelihood: a frequency may have more than one peak
    assert count < len(tries) - count
