from fractions import Fraction

import numpy as np
import pytest
from beam import beam
from closed_bounds import constant_acceleration_bound
from hypothesis import given
from hypothesis import strategies as st
from linear_models import draw, hard_case, random_cov
from white_input import with_white_input

from forceid import kalman
from forceid.errors import EstimationError
from forceid.kalman.covariance import combine
from forceid.kalman.inputs.input_smoothing import input_smoother
from forceid.kalman.recursions import conditioning, linear, passes, square_root

ENGINES = ["auto", "numpy"]


def given_to_passes(model, z):
    """F, Q, H, R, P0, seen, steady; without P0."""
    F, Q, H, R, _ = linear.arrays(model, z)
    seen, steady = linear.pattern(z), linear.time_invariant(model)
    return (F, Q, H, R, model.P0, seen, steady), (F, Q, H, R, seen, steady)


def expanded(start, runs, time):
    return np.repeat(runs, np.diff(np.append(start, time)), axis=0)


def smoothed_by_factors(model, z):
    """Covariances of filter and smoother (time, state, state), of the array form alone."""
    forward, backward = given_to_passes(model, z)
    (start, _, P, _, _, failed), C = square_root.array_covariance_pass(*forward)
    last, U, failed_later = square_root.array_information_pass(*backward)
    assert (failed, failed_later) == (-1, -1)
    C = expanded(start, C, len(z))
    U = expanded(np.append(last[1:] + 1, 0)[::-1], U[::-1], len(z))
    return expanded(start, P, len(z)), square_root.combine_factors(C, U)


def apart(a, b):
    """Largest difference of covariances (time, state, state), in standard deviations of b."""
    size = np.sqrt(np.diagonal(b, axis1=1, axis2=2))
    return (np.abs(a - b) / (size[:, :, None] * size[:, None])).max()


def stable(seed, n=4, m=3):
    rng = np.random.default_rng(seed)
    F = rng.standard_normal((n, n))
    F *= 0.9 / np.abs(np.linalg.eigvals(F)).max()
    H, R = rng.standard_normal((m, n)), random_cov(rng, m, 0.1)
    model = kalman.StateSpace(F, random_cov(rng, n), H, R, np.zeros(n), random_cov(rng, n))
    z = draw(model, 120, rng)[1]
    z[60:64] = z[80, 1] = z[:2, 0] = np.nan
    return model, z


def twins(P0, time=40):
    """Position twice and acceleration of a body with a start of variance P0 in each state."""
    F, Q = kalman.discretize(kalman.integrated_wiener(3, 1.0, 1.0), 0.01)
    H = np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, 1]])
    model = kalman.StateSpace(F, Q, H, 1e-6 * np.eye(3), np.zeros(3), P0 * np.eye(3))
    return model, np.random.default_rng(1).standard_normal((time, 3))


@given(seed=st.integers(0, 10**6), m=st.integers(0, 4), extra=st.integers(0, 3))
def test_elimination_is_the_schur_complement(seed, m, extra):
    rng = np.random.default_rng(seed)
    A, B, noise = (
        rng.standard_normal((m, 4)),
        rng.standard_normal((4, 4)),
        rng.standard_normal((m, m + extra)),
    )
    L, K, rest = square_root.eliminate(A, B, noise)
    S = A @ A.T + noise @ noise.T
    np.testing.assert_allclose(L @ L.T, S, atol=1e-12)
    np.testing.assert_allclose(K @ L.T, B @ A.T, atol=1e-12)
    np.testing.assert_allclose(rest @ rest.T + K @ K.T, B @ B.T, atol=1e-12)
    assert np.array_equal(L, np.tril(L))


