from math import comb, factorial

import numpy as np
import pytest
from complex_steps import sensitivity, with_mean
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad_vec
from scipy.linalg import expm

from forceid.kalman.building.process import (
    Process,
    discretize,
    integrate,
    integrated_wiener,
    matern,
    random_walk,
    resonator,
    superpose,
)


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


def test_short_steps_keep_their_digits_beside_a_long_gap():
    load, steps = matern(2, 1.0, 100.0), np.array([1e-6, 1e-3, 1e4])
    F, Q = discretize(load, steps)
    for i, h in enumerate(steps):
        F_one, Q_one = discretize(load, h)
        assert np.array_equal(F[i], F_one)
        assert np.array_equal(Q[i], Q_one)
    x = 100.0 * steps[:2]
    np.testing.assert_allclose(F[:2, 0, 0], (1 + x) * np.exp(-x), rtol=1e-15)


def test_companion_form_has_one_pole_as_often_as_the_order():
    for order in (1, 2, 3, 4):
        expected = [comb(order, i) * 3.0**i for i in range(order + 1)]
        np.testing.assert_allclose(np.poly(matern(order, 1.0, 3.0).A), expected, rtol=1e-12)


def everything(theta):
    """One of each kind in a sum about a mean, twice integrated: frequency, width, sizes and rates free."""
    std, rate, frequency, line, width, density, var = theta
    load = superpose(
        matern(3, std, rate), resonator(frequency, line, width), integrated_wiener(2, density, [1.0, 2.0])
    )
    return integrate(integrate(with_mean(load, var), var=3.0), var * rate)


THETA = np.array([1.3, 20.0, 7.0, 0.4, 0.2, 5.0, 2.0])


def test_a_random_walk_wanders_by_its_density_and_keeps_what_it_has():
    many = random_walk(density=np.array([0.0, 2.0]), var=9.0)
    F, Q = discretize(many, 0.5)
    assert np.array_equal(F, np.ones((2, 1, 1)))
    assert np.array_equal(Q.ravel(), [0.0, 1.0])
    assert np.array_equal(many.P0, np.full((2, 1, 1), 9.0))


def test_an_integrated_wiener_load_is_a_walk_integrated():
    once, twice = integrated_wiener(2, 3.0, [5.0, 7.0]), integrate(random_walk(3.0, 7.0), 5.0)
    for a, b in zip(
        (once.A, once.Qc, once.P0, once.output), (twice.A, twice.Qc, twice.P0, twice.output), strict=True
    ):
        assert np.array_equal(a, b)
    assert np.array_equal(np.diag(integrated_wiener(3, 3.0, 5.0).P0), [5.0, 5.0, 5.0])
    many = integrated_wiener(2, np.array([1.0, 2.0, 3.0]), np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]))
    assert np.array_equal(many.Qc[:, 1, 1], [1.0, 2.0, 3.0])
    assert np.array_equal(many.P0[2], np.diag([5.0, 6.0]))


@settings(deadline=None, derandomize=True)
@given(
    frequency=st.floats(0, 50), std=st.floats(1e-3, 1e3), width=st.floats(0, 1e2), step=st.floats(1e-4, 1.0)
)
def test_a_resonator_decays_and_turns_as_its_closed_form(frequency, std, width, step):
    """Autocovariance std^2 exp(-b t) cos(w t), cross-covariance with the quadrature a sine; stationary."""
    load = resonator(frequency, std, width)
    F, Q = discretize(load, step)
    turn, rounding = 2 * np.pi * frequency * step, 1e-13 * (1 + 2 * np.pi * frequency * step + width * step)
    c, s = np.cos(turn), np.sin(turn)
    assert np.abs(F - np.exp(-width * step) * np.array([[c, -s], [s, c]])).max() < rounding
    assert np.abs(F @ load.P0 @ F.T + Q - load.P0).max() < std**2 * rounding
    np.testing.assert_allclose(
        Q, -np.expm1(-2 * width * step) * std**2 * np.eye(2), rtol=1e-11, atol=1e-14 * std**2
    )


