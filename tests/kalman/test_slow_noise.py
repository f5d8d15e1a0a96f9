"""What slow errors do to a smoother that takes them for white: against errors drawn and sent through it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from forceid.kalman import StateSpace, discretize, smooth
from forceid.kalman.building.process import integrate, matern
from forceid.kalman.tuning.calibration import RATES, slow_noise_cov

STEP, COUNT, NOISE = 0.01, 201, 1e-3
TIME = STEP * np.arange(COUNT)


def tracked():
    chain = integrate(integrate(matern(2, 1.0, 15.0), 1.0), 1.0)
    F, Q = discretize(chain, STEP)
    H = np.eye(1, len(F))
    return StateSpace(F, Q, H, NOISE**2 * np.eye(1), np.zeros(len(F)), chain.P0)


def force_row():
    return np.eye(4)[2:3]


def slow_errors(rate, count, seed=0):
    """Matern 1/2 errors (count, time) of unit size."""
    a = np.exp(-rate * STEP)
    white = np.random.default_rng(seed).standard_normal((count, COUNT))
    white[:, 1:] *= np.sqrt(1 - a**2)
    return lfilter([1.0], [1.0, -a], white, axis=1)


def test_covariance_is_that_of_drawn_errors_at_their_worst_speed():
    cov = slow_noise_cov(tracked(), force_row(), TIME, NOISE, smooth)
    made = [
        np.mean([smooth(tracked(), NOISE * e).x[COUNT // 2, 2] ** 2 for e in slow_errors(rate, 60)])
        for rate in RATES[8::4]
    ]
    assert cov[0, 0] == pytest.approx(max(made), rel=0.4)


def test_slow_errors_do_more_harm_than_white_ones_of_their_size():
    model = tracked()
    white = np.mean(
        [
            smooth(model, NOISE * np.random.default_rng(s).standard_normal(COUNT)).x[COUNT // 2, 2] ** 2
            for s in range(60)
        ]
    )
    assert slow_noise_cov(model, force_row(), TIME, NOISE, smooth)[0, 0] > 2 * white


def test_covariance_grows_with_the_square_of_the_errors():
    one, three = (slow_noise_cov(tracked(), force_row(), TIME, s * NOISE, smooth) for s in (1, 3))
    np.testing.assert_allclose(three, 9 * one)
