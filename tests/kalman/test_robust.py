"""Wild samples are taken out with the right reason, and good ones are left alone."""

from collections import Counter

import numpy as np
import pytest
from linear_models import draw

from forceid.kalman import StateSpace, discretize, smooth
from forceid.kalman.building.process import integrate, matern
from forceid.kalman.tuning.robust import WILD_SHARE, drop_wild, reject, runs, unswap
from forceid.significance import WILD

NOISE, STEP, TIME = 1e-3, 0.01, 300


def tracked():
    """A mass of one under a Matern force, two sensors of its position."""
    chain = integrate(integrate(matern(2, 1.0, 15.0), 1.0), 1.0)
    F, Q = discretize(chain, STEP)
    H = np.zeros((2, len(F)))
    H[:, 0] = 1.0
    return StateSpace(F, Q, H, NOISE**2 * np.eye(2), np.zeros(len(F)), chain.P0)


def drawn(seed):
    return draw(tracked(), TIME, np.random.default_rng(seed))


def test_good_samples_are_left_alone():
    taken = 0
    for seed in range(5):
        _, z = drawn(seed)
        cleaned, found = reject(tracked(), z)
        taken += len(found)
        assert np.isnan(cleaned).sum() == len(found)
    assert taken == 0


@pytest.mark.parametrize("engine", ["numpy", "filterpy"])
def test_one_wild_sample_of_one_sensor_is_taken_out_as_isolated(engine):
    _, z = drawn(1)
    z[150, 1] += 50 * NOISE
    cleaned, found = reject(tracked(), z, engine)
    assert [(r.sample, r.channel, r.reason) for r in found] == [(150, 1, "isolated")]
    assert found[0].sigma > 20
    assert np.isnan(cleaned[150, 1])
    assert np.isfinite(cleaned[150, 0])


def test_short_run_of_wild_samples_is_a_burst():
    _, z = drawn(2)
    z[100:104, 0] += NOISE * np.array([60.0, -40.0, 80.0, 50.0])
    _, found = reject(tracked(), z)
    assert {(r.sample, r.channel) for r in found} == {(k, 0) for k in range(100, 104)}
    assert Counter(r.reason for r in found) == {"burst": 4}


def test_step_of_a_sensor_is_named_and_nothing_is_taken_out():
    _, z = drawn(3)
    z[150:, 1] += 100 * NOISE
    cleaned, found = reject(tracked(), z)
    assert {r.reason for r in found} == {"step"}
    assert {r.sample for r in found} == {150}
    assert np.array_equal(cleaned, z)


def test_estimate_without_the_wild_samples_is_as_good_as_if_they_had_been_gaps():
    x, z = drawn(4)
    spoiled, gaps = z.copy(), z.copy()
    spoiled[[60, 150, 220], 0] += 80 * NOISE
    gaps[[60, 150, 220], 0] = np.nan
    cleaned, found = reject(tracked(), spoiled)
    assert Counter(r.reason for r in found) == {"isolated": 3}
    force = [smooth(tracked(), v).x[:, 2] for v in (cleaned, gaps, spoiled)]
    np.testing.assert_array_equal(force[0], force[1])
    error = [np.sqrt(np.mean((f - x[:, 2]) ** 2)) for f in force]
    assert error[2] > 2 * error[0]


def test_gaps_are_not_rejections():
    _, z = drawn(5)
    z[40:60] = np.nan
    z[100, 0] = np.nan
    _, found = reject(tracked(), z)
    assert found == ()


def spun(seed=0, time=200, spin=0.1):
    """Four markers on a tumbling, flying body, with noise."""
    t = np.arange(time)
    shape = np.array([[0.1, 0, 0], [-0.1, 0, 0.02], [0, 0.12, 0], [0.02, -0.1, 0.05]])
    c, s = np.cos(spin * t), np.sin(spin * t)
    zero = np.zeros_like(c)
    R = np.stack([c, -s, zero, s, c, zero, zero, zero, zero + 1], -1).reshape(-1, 3, 3)
    path = np.stack([0.02 * t, 0.01 * t, -1e-4 * t**2], -1)
    x = path[:, None] + np.einsum("tab,nb->tna", R, shape)
    return x + 3e-4 * np.random.default_rng(seed).standard_normal(x.shape)


@pytest.mark.parametrize(
    "span", [(80, 81), (80, 82), (80, 120), (80, 200)], ids=["one", "two", "forty", "rest"]
)
def test_markers_that_trade_places_are_traded_back(span):
    x = spun()
    traded = x.copy()
    traded[slice(*span), [0, 2]] = x[slice(*span), [2, 0]]
    mended, found = unswap(traded)
    np.testing.assert_array_equal(mended, x)
    frames = Counter(r.sample for r in found)
    assert frames == {k: 2 for k in span if k < len(x)}
    assert {r.channel for r in found} == {0, 2}
    assert {r.reason for r in found} == {"swapped"}


def test_markers_that_stay_in_place_are_not_traded():
    for spin in (0.0, 0.1, 0.5, 2.5):
        x = spun(spin=spin)
        x[50:60, 1] = np.nan
        x[120, 2] += 0.3  # a wild marker is not a trade
        mended, found = unswap(x)
        assert found == ()
        np.testing.assert_array_equal(mended, x)


def test_runs_of_flags():
    assert runs(np.zeros(4, bool)) == []
    assert runs(np.array([1, 1, 0, 1], bool)) == [(0, 2), (3, 1)]


def test_samples_dropped_before_count_among_the_few_that_may_be():
    innovation = np.zeros((100, 1))
    innovation[50] = 2 * WILD

    def again(dropped):
        return np.where(dropped, 0.0, innovation)

    before = np.zeros((100, 1), bool)
    assert drop_wild(innovation, again, before)[1]
    before[: 10 * int(WILD_SHARE * len(before)) : 10] = True
    dropped, ended = drop_wild(innovation, again, before)
    assert not ended
    assert dropped.sum() == before.sum() + 1
