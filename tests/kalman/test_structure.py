import numpy as np
import pytest
from complex_steps import sensitivity, with_mean
from scipy.integrate import quad_vec, solve_ivp
from scipy.linalg import expm, solve_continuous_lyapunov

from forceid.errors import ConfigError
from forceid.kalman.building.process import (
    Process,
    discretize,
    integrated_wiener,
    matern,
    random_walk,
    resonator,
    superpose,
)
from forceid.kalman.building.structure import Structure, discretize_input, drive, modal, state_matrices

FREQUENCY = [1.19, 3.54, 5.81, 7.96, 9.92, 11.67, 13.15, 14.34, 15.21, 15.74]  # Hz
DAMPING = [0.86, 0.78, 1.05, 1.35, 1.64, 1.90, 2.13, 2.31, 2.44, 2.52]  # %


def shear_frame(storeys=10, k=2500.0):
    K = k * (2 * np.eye(storeys) - np.eye(storeys, k=1) - np.eye(storeys, k=-1))
    K[-1, -1] = k
    return np.eye(storeys), K, 0.1 * np.eye(storeys) + 5e-4 * K


def chain(masses=(1.0, 2.0, 1.5), k=400.0, c=0.6):
    """Free masses in a row: one rigid mode, dashpots along the springs."""
    n = len(masses)
    L = np.diff(np.eye(n), axis=0)
    return np.diag(masses), k * L.T @ L, c * L.T @ L


def structure_of(modes, B):
    return Structure(modes.frequency, modes.damping, modes.shape.T @ B, modes.drag)


def in_own_units(P, reference):
    size = np.sqrt(np.maximum(np.diag(reference), 1e-300))
    return P / size / size[:, None]


def test_the_shear_frame_has_its_published_frequencies_and_damping():
    modes = modal(*shear_frame())
    assert (modes.frequency / (2 * np.pi)).round(2).tolist() == FREQUENCY
    assert (100 * modes.damping).round(2).tolist() == DAMPING


@pytest.mark.parametrize("storeys", [1, 2, 10, 40])
def test_a_uniform_frame_has_the_frequencies_of_its_closed_form(storeys):
    modes = modal(*shear_frame(storeys))
    j = np.arange(1, storeys + 1)
    W = 2 * np.sqrt(2500.0) * np.sin((2 * j - 1) * np.pi / (2 * (2 * storeys + 1)))
    np.testing.assert_allclose(modes.frequency, W, rtol=1e-10)
    np.testing.assert_allclose(modes.damping, 0.05 / W + 2.5e-4 * W, rtol=1e-10)


def test_shapes_are_normalized_by_mass_and_a_free_body_has_its_rigid_mode():
    M, K, C = chain()
    modes = modal(M, K, C + 0.2 * M)
    np.testing.assert_allclose(modes.shape.T @ M @ modes.shape, np.eye(3), atol=1e-13)
    np.testing.assert_allclose(modes.shape.T @ K @ modes.shape, np.diag(modes.frequency**2), atol=1e-10)
    np.testing.assert_allclose(np.abs(modes.shape[:, 0]), 1 / np.sqrt(4.5), rtol=1e-12)
    assert modes.frequency[0] == modes.damping[0] == 0.0
    np.testing.assert_allclose(modes.drag, [0.2, 0, 0], atol=1e-13)  # what a ratio to W = 0 cannot say
    assert modal(M, K, damping=0.03).damping.tolist() == [0.0, 0.03, 0.03]
    particle = modal([[2.0]], [[0.0]], [[0.5]])
    assert (particle.frequency[0], particle.damping[0], particle.drag[0]) == pytest.approx((0.0, 0.0, 0.25))


