"""The covariance of the smoother against steady states known in closed form or from an independent code."""

import numpy as np
import pytest

from forceid import kalman
from forceid.kalman import Process, StateSpace

MASS = 0.1


def steady(process, step, H, noise_var, row, time):
    """Filter and smoother variance of row @ state in the middle of a long record; it must have settled."""
    F, Q = kalman.discretize(process, step)
    model = StateSpace(F, Q, H[None], np.array([[noise_var]]), np.zeros(len(F)), process.P0)
    smoothed = kalman.smooth(model, np.zeros((time, 1)))
    filtered, smooth = (np.einsum("i,tij,j->t", row, P, row) for P in (smoothed.filtered.P, smoothed.P))
    for var in (filtered, smooth):
        middle = var[2 * time // 5 : 3 * time // 5]
        assert np.ptp(middle) < 1e-5 * middle.mean()
    return filtered[time // 2], smooth[time // 2]


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
    var = steady(load, 1 / rate, load.output / MASS, noise**2, np.eye(4)[2], time=2 * rate)
    for found, printed in zip(np.sqrt(var), (filter_bound, smoother_bound), strict=True):
        assert float(f"{found:.4g}") == printed


def test_random_walk_force_meets_its_row_and_its_closed_form():
    """Principal equations 5.5: smoother 0.243225 N, closed form 0.243226; filter 0.57646 N."""
    load, noise, rate = integrated_white(3, q=50.0), 1e-4, 1000
    var = steady(load, 1 / rate, load.output / MASS, noise**2, np.eye(3)[2], time=1500)
    causal, smoothed = np.sqrt(var)
    assert f"{causal:.5f}" == "0.57646"
    assert f"{smoothed:.6f}" == "0.243225"
    a = 50.0 / (MASS**2 * noise**2 / rate)
    assert f"{np.sqrt(50 / 3 * a ** (-1 / 6)):.6f}" == "0.243226"


@pytest.mark.parametrize("order", [1, 2, 3])
def test_driven_load_of_any_order_has_the_closed_form_error(order):
    """Principal equations 4e, last formula, which holds in the limit of fast sampling."""
    q, noise, step = 50.0, 1e-4, 5e-4
    r = noise**2 * step
    a = q / (MASS**2 * r)
    power = 2 * order + 4
    expected = q * a ** (-(2 * order - 1) / power) / (power * np.sin(5 * np.pi / power))
    load = integrated_white(order + 2, q)
    time = int(80 * a ** (-1 / power) / step)  # time constants of the estimator
    _, var = steady(load, step, load.output / MASS, noise**2, np.eye(order + 2)[2], time)
    assert var == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("n", "k"), [(n, k) for n in (1, 2, 3, 4) for k in range(n)])
def test_derivatives_of_integrated_white_noise_have_the_closed_form_error(n, k):
    """r w^(2k+1) / (2n sin(pi (2k+1) / 2n)), w = (q/r)^(1/2n)."""
    q, noise, step = 2.0, 1.0, 0.01
    r = noise**2 * step
    w = (q / r) ** (1 / (2 * n))
    load = integrated_white(n, q)
    _, var = steady(load, step, load.output, noise**2, np.eye(n)[k], time=int(80 / w / step))
    power = 2 * k + 1
    assert var == pytest.approx(r * w**power / (2 * n * np.sin(np.pi * power / (2 * n))), rel=5e-3)


@pytest.mark.parametrize(("n", "worse"), [(3, 6), (4, 47)])
def test_the_causal_filter_pays_its_known_price_for_the_acceleration(n, worse):
    load = integrated_white(n, q=2.0)
    causal, smoothed = steady(load, 0.01, load.output, 1.0, np.eye(n)[2], time=4000)
    assert causal / smoothed == pytest.approx(worse, rel=0.02)


@pytest.mark.parametrize(("count", "factor"), [(10, 497), (50, 665), (200, 706), (1000, 717)])
def test_constant_acceleration_has_the_error_of_a_parabola_fit(count, factor):
    """std(a) = sigma sqrt(factor / N) / T^2 over N samples in T, nothing known before."""
    noise, step = 1e-3, 0.01
    span = (count - 1) * step
    still = integrated_white(3, q=0.0)
    F, Q = kalman.discretize(still, step)
    start = np.diag((1e4 * noise / span ** np.arange(3.0)) ** 2)
    model = StateSpace(F, Q, still.output[None], np.array([[noise**2]]), np.zeros(3), start)
    smoothed = kalman.smooth(model, np.zeros((count, 1)))
    std = np.sqrt(smoothed.P[:, 2, 2])
    np.testing.assert_allclose(std, std[0], rtol=1e-6)  # a constant is known equally well at every time
    assert round(count * (std[0] * span**2 / noise) ** 2) == factor
