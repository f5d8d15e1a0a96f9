import numpy as np
import pytest
from beam import beam
from hypothesis import given, settings
from hypothesis import strategies as st

from forceid import kalman
from forceid.kalman import Process, StateSpace
from forceid.kalman.bounds import steady
from forceid.kalman.inputs.unknown_input import input_filter
from forceid.kalman.observability import (
    gramian,
    invariant_zeros,
    pbh,
    prior_only,
    variance_ratio,
)

MASS = 0.1
KAPPA = 10 * np.pi
ACCELEROMETER = np.array([[0.0, 0.0, 1 / MASS, 0.0]])


def driven_by_matern():
    """Position, velocity, force and its rate."""
    A = np.zeros((4, 4))
    A[0, 1], A[1, 2], A[2:, 2:] = 1.0, 1 / MASS, kalman.matern(2, 1.0, KAPPA).A
    return A


def driven_by_walk(bias):
    """Position, velocity, force and, if asked for, the bias of the accelerometer: walks all."""
    A = np.zeros((3 + bias, 3 + bias))
    A[0, 1], A[1, 2] = 1.0, 1 / MASS
    return A


def test_accelerometer_alone_loses_position_and_velocity_at_eigenvalue_zero():
    """Principal equations 5.6: rank 2 of 4."""
    found = pbh(driven_by_matern(), ACCELEROMETER)
    assert (found.rank, found.states, found.observable) == (2, 4, False)
    np.testing.assert_array_equal(found.lost, 0)
    np.testing.assert_allclose(found.unobservable @ found.unobservable.T, np.diag([1.0, 1, 0, 0]), atol=1e-12)
    np.testing.assert_array_equal(found.value, 0)
    np.testing.assert_allclose(np.abs(found.direction), np.eye(4)[:, :1], atol=1e-12)


def test_random_walk_force_and_bias_leave_an_accelerometer_rank_one_and_a_position_full_rank():
    """Principal equations 5.6; force and bias trade off as -mass to 1."""
    A, accelerometer = driven_by_walk(bias=True), np.array([[0.0, 0.0, 1 / MASS, 1.0]])
    found = pbh(A, accelerometer)
    assert (found.rank, found.states) == (1, 4)
    trade = np.array([0, 0, -MASS, 1]) / np.hypot(1, MASS)
    np.testing.assert_allclose(found.unobservable @ (found.unobservable.T @ trade), trade, atol=1e-12)
    assert pbh(A, np.vstack([accelerometer, np.eye(1, 4)])).observable


def test_an_unobservable_oscillation_is_named_by_its_frequency():
    A = np.array([[0.0, 1, 0, 0], [-49, 0, 0, 0], [0, 0, 0, 1], [0, 0, -9, -0.6]])
    found = pbh(A, np.array([[1.0, 1.0, 0.0, 0.0]]))
    assert found.rank == 2
    np.testing.assert_allclose(np.sort_complex(found.value), [-0.3 - 2.984962j, -0.3 + 2.984962j], atol=1e-6)
    np.testing.assert_allclose(A @ found.direction, found.direction * found.value, atol=1e-12)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**6), hidden=st.integers(0, 3), decades=st.floats(-3, 3))
def test_rank_is_found_in_any_coordinates_and_units(seed, hidden, decades):
    rng = np.random.default_rng(seed)
    n = 5
    A, C = rng.standard_normal((n, n)), rng.standard_normal((2, n))
    A[: n - hidden, n - hidden :], C[:, n - hidden :] = 0.0, 0.0
    turn = np.linalg.qr(rng.standard_normal((n, n)))[0] * 10.0 ** (decades * rng.random(n))[:, None]
    found = pbh(turn @ A @ np.linalg.inv(turn), 10.0**decades * C @ np.linalg.inv(turn))
    assert found.rank == n - hidden
    expected = np.linalg.eigvals(A[n - hidden :, n - hidden :])
    np.testing.assert_allclose(np.sort_complex(found.lost), np.sort_complex(expected), atol=1e-6)


@pytest.mark.parametrize(
    ("H", "noise", "printed"),
    [
        (np.eye(1, 3), 1e-4, ("6.5e+07", "2.2e+10", "1.6e+12")),
        (ACCELEROMETER[:, :3], 0.05, ("0.0e+00", "0.0e+00", "2.0e+09")),
    ],
)
def test_gramian_in_units_of_the_prior_has_the_printed_eigenvalues(H, noise, printed):
    """Principal equations 4e: 500 samples at 1 kHz, prior 1 m, 1 m/s, 10 N."""
    walk = driven_by_walk(bias=False)
    F, _ = kalman.discretize(Process(walk, np.zeros((3, 3)), np.eye(3), np.eye(3)[0]), 1e-3)
    found = gramian(F, H, noise**2 * np.eye(1), np.diag([1.0, 1.0, 100.0]), samples=500)
    assert tuple(f"{e:.1e}" for e in found.eigenvalue) == printed
    assert found.rank == (3 if noise == 1e-4 else 1)


