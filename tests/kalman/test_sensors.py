from dataclasses import replace

import numpy as np
import pytest
from linear_models import dense_moments, draw, hard_case
from scipy.integrate import solve_ivp
from scipy.linalg import cho_factor, cho_solve, expm
from scipy.stats import chi2

from forceid import kalman
from forceid.errors import ConfigError
from forceid.kalman import StateSpace
from forceid.kalman.building.process import discretize, integrated_wiener, matern, random_walk, resonator
from forceid.kalman.building.sensors import colored, sensor_rows, specific_force, state_space
from forceid.kalman.building.structure import Structure, discretize_input, drive, modal, state_matrices

ELEMENT = 0.4  # m


def free_beam(elements=3, mass=0.8, stiffness=5.0):
    """Euler-Bernoulli beam, dof (w, dw/dx) of each node; mass kg/m, stiffness N m2. Two rigid modes."""
    h, n = ELEMENT, 2 * elements + 2
    m_e = mass * h / 420 * np.array(
        [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h],
         [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]]
    )  # fmt: skip
    k_e = stiffness / h**3 * np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    )  # fmt: skip
    M, K = np.zeros((n, n)), np.zeros((n, n))
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        M[at, at] += m_e
        K[at, at] += k_e
    return M, K, 2e-3 * K


@pytest.fixture(scope="module")
def flight():
    """The beam under a line and a ramp of force, by DOP853 in its own coordinates; the modal system too."""
    M, K, C = free_beam()
    B = np.zeros((8, 2))
    B[2, 0], B[6, 1] = 1.0, -1.0
    modes = modal(M, K, C)
    structure = Structure(modes.frequency, modes.damping, modes.shape.T @ B, modes.drag)
    loads = [resonator(1.5, 1.0, 0.0), integrated_wiener(2, 1.0, 1.0)]
    system = drive(structure, loads, var_q=1.0, var_rate=1.0)
    w = 3 * np.pi

    def load_states(t):
        return np.stack([0.3 * np.cos(w * t), 0.3 * np.sin(w * t), 0.2 + 0.5 * t, 0.5 + 0 * t], -1)

    rng = np.random.default_rng(5)
    u0 = 1e-3 * rng.standard_normal(8)

    def motion(t, y):
        p = load_states(t)[[0, 2]]
        return np.concatenate([y[8:], np.linalg.solve(M, B @ p - C @ y[8:] - K @ y[:8])])

    path = solve_ivp(
        motion, (0, 0.3), np.r_[u0, 10 * u0[::-1]], "DOP853", rtol=1e-12, atol=1e-14, dense_output=True
    ).sol

    def at(t):
        y = path(t).T
        q, rate = (part @ M @ modes.shape for part in (y[..., :8], y[..., 8:]))
        return y[..., :8], np.concatenate([q, rate, load_states(t)], -1)

    return modes.shape, system, at


TIME = np.linspace(0.05, 0.25, 7)


def differences(u, order, h=1e-3):
    """Derivative of u(t) at TIME by differences of two widths, error O(h^4)."""

    def by(h):
        if order == 1:
            return (u(TIME + h) - u(TIME - h)) / (2 * h)
        return (u(TIME + h) - 2 * u(TIME) + u(TIME - h)) / h**2

    return (4 * by(h / 2) - by(h)) / 3


def test_rates_of_the_modes_are_those_of_the_beam(flight):
    shape, system, at = flight
    _, x = at(TIME)
    np.testing.assert_allclose(x @ sensor_rows(system, shape, 0).T, at(TIME)[0], atol=1e-12)
    moved = differences(lambda t: at(t)[0], 1)
    np.testing.assert_allclose(x @ sensor_rows(system, shape, 1).T, moved, rtol=1e-6, atol=1e-8)


def test_rows_of_acceleration_follow_the_trajectory_with_the_force_in_them(flight):
    shape, system, at = flight
    _, x = at(TIME)
    measured = differences(lambda t: at(t)[0], 2)[:, [2, 6]]
    H = sensor_rows(system, shape[[2, 6]], 2)
    np.testing.assert_allclose(x @ H.T, measured, rtol=1e-5, atol=1e-5)
    assert np.abs(x[:, 16:] @ H[:, 16:].T).max(0).min() > 1.0  # the force itself is no small part