def test_the_sum_of_loads_has_the_sum_of_their_autocovariances():
    parts = [matern(2, 1.5, 9.0), resonator(3.0, 0.7, 0.5), matern(1, 0.3, 50.0)]
    lag = np.linspace(0, 1, 7)

    def autocovariance(load):
        F, _ = discretize(load, lag)
        return load.output @ (F @ load.P0) @ load.output

    expected = sum(autocovariance(p) for p in parts)
    np.testing.assert_allclose(autocovariance(superpose(*parts)), expected, rtol=1e-12)


def test_sums_broadcast_over_leading_axes():
    std, rate = np.array([0.5, 2.0, 9.0]), np.array([[1.0], [30.0]])
    many = superpose(matern(2, std, rate), resonator(5.0, std, 0.1), random_walk(1.0, 2.0))
    assert many.A.shape == many.P0.shape == (2, 3, 5, 5)
    F, Q = discretize(many, 0.03)
    one = superpose(matern(2, 9.0, 30.0), resonator(5.0, 9.0, 0.1), random_walk(1.0, 2.0))
    F_one, Q_one = discretize(one, 0.03)
    np.testing.assert_allclose(F[1, 2], F_one, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(Q[1, 2], Q_one, rtol=1e-11, atol=1e-13)


def test_derivatives_of_an_exponential_load_are_their_closed_forms():
    std, rate, h = 2.0, 3.0, np.array([1e-6, 0.1, 4.0])
    s = sensitivity(lambda theta: matern(1, *theta), [std, rate], h)
    decay = np.exp(-rate * h)
    np.testing.assert_allclose(s.F[:, 0, 0], decay, rtol=1e-14)
    np.testing.assert_allclose(s.dF[:, :, 0, 0], [0 * h, -h * decay], rtol=1e-13)
    # after twelve correlation times Q no longer depends on the rate: to the rounding of Q itself
    dQ = [-2 * std * np.expm1(-2 * rate * h), 2 * h * std**2 * decay**2]
    np.testing.assert_allclose(s.dQ[:, :, 0, 0], dQ, rtol=1e-13, atol=np.finfo(float).eps * std**2)
    np.testing.assert_allclose(s.dP0.ravel(), [2 * std, 0.0], rtol=1e-15)


@pytest.mark.parametrize("step", [0.01, 0.7])
def test_derivatives_agree_with_central_differences(step):
    s = sensitivity(everything, THETA, step)
    F, Q = discretize(everything(THETA), step)
    np.testing.assert_allclose(s.F, F, rtol=1e-14)
    np.testing.assert_allclose(s.Q, Q, rtol=1e-14)
    assert s.dF.shape == (7, 10, 10)

    def at(theta):
        process = everything(theta)
        return np.stack([*discretize(process, step), process.P0])

    for i, h in enumerate(np.diag(1e-3 * THETA)):
        # differences of two widths, extrapolated: error O(h^4)
        coarse, fine = (at(THETA + h) - at(THETA - h)) / 2, at(THETA + h / 2) - at(THETA - h / 2)
        difference = (4 * fine - coarse) / 3 / h[i]
        for ours, theirs in zip((s.dF[i], s.dQ[i], s.dP0[i]), difference, strict=True):
            assert np.abs(ours - theirs).max() <= 1e-8 * max(np.abs(theirs).max(), 1e-3)


def test_derivatives_of_many_loads_at_once_are_those_of_each():
    theta = np.array([[1.0, 2.0], [5.0, 40.0]])  # std and rate of two loads
    both = sensitivity(lambda t: matern(3, *t), theta, 0.02)
    for j in range(2):
        one = sensitivity(lambda t: matern(3, *t), theta[:, j], 0.02)
        np.testing.assert_allclose(both.dF[:, j], one.dF, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(both.dQ[:, j], one.dQ, rtol=1e-12, atol=1e-14)


def test_discretization_of_complex_parameters_has_the_real_part_of_the_real_ones():
    nudged = THETA + 1e-30j
    F, Q = discretize(everything(nudged), 0.3)
    F_real, Q_real = discretize(everything(THETA), 0.3)
    np.testing.assert_allclose(F.real, F_real, rtol=1e-13)
    np.testing.assert_allclose(Q.real, Q_real, rtol=1e-13)
