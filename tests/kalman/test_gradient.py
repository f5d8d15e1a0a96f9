"""The score against central differences and against the complex step of the dense Gaussian density."""

from dataclasses import replace

import numpy as np
import pytest
from linear_models import draw, hard_case, random_cov

from forceid.kalman import StateSpace, log_likelihood
from forceid.kalman.tuning.gradient import NAMES, score

SYMMETRIC = ("Q", "R", "P0")


def constant_case(seed=1, time=12, n=3, m=2):
    rng = np.random.default_rng(seed)
    F = 0.9 * np.eye(n) + 0.2 * rng.standard_normal((n, n))
    H, u = rng.standard_normal((m, n)), rng.standard_normal(n)
    x0, P0 = rng.standard_normal(n), random_cov(rng, n)
    model = StateSpace(F, random_cov(rng, n, 0.3), H, random_cov(rng, m, 0.2), x0, P0, u)
    z = draw(model, time, rng)[1]
    z[4] = np.nan
    z[7, 0] = z[0, 1] = np.nan
    return model, z


def dense_log_likelihood(model, z):
    """Log-likelihood of all samples at once; complex matrices allowed."""
    n, time, seen = len(model.x0), len(z), np.isfinite(z).ravel()
    mean, to_state, sources = [model.x0], [np.eye(n, time * n)], [model.P0]
    for k in range(time - 1):
        F = model.at("F", k)
        mean.append(F @ mean[-1] + (0.0 if model.u is None else model.at("u", k)))
        to_state.append(F @ to_state[-1] + np.eye(time * n)[(k + 1) * n : (k + 2) * n])
        sources.append(model.at("Q", k))
    to_z = np.vstack([model.at("H", k) @ to_state[k] for k in range(time)])
    spread = np.zeros((time * n, time * n), complex)
    for k, cov in enumerate(sources):
        spread[k * n : (k + 1) * n, k * n : (k + 1) * n] = cov
    cov, m = to_z @ spread @ to_z.T, z.shape[1]
    for k in range(time):
        cov[k * m : (k + 1) * m, k * m : (k + 1) * m] += model.at("R", k)
    mean = np.concatenate([model.at("H", k) @ mean[k] for k in range(time)])
    e, cov = (z.ravel() - mean)[seen], cov[seen][:, seen]
    # real part by the determinant of the real matrix, imaginary part to first order
    _, log_det = np.linalg.slogdet(cov.real)
    log_det = log_det + 1j * np.trace(np.linalg.solve(cov.real, cov.imag))
    return -0.5 * (e @ np.linalg.solve(cov, e) + log_det + seen.sum() * np.log(2 * np.pi))


def directions(model, name, rng):
    """A random change of one matrix, symmetric where the matrix is."""
    change = rng.standard_normal(getattr(model, name).shape)
    return change + change.swapaxes(-1, -2) if name in SYMMETRIC else change


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("case", [constant_case, hard_case])
def test_score_is_the_complex_step_of_the_dense_density(case, name):
    model, z = case()
    assert dense_log_likelihood(model, z).real == pytest.approx(float(log_likelihood(model, z)), rel=1e-10)
    change = directions(model, name, np.random.default_rng(5))
    moved = replace(model, **{name: getattr(model, name) + 1e-30j * change})
    exact = dense_log_likelihood(moved, z).imag / 1e-30
    found = np.sum(getattr(score(model, z), name) * change)
    assert found == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("case", [constant_case, hard_case])
def test_score_is_the_central_difference_of_the_likelihood(case, name):
    model, z = case()
    change = directions(model, name, np.random.default_rng(6))
    h = 1e-6
    ahead, behind = (
        float(log_likelihood(replace(model, **{name: getattr(model, name) + s * h * change}), z))
        for s in (1, -1)
    )
    found = np.sum(getattr(score(model, z), name) * change)
    assert found == pytest.approx((ahead - behind) / (2 * h), rel=1e-6, abs=1e-5)


def test_score_of_a_state_known_exactly_is_finite_and_right():
    """A state that starts at zero for certain, and that nothing drives: no covariance can be inverted."""
    model, z = constant_case()
    still = model.P0.copy()
    still[0], still[:, 0] = 0.0, 0.0
    quiet = model.Q.copy()
    quiet[0], quiet[:, 0] = 0.0, 0.0
    model = replace(model, P0=still, Q=quiet)
    change = directions(model, "Q", np.random.default_rng(7))
    moved = replace(model, Q=model.Q + 1e-30j * change)
    exact = dense_log_likelihood(moved, z).imag / 1e-30
    assert np.sum(score(model, z).Q * change) == pytest.approx(exact, rel=1e-8)


def test_score_along_a_change_of_every_matrix_is_the_sum_of_its_parts():
    model, z = hard_case()
    rng = np.random.default_rng(8)
    change = StateSpace(**{name: directions(model, name, rng) for name in NAMES})
    moved = StateSpace(**{name: getattr(model, name) + 1e-30j * getattr(change, name) for name in NAMES})
    exact = dense_log_likelihood(moved, z).imag / 1e-30
    assert score(model, z).along(change) == pytest.approx(exact, rel=1e-8)


def test_expected_score_of_data_from_the_model_is_zero():
    model, _ = constant_case()
    rng = np.random.default_rng(9)
    each = [score(model, draw(model, 12, rng)[1]) for _ in range(400)]
    for name in NAMES:
        values = np.array([getattr(s, name).ravel() for s in each])
        error = values.std(0) / np.sqrt(len(values))
        assert (np.abs(values.mean(0)) < 4.5 * error + 1e-12).all()