@pytest.mark.parametrize("case", [*map(hard_case, range(4)), *map(stable, range(4))])
def test_array_form_is_the_plain_form_where_that_loses_nothing(case):
    model, z = case
    forward, backward = given_to_passes(model, z)
    plain, (factors, C) = passes.covariance_pass(*forward), square_root.array_covariance_pass(*forward)
    assert plain[5] == factors[5] == -1
    ours, theirs = ([expanded(a[0], b, len(z)) for b in a[1:5]] for a in (factors, plain))
    for a, b in zip(ours, theirs, strict=True):  # P_pred, P, K, W
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * np.abs(b).max())
    last, later, _ = passes.information_pass(*backward)
    last_too, U, _ = square_root.array_information_pass(*backward)
    later, U = (
        expanded(np.append(at[1:] + 1, 0)[::-1], a[::-1], len(z)) for at, a in ((last, later), (last_too, U))
    )
    np.testing.assert_allclose(U.swapaxes(1, 2) @ U, later, rtol=0, atol=1e-9 * np.abs(later).max())
    assert (
        apart(square_root.combine_factors(expanded(factors[0], C, len(z)), U), combine(theirs[1], later))
        < 1e-9
    )


@pytest.mark.parametrize("case", [*map(hard_case, range(4)), *map(stable, range(4))])
def test_models_that_lose_nothing_stay_with_the_engine(case):
    forward, _ = given_to_passes(*case)
    runs, C = conditioning.mended_covariance_pass(passes.covariance_pass, *forward)
    assert C is None
    np.testing.assert_array_equal(runs[2], passes.covariance_pass(*forward)[2])


@pytest.mark.long
@pytest.mark.parametrize(("ambient", "force"), [(0, "0.068295"), (1, "2.10433")])
@pytest.mark.parametrize("engine", ENGINES)
def test_force_on_the_supported_beam_has_the_published_deviation_by_the_plain_smoother(
    engine, ambient, force
):
    """In N; the force a white state of variance 1e8 against a noise of 1e-8."""
    z = np.zeros((2000, 4))
    model = with_white_input(beam(ambient), z, var=1e8, P0=1e-6 * np.eye(16))
    P = kalman.smooth(model, z, engine=engine).P
    digits = len(force.replace(".", "").lstrip("0"))
    assert f"{np.sqrt(P[1000, 16, 16]):.{digits}g}" == force  # far from both ends
    assert np.linalg.eigvalsh(P).min() > 0


def test_beam_smoother_agrees_with_that_of_unknown_inputs_in_mean_and_covariance():
    system, rng = beam(0), np.random.default_rng(4)
    z = 1e-4 * rng.standard_normal((300, 4)) + np.array([1e-3, 1e-3, 1e-4, 1e-4])
    z[100:120, 2] = z[200] = np.nan
    model = with_white_input(system, z, var=1e8, P0=1e-6 * np.eye(16))
    found, other = kalman.smooth(model, z), input_smoother(*system, z, P0=1e-6 * np.eye(16), var=1e8)
    assert apart(found.P[:, :16, :16], other.P) < 1e-8
    assert apart(found.P[:, 16:, 16:], other.u_cov) < 1e-8
    std = np.sqrt(np.diagonal(found.P, axis1=1, axis2=2))
    assert (np.abs(found.x - np.hstack([other.x, other.u])) / std).max() < 1e-6


def parabola(time, step, variance, noise):
    """Exact covariances of position, velocity, acceleration: after each sample, and given all samples."""

    def times(a, b):
        return [
            [sum(x * y for x, y in zip(row, col, strict=True)) for col in zip(*b, strict=True)] for row in a
        ]

    def inverse(a):
        (a, b, c), (d, e, f), (g, h, i) = a
        det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
        minors = [
            [e * i - f * h, c * h - b * i, b * f - c * e],
            [f * g - d * i, a * i - c * g, c * d - a * f],
            [d * h - e * g, b * g - a * h, a * e - b * d],
        ]
        return [[x / det for x in row] for row in minors]

    def power(k):
        t = k * step
        return [
            [Fraction(1), t, t * t / 2],
            [Fraction(0), Fraction(1), t],
            [Fraction(0), Fraction(0), Fraction(1)],
        ]

    def at(k, known):
        P, F = inverse(known), power(k)
        return np.array(times(times(F, P), list(zip(*F, strict=True))), float)

    information = [[Fraction(int(i == j)) / variance for j in range(3)] for i in range(3)]
    filtered = []
    for k in range(time):
        h = power(k)[0]
        information = [[information[i][j] + h[i] * h[j] / noise for j in range(3)] for i in range(3)]
        filtered.append(at(k, information))
    return np.array(filtered), np.array([at(k, information) for k in range(time)])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("step", [Fraction(1, 1024), Fraction(1, 8), Fraction(3, 16), Fraction(100)])