def test_the_modal_system_moves_as_the_masses_do():
    """Exponential of the modal equations against M u'' + C u' + K u = B p integrated by DOP853."""
    (M, K, C), B = chain(), np.array([[1.0, 0.0], [0.0, 0.0], [0.0, -2.0]])
    C = C + 0.3 * M
    modes, p = modal(M, K, C), np.array([3.0, -1.0])
    A, B_q = state_matrices(structure_of(modes, B))
    F, G = discretize_input(A, B_q, 0.4)
    u0, v0 = np.array([0.1, -0.2, 0.05]), np.array([1.0, 0.3, -2.0])

    def motion(_, y):
        return np.concatenate([y[3:], np.linalg.solve(M, B @ p - C @ y[3:] - K @ y[:3])])

    end = solve_ivp(motion, (0, 0.4), np.r_[u0, v0], "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    to_modes = np.kron(np.eye(2), modes.shape.T @ M)
    np.testing.assert_allclose(F @ to_modes @ np.r_[u0, v0] + G @ p, to_modes @ end, atol=1e-10)


def test_inputs_held_over_two_steps_are_held_over_their_sum():
    A, B = state_matrices(structure_of(modal(*chain()), np.eye(3)))
    F, G = discretize_input(A, B, np.array([0.03, 0.11, 0.14]))
    np.testing.assert_allclose(F[1] @ F[0], F[2], atol=1e-12)
    np.testing.assert_allclose(F[1] @ G[0] + G[1], G[2], atol=1e-13)


FRAME = structure_of(modal(*shear_frame()), np.eye(10)[:, [2, 9]])


def test_a_damped_structure_under_stationary_loads_starts_at_its_stationary_covariance():
    loads = [superpose(matern(3, 2.0, 15.0), resonator(3.5, 0.5, 0.2)), matern(1, 1.0, 40.0)]
    system = drive(FRAME, loads, var_q=1e6, var_rate=1e6)
    flow = system.A @ system.P0 + system.P0 @ system.A.T + system.Qc
    size = np.sqrt(np.diag(system.P0))
    assert np.abs(flow / np.outer(size, size)).max() < 1e-10 * np.abs(system.A / size[:, None] * size).max()
    expected = solve_continuous_lyapunov(system.A, -system.Qc)
    assert np.abs(in_own_units(system.P0 - expected, expected)).max() < 1e-9
    assert np.array_equal(system.P0[20:, 20:], superpose(*loads).P0)
    assert np.linalg.eigvalsh(in_own_units(system.P0, system.P0)).min() > -1e-13
    for step in (1e-3, 0.3):
        F, Q = discretize(system, step)
        assert np.abs(in_own_units(F @ system.P0 @ F.T + Q - system.P0, system.P0)).max() < 1e-10


def test_an_oscillator_under_white_loads_has_its_textbook_variance():
    """A load of short memory is white, S = 2 std^2 / rate: var q = S / (4 Z W^3), var q' = S / (4 Z W)."""
    W, Z, std, rate = 6.0, 0.05, 3.0, 1e5
    system = drive(Structure([W], [Z], [[1.0]]), [matern(1, std, rate)], 1.0, 1.0)
    S = 2 * std**2 / rate
    np.testing.assert_allclose(
        np.diag(system.P0)[:2], [S / (4 * Z * W**3), S / (4 * Z * W)], rtol=5 * W / rate + 1e-4
    )


def test_a_constant_load_and_a_steady_line_are_met_by_their_steady_response():
    """Static deflection p / W^2 under the mean, the complex gain at the line; both with certainty."""
    W, Z, var, line = 20.0, 0.02, 4.0, 2.5
    system = drive(
        Structure([W], [Z], [[1.0]]), [with_mean(resonator(line, 1.5, 0.0), var)], var_q=1e6, var_rate=1e6
    )
    w = 2 * np.pi * line
    gain = 1 / (W**2 - w**2 + 2j * Z * W * w)
    np.testing.assert_allclose(system.P0[0, 2], var / W**2, rtol=1e-12)
    np.testing.assert_allclose(system.P0[0, 0], var / W**4 + (1.5 * abs(gain)) ** 2, rtol=1e-11)
    given_loads = system.P0[:2, :2] - system.P0[:2, 2:] @ np.linalg.solve(
        system.P0[2:, 2:], system.P0[2:, :2]
    )
    assert np.abs(in_own_units(given_loads, system.P0[:2, :2])).max() < 1e-11


@pytest.mark.parametrize("W", [1e3, 1e6])
def test_a_stiff_mode_follows_its_load_statically_rate_and_all(W):
    """q = p / W^2 and q' = p' / W^2 up to rate / W: decades apart, and the covariance still positive."""
    std, rate = 1.5, 10.0
    load = matern(3, std, rate)
    P0 = drive(Structure([W], [0.01], [[1.0]]), [load], 1.0, 1.0).P0
    static = np.vstack([np.eye(2, 3) / W**2, np.eye(3)])
    expected = static @ load.P0 @ static.T
    assert np.abs(in_own_units(P0 - expected, expected)).max() < 2 * rate / W
    assert np.linalg.eigvalsh(in_own_units(P0, P0)).min() > -1e-14


def test_rigid_and_undamped_modes_and_those_under_wandering_loads_start_diffuse():
    structure = Structure([0.0, 5.0, 8.0, 9.0], [0.0, 0.0, 0.02, 0.03], [[1, 1], [1, 1], [1, 0], [1, 0.5]])
    loads = [matern(2, 1.0, 10.0), random_walk(2.0, 100.0)]
    P0 = drive(structure, loads, var_q=[1.0, 2.0, 3.0, 4.0], var_rate=7.0).P0
    still = drive(structure, [loads[0], matern(1, 0.0, 1.0)], 1.0, 1.0).P0
    assert np.array_equal(P0[:2, :2], np.diag([1.0, 2.0]))
    assert np.array_equal(P0[4:6, 4:6], np.diag([7.0, 7.0]))
    assert not P0[[0, 1, 4, 5], 8:].any()
    elastic = np.ix_([2, 3, 6, 7, 8, 9], [2, 3, 6, 7, 8, 9])
    np.testing.assert_allclose(P0[elastic] - still[elastic], np.diag([0, 4.0, 0, 7.0, 0, 0]), atol=1e-14)
    assert P0[10, 10] == 100.0
    assert not P0[10, :10].any()


def test_a_structure_that_is_let_go_starts_diffuse_whatever_drives_it():
    P0 = drive(FRAME, [matern(2, 1.0, 10.0)] * 2, 2.0, 3.0, settled=False).P0
    assert np.array_equal(P0[:20, :20], np.diag([2.0] * 10 + [3.0] * 10))
    assert not P0[:20, 20:].any()


def test_two_steps_are_one_step_of_the_driven_structure():
    free = structure_of(modal(*chain()), np.eye(3)[:, :2])
    system = drive(
        free, [integrated_wiener(3, 2.0, 10.0), with_mean(resonator(3.0, 1.0, 0.1), 4.0)], 1.0, 1.0
    )
    (Fa, Qa), (Fb, Qb), (F, Q) = (discretize(system, h) for h in (0.013, 0.4, 0.413))
    size = np.sqrt(np.diag(Q) + np.diag(F @ system.P0 @ F.T))
    assert np.abs((Fb @ Fa - F) / size[:, None] * size).max() < 1e-11
    assert np.abs((Fb @ Qa @ Fb.T + Qb - Q) / np.outer(size, size)).max() < 1e-12


def test_discretization_of_the_driven_frame_is_the_integral_it_stands_for():
    system, step = drive(FRAME, [matern(2, 1.0, 10.0), random_walk(1.0, 1.0)], 1.0, 1.0), 0.02
    F, Q = discretize(system, step)

    def integrand(s):
        f = expm(system.A * s)
        return f @ system.Qc @ f.T

    expected, _ = quad_vec(integrand, 0, step, epsrel=1e-12, epsabs=1e-30, norm="max")
    np.testing.assert_allclose(F, expm(system.A * step), rtol=1e-10, atol=1e-12)
    driven = np.diag(expected) > 0
    compared = in_own_units(Q - expected, expected)[np.ix_(driven, driven)]
    assert np.abs(compared).max() < 1e-8


def test_loads_are_read_by_their_rows():
    loads = [with_mean(matern(2, 1.0, 3.0), 1.0), matern(1, 2.0, 3.0)]
    system = drive(FRAME, loads, 1.0, 1.0)
    assert system.modes == 10
    assert np.array_equal(system.loads[:, 20:], [[1, 1, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(system.A[10:20] @ system.loads.T, FRAME.participation * [2.0, 1.0], rtol=1e-14)


def test_many_structures_at_once_are_each_by_itself():
    W = np.array([[3.0, 7.0], [0.0, 9.0]])
    rate = np.array([5.0, 50.0])
    many = drive(Structure(W, [0.01, 0.02], [[1.0], [2.0]]), [matern(2, 1.0, rate)], 1.0, 2.0)
    assert many.A.shape == many.Qc.shape == many.P0.shape == (2, 6, 6)
    for i in range(2):
        one = drive(Structure(W[i], [0.01, 0.02], [[1.0], [2.0]]), [matern(2, 1.0, rate[i])], 1.0, 2.0)
        np.testing.assert_allclose(many.A[i], one.A, rtol=1e-13)
        np.testing.assert_allclose(many.P0[i], one.P0, rtol=1e-11, atol=1e-15)


@pytest.mark.parametrize("step", [0.005, 0.5])
def test_derivatives_reach_frequencies_damping_and_loads(step):
    theta = np.array([6.0, 0.03, 2.0, 8.0, 1.5])

    def system(t):
        W, Z, std, rate, gain = t
        two = Structure(W * np.array([1.0, 2.7]), Z * np.ones(2), gain * np.array([[1.0], [-0.4]]))
        return drive(two, [superpose(matern(2, std, rate), resonator(0.3 * rate, std, Z))], 1.0, 1.0)

    s = sensitivity(system, theta, step)

    def at(t):
        sys = system(t)
        return np.stack([*discretize(sys, step), sys.P0])

    for i, h in enumerate(np.diag(1e-3 * theta)):
        coarse, fine = (at(theta + h) - at(theta - h)) / 2, at(theta + h / 2) - at(theta - h / 2)
        for ours, theirs in zip((s.dF[i], s.dQ[i], s.dP0[i]), (4 * fine - coarse) / 3 / h[i], strict=True):
            assert np.abs(ours - theirs).max() <= 1e-7 * max(np.abs(theirs).max(), 1e-3)


def test_a_load_started_away_from_its_stationary_covariance_counts_as_unknown():
    load = matern(2, 1.0, 10.0)
    hot = Process(load.A, load.Qc, 4 * load.P0, load.output)
    P0 = drive(Structure([5.0], [0.1], [[1.0]]), [hot], 2.0, 3.0).P0
    assert np.array_equal(P0[:2], [[2.0, 0, 0, 0], [0, 3.0, 0, 0]])


def test_what_is_wrong_with_a_structure_is_said():
    M, K, _ = chain()
    with pytest.raises(ConfigError, match="mass matrix is not positive definite; condense"):
        modal(np.diag([1.0, 0.0, 1.0]), K)
    with pytest.raises(ConfigError, match="stiffness matrix has the negative eigenvalue"):
        modal(M, -K)
    with pytest.raises(ConfigError, match="the loads number 1, expected 2"):
        drive(FRAME, [matern(1, 1.0, 1.0)], 1.0, 1.0)
    with pytest.raises(ConfigError, match=r"participation has shape \(2,\), expected \(2, load\)"):
        drive(Structure([1.0, 2.0], [0.1, 0.1], [1.0, 1.0]), [matern(1, 1.0, 1.0)], 1.0, 1.0)
