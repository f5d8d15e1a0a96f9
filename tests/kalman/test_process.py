from math import comb, factorial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad_vec
from scipy.linalg import expm

from forceid.kalman.process import Process, discretize, integrate, matern, with_mean


def relative(a, b):
    """Largest difference of two covariances in units of the standard deviations of b."""
    size = np.sqrt(np.diag(b))
    return np.abs((a - b) / np.outer(size, size)).max()


def chain(order, rate, std=1.5):
    return integrate(integrate(matern(order, std, rate), var=1.0), var=1.0)


@pytest.mark.parametrize(
    ("order", "shape"),
    [
        (1, lambda s: np.ones_like(s)),
        (2, lambda s: 1 + s),
        (3, lambda s: 1 + s + s**2 / 3),
        (4, lambda s: 1 + s + 2 * s**2 / 5 + s**3 / 15),
    ],
)
def test_matern_autocovariance_is_its_closed_form(order, shape):
    std, rate, lag = 1.3, 7.0, np.linspace(0, 1.0, 9)
    load = matern(order, std, rate)
    F, _ = discretize(load, lag)
    decay = rate * lag
    np.testing.assert_allclose((F @ load.P0)[:, 0, 0], std**2 * shape(decay) * np.exp(-decay), rtol=1e-12)


@settings(deadline=None, derandomize=True)
@given(
    order=st.integers(1, 4),
    rate=st.floats(1e-2, 1e3),
    std=st.floats(1e-3, 1e3),
    turn=st.floats(1e-3, 1e2),
)
def test_a_matern_load_is_stationary(order, rate, std, turn):
    load = matern(order, std, rate)
    F, Q = discretize(load, turn / rate)
    assert relative(F @ load.P0 @ F.T + Q, load.P0) < 1e-11


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_the_lyapunov_equation_holds_in_units_of_the_rate(order):
    load = matern(order, std=2.0, rate=40.0)
    scale = 2.0 * 40.0 ** np.arange(order)
    flow = load.A @ load.P0 + load.P0 @ load.A.T + load.Qc
    assert np.abs(flow / np.outer(scale, scale)).max() < 1e-11 * 40.0


def test_many_loads_at_once_are_each_load_by_itself():
    std, rate, step = np.array([0.5, 2.0, 9.0]), np.array([1e-2, 3.0, 4e2]), np.array([0.01, 0.2, 0.03])
    many = with_mean(matern(3, std, rate), var=4.0)
    F, Q = discretize(many, step)
    for i in range(3):
        one = with_mean(matern(3, std[i], rate[i]), var=4.0)
        F_i, Q_i = discretize(one, step[i])
        np.testing.assert_allclose(many.P0[i], one.P0, rtol=1e-12)
        np.testing.assert_allclose(F[i], F_i, rtol=1e-12)
        np.testing.assert_allclose(Q[i], Q_i, rtol=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_discretization_is_the_integral_it_stands_for(order):
    process, step = chain(order, rate=12.0), 0.07
    F, Q = discretize(process, step)

    def integrand(s):
        f = expm(process.A * s)
        return f @ process.Qc @ f.T

    expected, _ = quad_vec(integrand, 0, step, epsrel=1e-12, epsabs=1e-30, norm="max")
    np.testing.assert_allclose(F, expm(process.A * step), rtol=1e-10, atol=1e-14)
    assert relative(Q, expected) < 1e-9


@settings(deadline=None, derandomize=True)
@given(order=st.integers(1, 4), rate=st.floats(0.1, 1e3), a=st.floats(1e-4, 30), b=st.floats(1e-4, 30))
def test_two_steps_are_one_step_of_their_sum(order, rate, a, b):
    """Also over a gap in the clock that lasts thirty correlation times, entry by entry."""
    process = chain(order, rate)
    (Fa, Qa), (Fb, Qb), (F, Q) = (discretize(process, s / rate) for s in (a, b, a + b))
    scale = rate ** np.r_[-2.0, -1.0, np.arange(order)]
    assert np.abs((Fb @ Fa - F) * scale / scale[:, None]).max() < 1e-11 * max(1, a + b)
    assert relative(Fb @ Qa @ Fb.T + Qb, Q) < 1e-10


@pytest.mark.parametrize("n", [1, 2, 3, 4, 8])
def test_n_fold_integrated_white_noise_has_its_known_covariance(n):
    """Q_ij = q h^(2n-1-i-j) / ((2n-1-i-j) (n-1-i)! (n-1-j)!), i, j = 0 the last integral."""
    q, h = 3.0, 1e-3
    last = np.eye(n)[-1]
    F, Q = discretize(Process(np.eye(n, k=1), q * np.outer(last, last), np.eye(n), np.eye(n)[0]), h)
    left = n - 1 - np.arange(n)
    fact = np.array([factorial(i) for i in left])
    power = left[:, None] + left + 1
    np.testing.assert_allclose(Q, q * h**power / power / np.outer(fact, fact), rtol=1e-13)
    expected = [[h ** (j - i) / factorial(j - i) if j >= i else 0.0 for j in range(n)] for i in range(n)]
    np.testing.assert_allclose(F, expected, rtol=1e-13)


def test_a_slow_matern_chain_is_an_integrated_random_walk_entry_by_entry():
    """A millisecond of a load that changes in a hundred seconds: twenty decades from entry to entry."""
    rate, step = 1e-2, 1e-3
    process = chain(2, rate)
    _, Q = discretize(process, step)
    walk = Process(np.eye(4, k=1), process.Qc, process.P0, process.output)
    np.testing.assert_allclose(Q, discretize(walk, step)[1], rtol=4 * rate * step)


def test_a_load_over_a_long_gap_forgets_its_start():
    load = with_mean(matern(2, std=1.5, rate=100.0), var=0.3)
    F, Q = discretize(load, 10.0)
    np.testing.assert_allclose(F, np.diag([1.0, 0, 0]), atol=1e-12)
    np.testing.assert_allclose(np.diag(Q), [0.0, 1.5**2, 1.5**2 * 100.0**2], rtol=1e-10)


@settings(deadline=None, derandomize=True)
@given(order=st.integers(1, 4), rate=st.floats(1e-2, 1e3), turn=st.floats(1e-5, 1e2))
def test_noise_covariance_is_symmetric_and_positive(order, rate, turn):
    _, Q = discretize(chain(order, rate), turn / rate)
    size = np.sqrt(np.diag(Q))
    assert np.array_equal(Q, Q.T)
    assert (size > 0).all()
    assert np.linalg.eigvalsh(Q / np.outer(size, size)).min() > -1e-13


def test_integration_and_mean_read_out_what_they_say():
    load = matern(2, std=1.0, rate=5.0)
    offset = with_mean(load, var=4.0)
    assert np.array_equal(offset.output, [1, 1, 0])  # mean + load
    momentum = integrate(offset, var=9.0)
    assert np.array_equal(momentum.A[0], [0, 1, 1, 0])  # its rate is mean + load
    assert np.array_equal(momentum.output, [1, 0, 0, 0])
    np.testing.assert_allclose(np.diag(momentum.P0), [9.0, 4.0, 1.0, 25.0], rtol=1e-12)
    F, _ = discretize(momentum, 0.25)
    assert F[0, 1] == pytest.approx(0.25)  # a constant mean adds up in proportion to time


def test_companion_form_has_one_pole_as_often_as_the_order():
    for order in (1, 2, 3, 4):
        expected = [comb(order, i) * 3.0**i for i in range(order + 1)]
        np.testing.assert_allclose(np.poly(matern(order, 1.0, 3.0).A), expected, rtol=1e-12)