def test_start_as_good_as_unknown_leaves_exact_covariances(engine, step):
    """1e12 against 1e-12, in rational arithmetic; the plain form has no digit left."""
    variance, noise = Fraction(2**40), Fraction(1, 2**40)
    filtered, smoothed = parabola(12, step, variance, noise)
    h = float(step)
    F = np.array([[1, h, h * h / 2], [0, 1, h], [0, 0, 1]])
    R, P0 = float(noise) * np.eye(1), float(variance) * np.eye(3)
    model, z = kalman.StateSpace(F, 0 * F, np.eye(1, 3), R, np.zeros(3), P0), np.zeros((12, 1))
    for P, S in (
        smoothed_by_factors(model, z),
        (lambda s: (s.filtered.P, s.P))(kalman.smooth(model, z, engine)),
    ):
        assert apart(P, filtered) < 1e-8
        assert apart(S, smoothed) < 1e-8
    bound = constant_acceleration_bound(float(noise) ** 0.5, 12, 11 * h)
    assert np.sqrt(smoothed[5, 2, 2]) == pytest.approx(bound, rel=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("P0", [1e4, 1e8, 1e12, 1e16])
def test_channels_that_say_the_same_of_an_unknown_state_cost_no_digits(engine, P0):
    model, z = twins(P0)
    s = kalman.smooth(model, z, engine)
    P, smoothed = smoothed_by_factors(model, z)
    assert apart(s.filtered.P, P) < 1e-9
    assert apart(s.P, smoothed) < 1e-9
    total = kalman.log_likelihood(model, z, engine)
    if P0 > 1e10:  # the plain likelihood fails, and the filter's takes its place
        assert total == pytest.approx(s.filtered.log_likelihood, rel=1e-12)
    # twice the same channel is one of half the variance
    once = kalman.StateSpace(model.F, model.Q, np.eye(3)[[0, 2]], np.diag([5e-7, 1e-6]), model.x0, model.P0)
    mean = np.stack([z[:, :2].mean(1), z[:, 2]], 1)
    other = kalman.smooth(once, mean, engine)
    assert apart(s.P, other.P) < 1e-8
    np.testing.assert_allclose(
        s.x / s.std, other.x / s.std, rtol=0, atol=1e-6 * np.abs(other.x / s.std).max()
    )


@pytest.mark.parametrize("engine", ENGINES)
def test_stretches_that_lose_digits_are_mended_where_they_are(engine):
    """A clock with two long waits: the state is unknown again, then two channels say the same of it."""
    step = np.full(199, 0.01)
    step[[60, 150]] = 100.0
    F, Q = kalman.discretize(kalman.integrated_wiener(3, 1.0, 1.0), step)
    H, R = np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, 1]]), 1e-6 * np.eye(3)
    model, z = kalman.StateSpace(F, Q, H, R, np.zeros(3), np.eye(3)), np.zeros((200, 3))
    forward, _ = given_to_passes(model, z)
    runs, C = conditioning.mended_covariance_pass(linear_engine(engine).covariance_pass, *forward)
    rooted = np.isfinite(C[:, 0, 0])
    assert rooted[[61, 151]].all()
    assert 0 < rooted.sum() < 100
    np.testing.assert_array_equal(runs[0], np.arange(200))
    P, smoothed = smoothed_by_factors(model, z)
    s = kalman.smooth(model, z, engine)
    assert apart(s.filtered.P, P) < 1e-9
    assert apart(s.P, smoothed) < 1e-9


def linear_engine(name):
    """The passes of an engine."""
    return kalman.engine(name).filter.args[0]