def test_gramian_is_the_gain_of_information_over_the_prior():
    """Information of a state without process noise is P0^-1 + W: variances fall by 1 + eigenvalue."""
    rng = np.random.default_rng(0)
    F, H, R, root = (rng.standard_normal(s) for s in ((3, 3), (2, 3), (2, 2), (3, 3)))
    F, R, P0 = 0.5 * F, R @ R.T, root @ root.T
    found = gramian(F, H, R, P0, samples=6)
    model = StateSpace(F, np.zeros((3, 3)), H, R, np.zeros(3), P0)
    posterior = kalman.smooth(model, np.zeros((6, 2))).P[0]
    gain = np.linalg.eigvals(P0 @ np.linalg.inv(posterior)).real - 1
    np.testing.assert_allclose(found.eigenvalue, np.sort(gain), rtol=1e-8)
    V = found.direction
    np.testing.assert_allclose(V @ V.T, P0, atol=1e-12)
    np.testing.assert_allclose(V @ np.diag(1 / (1 + found.eigenvalue)) @ V.T, posterior, atol=1e-10)


def test_position_of_a_mass_with_an_accelerometer_is_known_by_its_prior_only():
    A = driven_by_matern()
    force = kalman.matern(2, 1.0, KAPPA)
    Qc, P0 = np.zeros((4, 4)), np.diag([1e4, 1e4, 0, 0])  # far beyond what the force adds
    Qc[2:, 2:], P0[2:, 2:] = force.Qc, force.P0
    F, Q = kalman.discretize(Process(A, Qc, P0, np.eye(4)[0]), 1e-3)
    seen = [
        prior_only(variance_ratio(StateSpace(F, Q, H, R * np.eye(1), np.zeros(4), P0), samples=100))
        for H, R in ((ACCELEROMETER, 0.05**2), (np.eye(1, 4), 1e-8))
    ]
    np.testing.assert_array_equal(seen, [[True, True, False, False], [False] * 4])


def two_masses(frequency, sensors):
    """1 kg and 2 kg on a spring, free; Matern 3/2 force on the first, random walk 0.09 N2/s on the second.

    State: positions, velocities, the force and its rate, the other force. Position noise 0.1 mm at 1 kHz.
    """
    m, w, force = np.array([1.0, 2.0]), 2 * np.pi * frequency, kalman.matern(2, 1.0, KAPPA)
    reduced = m.prod() / m.sum()
    pull = np.array([[1.0, -1.0], [-1.0, 1.0]]) / m[:, None]
    A, Qc, P0 = np.zeros((7, 7)), np.zeros((7, 7)), np.eye(7)
    A[:2, 2:4] = np.eye(2)
    A[2:4, :2], A[2:4, 2:4] = -reduced * w**2 * pull, -2 * 0.01 * w * reduced * pull
    A[2, 4], A[3, 6], A[4:6, 4:6] = 1 / m[0], 1 / m[1], force.A
    Qc[4:6, 4:6], Qc[6, 6], P0[4:6, 4:6] = force.Qc, 0.09, force.P0
    F, Q = kalman.discretize(Process(A, Qc, P0, np.eye(7)[4]), 1e-3)
    return StateSpace(F, Q, np.eye(2, 7)[sensors], 1e-8 * np.eye(len(sensors)), np.zeros(7), P0)


@pytest.mark.parametrize(
    ("frequency", "both", "first", "second"),
    [(1, 0.12, 0.4629, 0.6308), (5, 0.1158, 0.3841, 0.3406), (30, 0.1987, 0.3226, 0.3054)],
)
def test_two_masses_need_two_sensors_for_a_force_and_an_unknown_disturbance(frequency, both, first, second):
    """Principal equations 5.6. Printed: the middle of 2.5 s that start at 1 m, 1 m/s, 1 N.

    Two sensors forget the start long before; one needs half a minute, and then does better than printed.
    """
    for sensors, printed in (([0, 1], both), ([0], first), ([1], second)):
        model = two_masses(frequency, sensors)
        P = kalman.smooth(model, np.zeros((2500, len(sensors)))).P[1250]
        assert float(f"{np.sqrt(P[4, 4]):.4g}") == printed
        settled = np.sqrt(steady(model).smoothed[4, 4])
        if len(sensors) == 2:
            assert float(f"{settled:.4g}") == printed
        else:
            assert settled < printed


