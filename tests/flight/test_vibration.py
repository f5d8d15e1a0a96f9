"""The prior of a mode: stationary from the start, and found again in records drawn from it."""

import numpy as np
import pytest

from forceid.flight.vibration import Vibration, tune_vibrations, vibrating
from forceid.kalman.building.process import discretize, matern
from forceid.kalman.engines import engine

PRIOR = Vibration(
    np.array([350.0, 60.0]), np.array([4.0, 60.0]), np.array([5e-4, 1e-3]), np.array([20.0, 60.0])
)
STEP, SAMPLES, NOISE = 1e-3, 1500, 1e-4


def drawn(seed):
    rng = np.random.default_rng(seed)
    F, Q = discretize(PRIOR.process, STEP)
    x = np.einsum("mij,mj->mi", np.linalg.cholesky(PRIOR.process.P0), rng.standard_normal((2, 3)))
    root, q = np.linalg.cholesky(Q), np.empty((SAMPLES, 2))
    for k in range(SAMPLES):
        q[k] = x[:, 0]
        x = np.einsum("mij,mj->mi", F, x) + np.einsum("mij,mj->mi", root, rng.standard_normal((2, 3)))
    return np.arange(SAMPLES) * STEP, q + NOISE * rng.standard_normal(q.shape)


def test_vibration_is_stationary_from_the_start():
    p = PRIOR.process
    change = p.A @ p.P0 + p.P0 @ p.A.swapaxes(1, 2) + p.Qc
    size = np.sqrt(np.diagonal(p.P0, axis1=1, axis2=2))
    scale = size[:, :, None] * size[:, None] * np.abs(p.A).max((1, 2))[:, None, None]
    assert (np.abs(change) / scale).max() < 1e-12


@pytest.mark.parametrize("order", [1, 2, 3, 4, 6])
def test_every_covariance_of_a_mode_that_rests_balances_by_itself(order):
    # loads far slower than the mode, and far faster: the smallest entry is as exact as the largest
    frequency, rng = np.geomspace(0.5, 50.0, 40), np.random.default_rng(0)
    damping = frequency * np.exp(rng.uniform(-9, 0, 40))
    p = Vibration(frequency, damping, np.ones(40), frequency * np.geomspace(5e-3, 50.0, 40), order).process
    flow, most = p.A @ p.P0, np.abs(p.A) @ np.abs(p.P0)
    change, terms = flow + flow.mT + p.Qc, most + most.mT + p.Qc
    assert (np.abs(change) <= 1e-10 * terms).all()
    assert (np.diagonal(p.P0, axis1=1, axis2=2) > 0).all()


def test_equal_rates_make_a_matern_process_of_order_three():
    rate = np.array([40.0])
    ours, theirs = Vibration(rate, rate, np.ones(1), rate).process, matern(3, np.ones(1), rate)
    np.testing.assert_allclose(ours.P0[:, :2, :2], theirs.P0[:, :2, :2], rtol=1e-12)
    ours, theirs = (discretize(p, 0.02) for p in (ours, theirs))
    np.testing.assert_allclose(ours[1][:, :2, :2], theirs[1][:, :2, :2], rtol=1e-9)


def test_priors_are_found_again():
    time, q = drawn(0)
    q[200:210] = np.nan
    var = np.full_like(q, NOISE**2)
    found = tune_vibrations(time, q, var)
    assert abs(found.frequency[0] / 350 - 1) < 0.02
    assert 1 < found.damping[0] < 12
    np.testing.assert_allclose(found.std, PRIOR.std, rtol=0.5)
    likelihood = engine().log_likelihood
    for j in range(2):
        best, true = (likelihood(vibrating(p, var, np.diff(time)).one(j), q[:, j]) for p in (found, PRIOR))
        assert 0 < best - true < 12  # twice the chi-square of four numbers, at one in a thousand
