"""Index symbols: printed values, sum rules, equal and extreme axes, divided differences."""

import numpy as np
import pytest

from forceid.errors import DataError
from forceid.pseudorigid.steady.index_symbols import index_symbols, pair_symbols, potential_integral

PRINTED = [
    ((1, 0.9, 0.6), (0.503667321927636, 0.575386311478644, 0.920946366593720)),
    ((1, 0.5, 0.4), (0.305726027500329, 0.743505416968837, 0.950768555530835)),
    ((1, 1, 0.5), (0.472799717437430, 0.472799717437430, 1.05440056512514)),
]
AXES = np.exp(np.random.default_rng(70).uniform(-3, 3, (500, 3)))
EXTREME = [(1, 1, r) for r in (1, 0.999999, 1e-2, 1e-4, 1e-6)] + [(1, r, r) for r in (0.99, 1e-3, 1e-6)]


@pytest.mark.parametrize(("axes", "printed"), PRINTED)
def test_printed_symbols_are_met_to_1e_14(axes, printed):
    np.testing.assert_allclose(index_symbols(*axes), printed, rtol=3e-15)


def test_the_three_symbols_add_up_to_two_at_any_axes():
    np.testing.assert_allclose(index_symbols(*AXES.T).sum(-1), 2, rtol=1e-14)
    np.testing.assert_allclose(index_symbols(*np.array(EXTREME).T).sum(-1), 2, rtol=1e-14)


def test_symbols_follow_a_permutation_of_the_axes():
    for order in ((1, 2, 0), (1, 0, 2)):
        A, P = index_symbols(*AXES.T), pair_symbols(*AXES.T)[0]
        np.testing.assert_allclose(index_symbols(*AXES[:, order].T), A[:, order], rtol=1e-14)
        np.testing.assert_allclose(pair_symbols(*AXES[:, order].T)[0], P[:, order][:, :, order], rtol=1e-13)


@pytest.mark.parametrize("axes", [*EXTREME, *AXES[:20]])
def test_pair_symbols_hold_their_sum_rules_to_rounding(axes):
    A, (P, B), x = index_symbols(*axes), pair_symbols(*axes), np.square(axes)
    # 2 A_ii + sum_j A_ij = 2 / a_i^2, A_i = a_j^2 A_ij + B_ij
    np.testing.assert_allclose((2 * np.diag(P) + P.sum(1)) * x, 2, rtol=1e-14)
    np.testing.assert_allclose(x * P + B, np.broadcast_to(A[:, None], (3, 3)), rtol=1e-14)
    assert (P > 0).all()
    assert (B > 0).all()


def test_pair_symbols_are_the_divided_differences_at_axes_apart():
    axes = np.array([1.0, 0.7, 0.4])
    A, (P, B), x = index_symbols(*axes), pair_symbols(*axes), axes**2
    for i, j in ((0, 1), (0, 2), (1, 2)):
        np.testing.assert_allclose(P[i, j], (A[i] - A[j]) / (x[j] - x[i]), rtol=1e-13)
        np.testing.assert_allclose(B[i, j], (x[i] * A[i] - x[j] * A[j]) / (x[i] - x[j]), rtol=1e-13)


def test_pair_symbols_pass_smoothly_through_equal_axes_where_differences_fail():
    gaps = np.array([0.0, 1e-9, 1e-7, 1e-5])
    P = pair_symbols(1 + gaps, 1 - gaps, 0.6)[0][:, 0, 1]
    A = index_symbols(1 + 1e-9, 1 - 1e-9, 0.6)
    np.testing.assert_allclose(P, P[0], rtol=2e-10)  # even in the gap
    assert abs((A[0] - A[1]) / -4e-9 / P[0] - 1) > 1e-9


@pytest.mark.parametrize("e", [0.3, 0.8, 0.98])
def test_symbols_of_a_spheroid_are_the_closed_forms(e):
    c, asin = np.sqrt(1 - e**2), np.arcsin(e)
    A1, A3 = c / e**3 * (asin - e * c), 2 / e**2 * (1 - c * asin / e)
    A11 = (2 - (A3 - A1) / e**2) / 4
    A, (P, B) = index_symbols(1, 1, c), pair_symbols(1, 1, c)
    np.testing.assert_allclose(A, [A1, A1, A3], rtol=1e-13)
    np.testing.assert_allclose([P[0, 0], P[0, 1], B[0, 0]], [A11, A11, A1 - A11], rtol=1e-12)


def test_the_potential_integral_is_half_the_sum_of_symbols_over_the_volume():
    # homogeneity: 2 J R_F = sum A_i a_i^2
    twice = 2 * AXES.prod(-1) * potential_integral(*AXES.T)
    np.testing.assert_allclose(twice, (index_symbols(*AXES.T) * AXES**2).sum(-1), rtol=1e-13)


def test_axes_broadcast():
    P, B = pair_symbols(1.0, np.array([[0.5], [0.9]]), np.array([0.3, 0.4, 0.5]))
    assert index_symbols(1.0, np.array([[0.5], [0.9]]), np.array([0.3, 0.4, 0.5])).shape == (2, 3, 3)
    assert P.shape == B.shape == (2, 3, 3, 3)
    np.testing.assert_allclose(P[1, 2], pair_symbols(1, 0.9, 0.5)[0], rtol=1e-13)
    assert pair_symbols(np.ones((0, 1)), 1.0, 1.0)[0].shape == (0, 1, 3, 3)


@pytest.mark.parametrize(("axes", "name"), [((1, 0, 1), "a2"), ((1, 1, -2), "a3"), ((np.nan, 1, 1), "a1")])
def test_an_axis_that_is_not_positive_is_refused_by_name(axes, name):
    with pytest.raises(DataError, match=rf"axis {name} is .*expected a positive length"):
        index_symbols(*axes)
