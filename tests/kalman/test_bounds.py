"""Steady covariances against closed forms, printed tables, and the recursion run to its end."""

import numpy as np
import pytest
from closed_bounds import constant_acceleration_bound, integrated_wiener_bound

from forceid import kalman
from forceid.errors import ConfigError, EstimationError
from forceid.kalman import Process, StateSpace, bounds

MASS = 0.1


def filter_bound(n, k, density, r):
    """Filter variance of derivative k of n-fold integrated white noise.

    The poles of the filter are Butterworth's, and its gains the coefficients b of their polynomial; then
    Riccati's equation, read entry by entry, gives the diagonal: r w^(2k+1) (b_k b_k+1 - b_k-1 b_k+2 + ...).
    """
    w = (density / r) ** (1 / (2 * n))
    angle = np.pi * (2 * np.arange(n) + n + 1) / (2 * n)
    b = np.real(np.poly(np.exp(1j * angle)))
    terms = [(-1) ** i * b[k - i] * b[k + 1 + i] for i in range(min(k, n - 1 - k) + 1)]
    return r * w ** (2 * k + 1) * sum(terms)


def settled(process, step, noise, row):
    """Filter and smoother variance of row @ state, far from both ends of a long record."""
    found = bounds.steady(position_measured(process, step, noise))
    return row @ found.filtered @ row, row @ found.smoothed @ row


def position_measured(process, step, noise, gain=1.0):
    F, Q = kalman.discretize(process, step)
    H, R = gain * process.output[None], noise**2 * np.eye(1)
    return StateSpace(F, Q, H, R, np.zeros(len(F)), process.P0)


def assert_same(P, expected, tolerance):
    """In units of the deviations: entries that vanish by symmetry have no relative error."""
    size = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose((P - expected) / np.outer(size, size), 0, atol=tolerance)


def driven_mass(load):
    """Position and velocity of the mass, then the load, with starts wide enough to forget."""
    return kalman.integrate(kalman.integrate(load, var=1.0), var=1.0)


def integrated_white(n, q):
    last = np.eye(n)[-1]
    return Process(np.eye(n, k=1), q * np.outer(last, last), np.diag([1.0] * n), np.eye(n)[0])


@pytest.mark.parametrize(
    ("rate", "noise", "filter_bound", "smoother_bound"),
    [
        (250, 1e-4, 0.2889, 0.06699),
        (250, 3e-4, 0.3989, 0.1000),
        (250, 1e-3, 0.5425, 0.1537),
        (1000, 1e-4, 0.2518, 0.05189),
        (1000, 3e-4, 0.3480, 0.07771),
        (1000, 1e-3, 0.4776, 0.1202),
    ],
)
def test_matern_force_on_a_mass_meets_the_table_of_bounds(rate, noise, filter_bound, smoother_bound):
    """Principal equations 5.5, to the four digits printed there."""
    load = driven_mass(kalman.matern(2, std=1.0, rate=10 * np.pi))
    model = position_measured(load, 1 / rate, noise, 1 / MASS)
    found = bounds.steady(model)
    for P, printed in ((found.filtered, filter_bound), (found.smoothed, smoother_bound)):
        assert float(f"{np.sqrt(P[2, 2]):.4g}") == printed
    smoothed = kalman.smooth(model, np.zeros((2 * rate, 1)))
    assert_same(found.smoothed, smoothed.P[rate], 1e-5)
    assert_same(found.filtered, smoothed.filtered.P[-1], 1e-5)


def test_random_walk_force_meets_its_row_and_its_closed_form():
    """Principal equations 5.5: smoother 0.243225 N, closed form 0.243226; filter 0.57646 N."""
    load, noise, rate = integrated_white(3, q=50.0), 1e-4, 1000
    found = bounds.steady(position_measured(load, 1 / rate, noise, 1 / MASS))
    assert f"{np.sqrt(found.filtered[2, 2]):.5f}" == "0.57646"
    assert f"{np.sqrt(found.smoothed[2, 2]):.6f}" == "0.243225"
    assert f"{np.sqrt(bounds.driven_load_bound(1, 50.0, MASS, noise**2 / rate)):.6f}" == "0.243226"


@pytest.mark.parametrize("order", [1, 2, 3])
def test_driven_load_of_any_order_has_the_closed_form_error(order):
    """Principal equations 4e, last formula, which holds in the limit of fast sampling."""
    q, noise, step = 50.0, 1e-4, 5e-4
    load = integrated_white(order + 2, q)
    found = bounds.steady(position_measured(load, step, noise, 1 / MASS)).smoothed[2, 2]
    assert found == pytest.approx(bounds.driven_load_bound(order, q, MASS, noise**2 * step), rel=1e-3)


def test_matern_force_of_low_rate_has_the_driven_load_bound_of_its_density():
    """Principal equations 4e, p = 2: above its rate a Matern 3/2 is a twice-integrated white noise."""
    rate, noise, step = 0.1, 1e-4, 1e-3
    load = kalman.matern(2, std=1.0, rate=rate)
    found = bounds.steady(position_measured(driven_mass(load), step, noise, 1 / MASS)).smoothed[2, 2]
    closed = bounds.driven_load_bound(2, 4 * rate**3, MASS, noise**2 * step)
    assert found == pytest.approx(closed, rel=0.02)


@pytest.mark.parametrize("wdt", [0.05, 0.02, 0.002])
@pytest.mark.parametrize(("n", "k"), [(n, k) for n in (1, 2, 3, 4) for k in range(n)])
def test_derivatives_of_integrated_white_noise_have_the_closed_form_error(n, k, wdt):
    """r w^(2k+1) / (2n sin(pi (2k+1) / 2n)), w = (q/r)^(1/2n)."""
    noise, step = 1.0, 0.01
    r = noise**2 * step
    q = r * (wdt / step) ** (2 * n)
    _, found = settled(integrated_white(n, q), step, noise, np.eye(n)[k])
    assert found == pytest.approx(integrated_wiener_bound(n, k, q, r), rel=0.01)


