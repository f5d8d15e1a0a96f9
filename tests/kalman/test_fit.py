"""Parameters found by likelihood: against closed forms, by their spread, and where none is fixed."""

import numpy as np
import pytest
from linear_models import draw
from scipy.stats import chi2

from forceid.errors import EstimationError
from forceid.kalman import StateSpace, discretize, log_likelihood, matern, smooth
from forceid.kalman.building.process import integrate
from forceid.kalman.tuning.fit import model_derivatives, tune

STEP = 0.02


def driven_mass(p):
    """A unit mass under a Matern 3/2 force, seen in position: p = log std, log rate, log noise."""
    load = matern(2, np.exp(p[0]), np.exp(p[1]))
    chain = integrate(integrate(load, 1.0), 1.0)
    F, Q = discretize(chain, STEP)
    R = np.exp(2 * p[2]) * np.eye(1)
    return StateSpace(F, Q, np.eye(1, len(F)), R, np.zeros(len(F)), chain.P0)


TRUTH = np.log([1.0, 15.0, 1e-3])
BOUNDS = [(t - 4.0, t + 4.0) for t in TRUTH]


def drawn(seed, time=120):
    return draw(driven_mass(TRUTH), time, np.random.default_rng(seed))


def white(p):
    zero = np.zeros((1, 1))
    return StateSpace(np.eye(1), zero, np.eye(1), np.exp(2 * p[0]) * np.eye(1), np.zeros(1), zero)


def test_variance_of_white_noise_is_the_mean_square_and_its_error_that_of_a_chi_square():
    z = 2.5 * np.random.default_rng(1).standard_normal(300)
    fit = tune(white, [1.5], z, bounds=[(-4.0, 4.0)])
    assert np.exp(fit.theta[0]) == pytest.approx(np.sqrt(np.mean(z**2)), rel=1e-6)
    assert fit.covariance[0, 0] == pytest.approx(1 / 600, rel=1e-4)
    assert not fit.flat
    assert not fit.at_bound.any()
    assert not fit.bimodal


def test_derivatives_by_complex_step_are_those_by_difference():
    def real_only(p):
        return driven_mass(np.array([float(v.real) for v in p]) if np.iscomplexobj(p) else p)

    for exact, rough in zip(
        model_derivatives(driven_mass, TRUTH), model_derivatives(real_only, TRUTH), strict=True
    ):
        for name in ("F", "Q", "R", "P0"):
            a, b = getattr(exact, name), getattr(rough, name)
            np.testing.assert_allclose(a, b, atol=1e-6 * max(1e-12, np.abs(a).max()))


def test_tuned_parameters_are_as_far_off_as_their_covariance_says():
    """And the likelihood gains over the truth what a chi-square in three unknowns would."""
    off, gained = [], []
    for seed in range(12):
        _, z = drawn(seed)
        fit = tune(driven_mass, TRUTH + 0.5, z, BOUNDS)
        gained.append(2 * (fit.log_likelihood - float(log_likelihood(driven_mass(TRUTH), z))))
        error = fit.theta - TRUTH
        off.append(error @ np.linalg.solve(fit.covariance, error))
    low, high = chi2(36).interval(0.998)
    assert low < np.sum(gained) < high
    assert np.median(off) < chi2(3).ppf(0.75)  # heavier tails than normal: rates are known to a factor


@pytest.mark.long
def test_smoother_with_tuned_parameters_is_within_a_tenth_of_the_bound_and_calibrated():
    ratio, known, nees = [], [], []
    inner = slice(20, -20)
    for seed in range(100, 120):
        x, z = drawn(seed)
        fit = tune(driven_mass, TRUTH + np.array([0.5, -0.5, 0.3]), z, BOUNDS)
        for kept, model in ((known, driven_mass(TRUTH)), (ratio, fit.model)):
            path = smooth(model, z)
            error, var = (path.x - x)[inner, 2], path.P[inner, 2, 2]
            bound = smooth(driven_mass(TRUTH), z).P[inner, 2, 2] if kept is ratio else var
            kept.append([np.mean(error**2), np.mean(bound)])
        nees.append(np.mean(error**2 / var))
    oracle, tuned = (np.sqrt(np.divide(*np.mean(v, 0))) for v in (known, ratio))
    assert 0.93 < oracle < 1.07  # 20 short records
    assert tuned / oracle <= 1.10
    spread = np.std(nees) / np.sqrt(len(nees))
    assert abs(np.mean(nees) - 1) < 3 * spread + 0.1


def test_parameter_that_the_record_does_not_hold_is_flat():
    def idle(p):
        return white(p[:1])

    z = np.random.default_rng(2).standard_normal(100)
    fit = tune(idle, [0.0, 0.0], z, bounds=[(-3.0, 3.0), (-1.0, 1.0)])
    assert fit.flat
    assert np.isnan(fit.covariance).all()


def test_noise_that_is_not_there_is_pushed_against_its_bound():
    x, _ = drawn(3)
    fit = tune(driven_mass, TRUTH, x[:, :1], bounds=[*BOUNDS[:2], (np.log(1e-4), 0.0)])
    assert fit.at_bound.tolist() == [False, False, True]
    assert fit.covariance[2, 2] == 0.0


def two_signs(p):
    """A sine whose sign of frequency the record cannot tell."""
    F = np.array([[np.cos(p[0]), -np.sin(p[0])], [np.sin(p[0]), np.cos(p[0])]])
    return StateSpace(F, 0 * np.eye(2), np.eye(1, 2), 0.01 * np.eye(1), np.zeros(2), np.eye(2))


def test_second_maximum_as_likely_is_found_from_another_start_and_named():
    z = np.cos(0.7 * np.arange(60)) + 0.1 * np.random.default_rng(4).standard_normal(60)
    one = tune(two_signs, [0.69], z)
    both = tune(two_signs, [0.69], z, starts=[[-0.71]])
    assert not one.bimodal
    assert both.bimodal
    assert abs(both.rival[0]) == pytest.approx(abs(both.theta[0]), abs=1e-6)
    assert abs(both.theta[0]) == pytest.approx(0.7, abs=5e-3)


def test_lower_hill_is_left_for_the_higher_one():
    z = np.cos(0.7 * np.arange(60)) + 0.1 * np.random.default_rng(5).standard_normal(60)
    fit = tune(two_signs, [1.8], z, starts=[[0.69]])
    assert fit.theta[0] == pytest.approx(0.7, abs=5e-3)
    assert not fit.bimodal


def test_model_refused_everywhere_is_an_error_with_a_next_step():
    def refused(p):
        return StateSpace(*np.zeros((4, 1, 1)), np.zeros(1), np.zeros((1, 1)))

    with pytest.raises(EstimationError, match="is refused at every start"):
        tune(refused, [0.0], np.ones(5))