def test_an_accelerometer_reads_acceleration_less_gravity_in_its_own_axes(flight):
    """The exact reading e(theta) . (a - g), with e turned by the slope, to second order in the motion."""
    shape, system, at = flight
    g = np.array([0.7, -0.4, -9.6])
    w, slope = shape[4], shape[5]
    axes = np.array([[1.0, 0, 0], [0, 0, 1.0], [0.6, 0, 0.8]])
    tilt = np.stack([0 * slope, -slope, 0 * slope])  # rising along x turns about -y
    H, offset = specific_force(system, axes[:, 2:] * w, axes, g, np.stack([tilt] * 3))
    u, x = at(TIME)
    small = 1e-4
    a, theta = small * differences(lambda t: at(t)[0], 2)[:, 4], small * u[:, 5]
    felt = np.stack([0 * a, 0 * a, a], -1) - g
    c, s = np.cos(theta), np.sin(theta)
    one, none = np.ones_like(c), np.zeros_like(c)
    about = np.moveaxis(np.array([[c, none, -s], [none, one, none], [s, none, c]]), 2, 0)
    turned = np.einsum("tij,sj->tsi", about, axes)
    exact = np.einsum("tsi,ti->ts", turned, felt)
    second_order = np.abs(theta).max() * (np.abs(theta).max() * 10 + np.abs(a).max())
    error = np.abs(small * x @ H.T + offset - exact).max()
    assert error < second_order + 1e-5 * small
    assert error < 1e-3 * np.abs(9.6 * theta).max()  # of the effect of tilt alone


def test_an_accelerometer_at_rest_reads_gravity_upwards():
    particle = drive(Structure([0.0], [0.0], [[2.0]]), [random_walk(1.0, 1.0)], 1.0, 1.0)
    H, offset = specific_force(particle, [[1.0]], [[0, 0, 1.0]], [0, 0, -9.81])
    assert H.tolist() == [[0.0, 0.0, 2.0]]
    assert offset.tolist() == [9.81]


def test_loads_as_unknown_inputs_go_through_the_feedthrough_instead():
    structure = Structure([3.0, 0.0], [0.02, 0.0], [[1.0, 0.5], [0.3, -2.0]])
    alone = drive(Structure([3.0, 0.0], [0.02, 0.0], np.zeros((2, 0))), [], 1.0, 1.0)
    driven = drive(structure, [random_walk(1.0, 1.0)] * 2, 1.0, 1.0)
    sensor = np.array([[1.0, 0.4], [0.2, 0.7], [0.0, 1.0]])
    H, J = sensor_rows(alone, sensor, 2), sensor @ structure.participation
    np.testing.assert_allclose(sensor_rows(driven, sensor, 2), np.hstack([H, J]), rtol=1e-15)
    F, G = discretize_input(*state_matrices(structure), 0.01)
    np.testing.assert_allclose(discretize(driven, 0.01)[0][:4], np.hstack([F, G]), rtol=1e-12, atol=1e-15)


def signal_and_noise(rng):
    """Matern 3/2 signal on an uneven clock, seen with its rate; colored noise on the first channel."""
    step = rng.choice([0.01, 0.02, 0.037], 79)
    signal, noise = matern(2, 1.3, 8.0), matern(1, 0.4, 15.0)
    R = np.diag([0.02, 3.0]) ** 2
    return np.r_[0, np.cumsum(step)], step, signal, noise, R


def dense_noise(time, noise, R):
    """Covariance of the noise of two channels (time * channel): closed form exp(-rate |t - s|), and white."""
    lag = np.abs(time[:, None] - time)
    N = np.kron(noise.P0[0, 0] * np.exp(noise.A[0, 0] * lag), np.diag([1.0, 0.0]))
    return N + np.kron(np.eye(len(time)), R)


@pytest.mark.long
def test_the_smoother_under_colored_noise_is_dense_least_squares():
    rng = np.random.default_rng(8)
    time, step, signal, noise, R = signal_and_noise(rng)
    T = len(time)
    P = np.zeros((2 * T, 2 * T))  # of the signal and its rate, at all times
    for i in range(T):
        for j in range(i + 1):
            P[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] = expm(signal.A * (time[i] - time[j])) @ signal.P0
            P[2 * j : 2 * j + 2, 2 * i : 2 * i + 2] = P[2 * i : 2 * i + 2, 2 * j : 2 * j + 2].T
    S = P + dense_noise(time, noise, R)
    z = (np.linalg.cholesky(S) @ rng.standard_normal(2 * T)).reshape(T, 2)
    z[20:26] = z[40, 0] = z[55:60, 1] = np.nan
    model = colored(state_space(signal, step, np.eye(2), R), [noise, None], step)
    smoothed = kalman.smooth(model, z)

    seen = np.isfinite(z.ravel())
    S = cho_factor(S[np.ix_(seen, seen)])
    x = P[:, seen] @ cho_solve(S, z.ravel()[seen])
    cov = P - P[:, seen] @ cho_solve(S, P[seen])
    scale = np.tile(np.sqrt(np.diag(signal.P0)), T)
    assert np.abs((smoothed.x[:, :2].ravel() - x) / scale).max() < 1e-8
    P_all = np.asarray(smoothed.P)
    for i in range(T):
        at = slice(2 * i, 2 * i + 2)
        assert np.abs((P_all[i, :2, :2] - cov[at, at]) / np.outer(scale[:2], scale[:2])).max() < 1e-8