@pytest.mark.parametrize(("n", "k"), [(n, k) for n in (1, 2, 3, 4) for k in range(n)])
def test_causal_derivatives_of_integrated_white_noise_have_the_closed_form_error(n, k):
    """First order in the step: half of it, the error between a sample and the next."""
    off = []
    for wdt in (2e-3, 1e-3):
        step = 0.01
        q = step * (wdt / step) ** (2 * n)
        causal, _ = settled(integrated_white(n, q), step, 1.0, np.eye(n)[k])
        off.append(causal / filter_bound(n, k, q, step) - 1)
    assert abs(off[1]) < 0.01
    assert off[0] / off[1] == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize(("n", "worse"), [(3, 6), (4, 47)])
def test_the_causal_filter_pays_its_known_price_for_the_acceleration(n, worse):
    causal, smoothed = settled(integrated_white(n, q=2.0), 0.01, 1.0, np.eye(n)[2])
    assert causal / smoothed == pytest.approx(worse, rel=0.02)
    exact = [f(n, 2, 1.0, 1.0) for f in (filter_bound, integrated_wiener_bound)]
    assert round(exact[0] / exact[1]) == worse


@pytest.mark.parametrize("count", [3, 10, 50, 200, 1000])
def test_constant_acceleration_has_the_error_of_a_parabola_fit(count):
    """std(a) = sigma sqrt(720 / N) / T^2 for many samples over T, nothing known before; exact for few."""
    noise, step = 1e-3, 0.01
    span = (count - 1) * step
    expected = constant_acceleration_bound(noise, count, span)
    t = np.linspace(0, span, count)
    fit = np.linalg.pinv(np.stack([np.ones(count), t, t**2 / 2], 1))[2]
    assert expected == pytest.approx(noise * np.linalg.norm(fit), rel=1e-10)
    still = Process(
        np.eye(3, k=1), np.zeros((3, 3)), np.diag((1e4 * noise / span ** np.arange(3.0)) ** 2), np.eye(3)[0]
    )
    smoothed = kalman.smooth(position_measured(still, step, noise), np.zeros((count, 1)))
    np.testing.assert_allclose(np.sqrt(smoothed.P[:, 2, 2]), expected, rtol=1e-5)


@pytest.mark.parametrize(("n", "wdt"), [(n, wdt) for n in (2, 3, 4) for wdt in (0.5, 0.05)])
def test_steady_covariance_is_where_the_plain_recursion_ends(n, wdt):
    step = 0.01
    model = position_measured(integrated_white(n, step * (wdt / step) ** (2 * n)), step, 1.0)
    found = bounds.steady(model)
    P, (F, Q, H, R) = found.predicted, (model.F, model.Q, model.H, model.R)
    L = np.linalg.cholesky(P)
    onward = F @ found.filtered @ F.T + Q
    np.testing.assert_allclose(np.linalg.solve(L, np.linalg.solve(L, onward - P).T), 0, atol=1e-9)
    wide = StateSpace(F, Q, H, R, model.x0, 100 * P)
    smoothed = kalman.smooth(wide, np.zeros((int(80 / wdt), 1)))
    assert_same(smoothed.filtered.P[-1], found.filtered, 1e-7)
    assert_same(smoothed.P[len(smoothed.P) // 2], found.smoothed, 1e-7)
    assert found.samples < 320 / wdt


def test_units_do_not_matter_to_the_steady_covariance():
    load = driven_mass(kalman.matern(2, std=1.0, rate=10 * np.pi))
    model, unit = position_measured(load, 1e-3, 1e-4, 1 / MASS), np.array([1e-9, 1e6, 1e3, 1e-4])
    back = np.outer(unit, unit)
    other = StateSpace(
        model.F / unit * unit[:, None], model.Q * back, model.H / unit, model.R, model.x0, model.P0 * back
    )
    assert_same(bounds.steady(other).smoothed / back, bounds.steady(model).smoothed, 1e-9)


def test_a_constant_keeps_its_prior_unless_it_is_measured():
    one = np.eye(2)
    model = StateSpace(one, np.diag([1.0, 0.0]), np.array([[1.0, 0.0]]), np.eye(1), np.zeros(2), 4 * one)
    found = bounds.steady(model)
    np.testing.assert_allclose(found.smoothed, np.diag([1 / np.sqrt(5), 4.0]), rtol=1e-9)
    measured = bounds.steady(StateSpace(one, model.Q, one, one, np.zeros(2), 4 * one))
    assert measured.predicted[1, 1] < 1e-9


def test_a_walk_that_nothing_measures_never_settles_and_a_varying_model_has_no_steady_state():
    one = np.eye(2)
    walk = StateSpace(one, one, np.array([[1.0, 0.0]]), np.eye(1), np.zeros(2), one)
    with pytest.raises(EstimationError, match="grows without end"):
        bounds.steady(walk)
    unstable = StateSpace(1.1 * one, one, walk.H, walk.R, walk.x0, one)
    with pytest.raises(EstimationError, match="grows without end"):
        bounds.steady(unstable)
    with pytest.raises(EstimationError, match="R of the model is not positive definite"):
        bounds.steady(StateSpace(one, one, walk.H, np.zeros((1, 1)), walk.x0, one))
    with pytest.raises(ConfigError, match=r"F of the model changes with time, .*\(3, 2, 2\)"):
        bounds.steady(StateSpace(np.stack([one] * 3), one, one, one, np.zeros(2), one))
