import re

import numpy as np
import pytest
from linear_models import draw
from scipy.stats import chi2

from forceid import kalman
from forceid.kalman.tuning.calibration import autocorrelation, chi_square_band, consistency, nees


def mass_under_force(q=1.0, r=1.0):
    load = kalman.matern(2, std=1.0, rate=30.0)
    chain = kalman.integrate(kalman.integrate(load, var=0.01), var=1e-4)
    F, Q = kalman.discretize(chain, 0.004)
    R = np.array([[9e-10]])
    return kalman.StateSpace(F, q * Q, chain.output[None], r * R, np.zeros(4), chain.P0)


@pytest.mark.parametrize("seed", range(5))
def test_a_true_model_passes(seed):
    z = draw(mass_under_force(), 3000, np.random.default_rng(seed))[1]
    assert consistency(kalman.filter(mass_under_force(), z)).ok


@pytest.mark.parametrize(
    ("q", "r", "meaning"),
    [
        (1e-2, 1.0, "over-confident.*moves faster than its prior"),
        (1e2, 1.0, "under-confident.*not white"),
        (1.0, 1e-2, "over-confident.*believed too much"),
        (1.0, 1e2, "under-confident.*not white"),
        (1e-2, 1e-2, "over-confident: innovations are (9|10)"),
        (1e2, 1e2, "under-confident: innovations are 0.1"),
    ],
)
def test_noise_wrong_by_two_decades_is_named(q, r, meaning):
    z = draw(mass_under_force(), 3000, np.random.default_rng(1))[1]
    wrong = consistency(kalman.filter(mass_under_force(q, r), z))
    assert not wrong.ok
    assert re.search(meaning, wrong.sentence)


@pytest.mark.parametrize(("q", "r"), [(1e-4, 1.0), (1.0, 1e-4), (1e4, 1.0), (1.0, 1e4)])
def test_nees_shows_what_the_innovations_show(q, r):
    x, z = draw(mass_under_force(), 3000, np.random.default_rng(2))
    s = kalman.smooth(mass_under_force(q, r), z)
    claimed = np.mean((s.x[:, 2] - x[:, 2]) ** 2 / s.P[:, 2, 2])
    assert claimed > 1.3 if min(q, r) < 1 else claimed < 0.8
    assert ("over" if claimed > 1 else "under") + "-confident" in consistency(s.filtered).sentence


def test_nees_of_draws_lies_in_its_chi_square_band():
    model, rng = mass_under_force(), np.random.default_rng(5)
    ends = []
    for _ in range(400):
        x, z = draw(model, 60, rng)
        s = kalman.smooth(model, z)
        ends.append(nees(s.x, s.P, x)[30])
    low, high = chi_square_band(400 * 4, 0.05)
    assert low < np.mean(ends) < high


def test_the_band_is_that_of_chi_square():
    low, high = chi_square_band(50, 0.05)
    np.testing.assert_allclose((low, high), np.array(chi2(50).interval(0.95)) / 50, rtol=1e-12)


def test_gaps_do_not_count_in_the_autocorrelation():
    rng = np.random.default_rng(0)
    white = rng.standard_normal((400, 2))
    white[100:200] = np.nan
    r, count = autocorrelation(white, 3)
    assert count.tolist() == [2 * 298, 2 * 296, 2 * 294]
    assert np.abs(r).max() < 4 / np.sqrt(count.min())
