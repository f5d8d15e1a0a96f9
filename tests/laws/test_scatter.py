"""Coefficients that differ from flight to flight: how far, and how sure their common values are."""

import numpy as np
import pytest

from forceid.laws.scatter import scatter_between

HALF = 0.975


def flown(rng, flights, std, blind=False):
    """Scores about the common fit, information, and the error of that, of flights of three coefficients.

    blind: every other flight shows two of them alone.
    """
    scores, information = [], []
    for g in range(flights):
        A = rng.standard_normal((7, 3)) * rng.uniform(0.5, 3.0)
        if blind and g % 2:
            A[:, 2] = 0.0
        shown = A @ (std * rng.standard_normal(3)) + rng.standard_normal(7)
        information.append(A.T @ A)
        scores.append(A.T @ shown)
    J, s = np.array(information), np.array(scores)
    off = np.linalg.solve(J.sum(0), s.sum(0))
    return s - J @ off, J, off


def found(drawn):
    scores, J, _ = drawn
    return scatter_between(scores, J, np.linalg.inv(J.sum(0)), HALF)


def test_scatter_between_one_coefficient_known_alike_is_that_of_the_sample_less_its_noise():
    values, noise = np.array([1.0, 4.0, -2.0, 7.0, 0.0]), 0.5
    J = np.full((5, 1, 1), noise**-2)
    score = ((values - values.mean()) / noise**2)[:, None]
    got = scatter_between(score, J, np.full((1, 1), noise**2 / 5), HALF)
    assert got.std[0] ** 2 == pytest.approx(values.var(ddof=1) - noise**2, rel=1e-4)
    assert got.cov[0, 0] == pytest.approx(values.var(ddof=1) / 5, rel=1e-4)


@pytest.mark.long
@pytest.mark.parametrize("flights", [3, 5, 10])
@pytest.mark.parametrize("std", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.3, 0.3, 0.3), (2.0, 1.0, 1.0)])
def test_intervals_of_common_values_hold_them_about_as_often_as_they_say(flights, std):
    rng, held = np.random.default_rng([flights, *(int(10 * s) for s in std)]), []
    for _ in range(40):
        drawn = flown(rng, flights, np.array(std))
        got = found(drawn)
        held.append(np.abs(drawn[2]) < got.factor * np.sqrt(np.diag(got.cov)))
    assert 0.82 < np.mean(held) < 0.999


@pytest.mark.long
def test_flights_that_do_not_scatter_claim_as_the_common_fit_does():
    rng, wide = np.random.default_rng(4), []
    for _ in range(60):
        drawn = flown(rng, 8, np.zeros(3))
        wide.append(np.diag(found(drawn).cov) / np.diag(np.linalg.inv(drawn[1].sum(0))))
    assert np.median(wide) < 1.3
    assert np.min(wide) > 1 - 1e-9


@pytest.mark.long
def test_flights_that_show_some_of_the_coefficients_alone_tell_those():
    rng, got = np.random.default_rng(5), []
    for _ in range(60):
        got.append(found(flown(rng, 10, np.array([1.0, 0.0, 1.0]), blind=True)).std)
    middle = np.median(got, axis=0)
    assert 0.6 < middle[0] < 1.3
    assert middle[1] < 0.3
    assert 0.5 < middle[2] < 1.4