def test_noise_that_is_none_still_raises_where_the_plain_form_fails():
    model, z = twins(1e12)
    none = kalman.StateSpace(model.F, model.Q, model.H, np.diag([0.0, 0.0, 1.0]), model.x0, model.P0)
    for estimate in (kalman.filter, kalman.smooth, kalman.log_likelihood):
        with pytest.raises(EstimationError, match="not positive definite at sample 0"):
            estimate(none, z)


def test_array_form_takes_a_channel_without_white_noise():
    model, z = stable(7)
    exact = kalman.StateSpace(model.F, model.Q, model.H[:1], np.zeros((1, 1)), model.x0, model.P0)
    z = z[:, 1:2]
    P, smoothed = smoothed_by_factors(exact, z)
    s = kalman.smooth(exact, z)
    assert apart(P + 1e-9 * np.eye(4), s.filtered.P + 1e-9 * np.eye(4)) < 1e-6
    assert apart(smoothed + 1e-9 * np.eye(4), s.P + 1e-9 * np.eye(4)) < 1e-6


def test_a_state_known_for_certain_beside_one_not_known_at_all_stays_where_it_is():
    """A level that drifts at a known rate: 40 samples of sigma 1e-3, no other variance."""
    F, H = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0], [1.0, 0.0]])
    start = np.array([0.0, 0.5])
    model = kalman.StateSpace(F, np.zeros((2, 2)), H, 1e-6 * np.eye(2), start, np.diag([1e12, 0.0]))
    level = 3.0 + 0.5 * np.arange(20)
    z = level[:, None] + 1e-3 * np.random.default_rng(0).standard_normal((20, 2))
    s = kalman.smooth(model, z)
    np.testing.assert_allclose(
        s.x[:, 0] - 0.5 * np.arange(20), (z - 0.5 * np.arange(20)[:, None]).mean(), atol=1e-9
    )
    np.testing.assert_allclose(s.x[:, 1], 0.5, rtol=0, atol=1e-12)
    np.testing.assert_allclose(s.std, np.tile([1e-3 / np.sqrt(40), 0.0], (20, 1)), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_smoothed_states_after_a_start_as_good_as_unknown_are_the_fit(engine):
    """A parabola through noisy positions, by least squares of centered powers."""
    h, time = 1 / 64, 40
    F, t = np.array([[1, h, h * h / 2], [0, 1, h], [0, 0, 1]]), h * np.arange(time)
    model = kalman.StateSpace(F, 0 * F, np.eye(1, 3), 1e-12 * np.eye(1), np.zeros(3), 1e12 * np.eye(3))
    z = 3 - 2 * t + 4 * t**2 + 1e-6 * np.random.default_rng(2).standard_normal(time)
    s = kalman.smooth(model, z, engine)
    fit = np.polynomial.Polynomial.fit(t, z, 2)
    expected = np.stack([fit(t), fit.deriv()(t), fit.deriv(2)(t)], 1)
    np.testing.assert_allclose((s.x - expected) / s.std, 0.0, atol=1e-4)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_start_that_the_plain_form_cannot_take_costs_the_array_form_only_a_few_samples(engine):
    model, z = twins(1e16, time=400)
    forward, _ = given_to_passes(model, z)
    plain = linear_engine(engine).covariance_pass
    assert plain(*forward)[5] == 0
    runs, C = conditioning.mended_covariance_pass(plain, *forward)
    assert np.isfinite(C[:, 0, 0]).sum() < 10
    P, _ = smoothed_by_factors(model, z)
    assert apart(expanded(runs[0], runs[2], len(z)), P) < 1e-9
    # unless every sample needs it
    hard = with_white_input(beam(0), z := np.zeros((300, 4)), var=1e16, P0=1e-6 * np.eye(16))
    P, smoothed = smoothed_by_factors(hard, z)
    s = kalman.smooth(hard, z, engine)
    assert apart(s.filtered.P, P) < 1e-9
    assert apart(s.P, smoothed) < 1e-9