def test_the_likelihood_under_colored_noise_is_the_dense_one_for_every_kind_of_model():
    """Every matrix changing with time, with a known input and gaps; a different memory on each channel."""
    model, z = hard_case()
    T, step = len(z), np.random.default_rng(2).uniform(0.05, 0.4, len(z) - 1)
    time = np.r_[0, np.cumsum(step)]
    wide = colored(model, [matern(1, 0.5, 3.0), None, resonator(0.7, 0.3, 0.5)], step)
    mean, cov = dense_moments(model, T)
    lag = np.abs(time[:, None] - time)
    cov += np.kron(0.25 * np.exp(-3.0 * lag), np.diag([1.0, 0, 0]))
    cov += np.kron(0.09 * np.exp(-0.5 * lag) * np.cos(2 * np.pi * 0.7 * lag), np.diag([0, 0, 1.0]))
    seen = np.isfinite(z.ravel())
    r, S = (z.ravel() - mean)[seen], cov[np.ix_(seen, seen)]
    expected = -0.5 * (r @ np.linalg.solve(S, r) + np.linalg.slogdet(2 * np.pi * S)[1])
    assert float(kalman.log_likelihood(wide, z)) == pytest.approx(expected, rel=1e-9)


def test_noise_on_every_channel_alike_is_independent():
    level = StateSpace(np.eye(1), np.eye(1), np.ones((2, 1)), np.eye(2), np.zeros(1), np.eye(1))
    model = colored(level, matern(2, 0.3, 5.0), 0.1)
    assert np.array_equal(model.H, [[1, 1, 0, 0, 0], [1, 0, 0, 1, 0]])
    assert not model.Q[1:3, 3:].any()
    assert not model.P0[1:3, 3:].any()
    assert colored(level, [None, None], 0.1) is level


def accelerometer():
    """A particle of 0.5 kg tracked and felt: position to 1 mm, acceleration to 0.05 m/s2, at 100 Hz."""
    particle = drive(Structure([0.0], [0.0], [[2.0]]), [matern(2, 1.0, 6.0)], var_q=1.0, var_rate=1.0)
    H = np.vstack([sensor_rows(particle, [[1.0]], derivative) for derivative in (0, 2)])
    return state_space(particle, 0.01, H, np.diag([1e-3, 0.05]) ** 2)


def test_a_constant_bias_is_found_to_within_the_sigma_it_is_claimed_with():
    model, rng = accelerometer(), np.random.default_rng(12)
    wide, error, T = colored(model, [None, random_walk(0.0, 0.5**2)], 0.01), [], 150
    for _ in range(30):
        bias = 0.5 * rng.standard_normal()
        _, z = draw(model, T, rng)
        z[:, 1] += bias
        smoothed = kalman.smooth(wide, z)
        sigma = np.sqrt(np.asarray(smoothed.P)[-1, -1, -1])
        np.testing.assert_allclose(smoothed.x[:, -1], smoothed.x[-1, -1], atol=1e-9)
        error.append((smoothed.x[-1, -1] - bias) / sigma)
    assert sigma < 0.5 / 20  # the data tell it, not the prior
    low, high = chi2.ppf([0.025, 0.975], len(error))
    assert low < np.sum(np.square(error)) < high


def test_a_wandering_bias_grows_by_its_density_on_any_clock():
    particle = drive(Structure([0.0], [0.0], [[2.0]]), [random_walk(1.0, 1.0)], 1.0, 1.0)
    step = np.array([0.1, 0.5, 0.1])
    model = state_space(particle, step, np.eye(3), np.eye(3))
    wide = colored(model, [random_walk(0.0, 1.0), None, random_walk(3.0, 4.0)], step)
    assert np.array_equal(wide.H[:, 3:], [[1, 0], [0, 0], [0, 1]])
    assert np.array_equal(wide.P0[3:, 3:], np.diag([1.0, 4.0]))
    np.testing.assert_allclose(wide.Q[:, 4, 4], 3.0 * step, rtol=1e-14)
    assert not wide.Q[:, 3].any()
    assert np.array_equal(wide.F[:, 3:, 3:], [np.eye(2)] * 3)


def test_a_missing_sample_half_way_is_a_step_twice_as_long():
    model, rng = accelerometer(), np.random.default_rng(3)
    particle = drive(Structure([0.0], [0.0], [[2.0]]), [matern(2, 1.0, 6.0)], var_q=1.0, var_rate=1.0)
    _, z = draw(model, 12, rng)
    z[5] = np.nan
    step = np.full(11, 0.01)
    step[4] = 0.02
    uneven = state_space(particle, np.delete(step, 5), model.H, model.R)
    whole, skipped = kalman.smooth(model, z), kalman.smooth(uneven, np.delete(z, 5, 0))
    np.testing.assert_allclose(np.delete(whole.x, 5, 0), skipped.x, rtol=1e-9, atol=1e-11)
    assert whole.filtered.log_likelihood == pytest.approx(skipped.filtered.log_likelihood, rel=1e-11)