@pytest.mark.parametrize("sensor", [0, 1])
def test_collocated_sensor_has_its_zero_at_the_antiresonance(sensor):
    """Principal equations 4e: the other mass on the spring, sqrt(k / m2)."""
    k, m1, m2 = 3000.0, 1.0, 2.0
    A, B, C, D = np.zeros((4, 4)), np.eye(4)[:, 2:3] / m1, np.eye(4)[sensor : sensor + 1], np.zeros((1, 1))
    A[:2, 2:] = np.eye(2)
    A[2:, :2] = [[-k / m1, k / m1], [k / m2, -k / m2]]
    found = invariant_zeros(A, B, C, D)
    expected = [-1j * np.sqrt(k / m2), 1j * np.sqrt(k / m2)] if sensor == 0 else []
    np.testing.assert_allclose(sorted(found.zeros, key=np.imag), expected, atol=1e-10 * k)
    assert (found.rank, found.normal_rank, found.identifiable) == (1, 5, True)


def test_second_sensor_removes_the_zero_and_a_second_input_is_beyond_one_sensor():
    k = 3000.0
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [np.array([[-k, k], [k / 2, -k / 2]]), np.zeros((2, 2))]])
    B = np.vstack([np.zeros((2, 2)), np.diag([1, 0.5])])
    two = invariant_zeros(A, B[:, :1], np.eye(2, 4), np.zeros((2, 1)))
    assert (len(two.zeros), two.identifiable) == (0, True)
    one = invariant_zeros(A, B, np.eye(1, 4), np.zeros((1, 2)))
    assert (one.rank, one.normal_rank, one.identifiable) == (1, 5, False)


def test_accelerometer_has_two_zeros_at_rest():
    """Position and velocity that stay: a constant force cannot be told from the start."""
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    found = invariant_zeros(A, np.array([[0.0], [1.0]]), np.zeros((1, 2)), np.ones((1, 1)))
    np.testing.assert_allclose(found.zeros, [0, 0], atol=1e-14)


def pencil(s, A, B, C, D):
    return np.block([[A - s * np.eye(len(A)), B], [C, D]])


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 10**6),
    channels=st.integers(1, 3),
    inputs=st.integers(1, 3),
    through=st.integers(0, 3),
    decades=st.floats(-3, 3),
)
def test_rosenbrock_pencil_has_the_normal_rank_and_loses_it_at_the_zeros(
    seed, channels, inputs, through, decades
):
    rng = np.random.default_rng(seed)
    A, B, C = (rng.standard_normal(s) for s in ((5, 5), (5, inputs), (channels, 5)))
    left, right = rng.standard_normal((channels, through)), rng.standard_normal((through, inputs))
    D = left @ right
    found = invariant_zeros(A, 10.0**decades * B, 10.0**-decades * C, D)
    size = np.linalg.svd(pencil(rng.standard_normal(), A, B, C, D))[1]
    assert found.normal_rank == np.count_nonzero(size > 1e-9) == 5 + min(channels, inputs)
    assert found.identifiable == (channels >= inputs)
    if channels == inputs:
        assert len(found.zeros) == 5 - inputs + min(through, inputs)
    else:
        assert len(found.zeros) == 0
    for s in found.zeros:
        small = np.linalg.svd(pencil(s, A, B, C, D))[1]
        assert small[-1] < 1e-7 * small[0]


def test_zeros_of_a_system_with_more_sensors_than_inputs_are_the_ones_built_in():
    """Input, then a filter with zero -2, then three sensors: all of them miss exp(-2 t)."""
    rng = np.random.default_rng(4)
    A, B = rng.standard_normal((5, 5)), np.zeros((5, 1))
    C, D = rng.standard_normal((3, 5)), np.zeros((3, 1))
    A[4], A[:4, 4] = 0.0, rng.standard_normal(4)
    A[4, 4], B[4] = -1.0, 1.0  # the filter (s + 2) / (s + 1) = 1 + 1 / (s + 1)
    b = A[:4, 4].copy()
    B[:4, 0], C[:, 4] = b, 0.0
    found = invariant_zeros(A, B, C, D)
    np.testing.assert_allclose(found.zeros, [-2.0], atol=1e-10)
    assert found.identifiable


def test_zero_outside_the_unit_circle_lets_the_unknown_input_filter_diverge_and_one_inside_does_not():
    A, B, D = np.diag([0.5, 0.2]), np.ones((2, 1)), np.zeros((1, 1))
    for zero, grows in ((1.5, True), (0.7, False)):
        C = np.linalg.solve([[1.0, 1.0], [0.2 - zero, 0.5 - zero]], [1.0, 0.0])[None]
        np.testing.assert_allclose(invariant_zeros(A, B, C, D).zeros, [zero], atol=1e-12)
        Q, R, S = 1e-4 * np.eye(2), 1e-4 * np.eye(1), np.zeros((2, 1))
        cov = input_filter(A, B, C, D, Q, R, S, np.zeros((60, 1)), P0=np.eye(2)).u_cov[:, 0, 0]
        assert (cov[58] > 100 * cov[30]) == grows


def test_force_on_the_beam_is_identifiable_by_its_four_sensors():
    found = invariant_zeros(*beam(0)[:4])
    assert found.identifiable
    assert len(found.zeros) == 0