def test_a_regular_clock_has_one_transition_and_an_irregular_one_its_own_at_each_step():
    load = matern(2, 1.0, 30.0)
    regular = state_space(load, np.diff(np.arange(1000) * 0.001), np.eye(2), np.eye(2))
    assert regular.F.shape == (2, 2)
    np.testing.assert_allclose(regular.F, discretize(load, 0.001)[0], rtol=1e-12)
    step = np.array([1e-3, 2e-3, 1e-3, 5.0, 1.7e-4])
    model = state_space(load, step, np.eye(2), np.eye(2))
    for k, h in enumerate(step):
        F, Q = discretize(load, h)
        assert np.array_equal(model.F[k], F)
        assert np.array_equal(model.Q[k], Q)


@pytest.mark.parametrize(
    ("frequency", "both", "first", "second"),
    [(1.0, 0.12, 0.4629, 0.6308), (5.0, 0.1158, 0.3841, 0.3406), (30.0, 0.1987, 0.3226, 0.3054)],
)
def test_two_masses_as_modes_tell_their_force_as_well_as_printed(frequency, both, first, second):
    """1 and 2 kg on a spring, 1 % damping: Matern 3/2 force on the one, random walk on the other.

    0.1 mm at 1 kHz, the middle of 2.5 s that start at 1 m, 1 m/s of each mass, 1 N. Principal equations 5.6.
    """
    M, k = np.diag([1.0, 2.0]), (2 * np.pi * frequency) ** 2 / 1.5
    modes = modal(M, k * np.array([[1.0, -1.0], [-1.0, 1.0]]), damping=0.01)
    loads = [matern(2, 1.0, 10 * np.pi), random_walk(0.09, 1.0)]
    system = drive(Structure(modes.frequency, modes.damping, modes.shape.T), loads, 1.0, 1.0, settled=False)
    to_modes, P0 = modes.shape.T @ M, system.P0.copy()
    P0[:4, :4] = np.kron(np.eye(2), to_modes @ to_modes.T)
    system = replace(system, P0=P0)
    for seen, printed in (([0, 1], both), ([0], first), ([1], second)):
        model = state_space(system, 1e-3, sensor_rows(system, modes.shape[seen], 0), 1e-8 * np.eye(len(seen)))
        P = np.asarray(kalman.smooth(model, np.zeros((2500, len(seen)))).P)[1250]
        assert float(f"{np.sqrt(system.loads[0] @ P @ system.loads[0]):.4g}") == printed


def test_many_models_with_colored_noise_and_biases_are_each_by_itself():
    rng, rate = np.random.default_rng(4), np.array([5.0, 20.0, 60.0])
    step = rng.uniform(0.01, 0.05, 19)
    z = rng.standard_normal(20)

    def model(rate, color):
        load = matern(2, 1.0, rate)
        plain = state_space(load, step, np.eye(1, 2), 0.1 * np.eye(1))
        return colored(colored(plain, matern(1, 0.3, color), step), random_walk(0.0, 2.0), step)

    def each(models):
        return [float(kalman.log_likelihood(m, z)) for m in models]

    alone = each(model(r, 40.0) for r in rate)
    many = kalman.log_likelihood(model(rate, 40.0), np.repeat(z[:, None, None], 3, 1))
    np.testing.assert_allclose(many, alone, rtol=1e-11)
    # and one model under many kinds of noise
    alone = each(model(20.0, r) for r in rate)
    many = kalman.log_likelihood(model(20.0, rate), np.repeat(z[:, None, None], 3, 1))
    np.testing.assert_allclose(many, alone, rtol=1e-11)


def test_what_is_wrong_with_sensors_noise_or_clock_is_said():
    particle = drive(Structure([0.0], [0.0], [[2.0]]), [random_walk(1.0, 1.0)], 1.0, 1.0)
    model = state_space(particle, 0.1, np.eye(2, 3), np.eye(2))
    with pytest.raises(ConfigError, match=r"sensor shape has shape \(1, 2\), expected \(sensor, 1\)"):
        sensor_rows(particle, [[1.0, 2.0]], 1)
    with pytest.raises(ConfigError, match="noise processes number 1, expected 2"):
        colored(model, [None], 0.1)
    with pytest.raises(ConfigError, match=r"step holds -0\.1 s"):
        state_space(particle, [0.1, -0.1], np.eye(2, 3), np.eye(2))
