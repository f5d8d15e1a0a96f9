import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from principal_bodies import BOOMERANG, BOOMERANG_MASS, boomerang_acceleration
from scipy.stats import chi2

from forceid.errors import DataError, EstimationError
from forceid.principal.loads import distribute, solve_loads, undetermined
from forceid.principal.mass import mass_center
from forceid.principal.operator import sum_nodal, summation_operator
from forceid.principal.wrench import resultant, transport, transport_cov, transport_matrix

free = settings(deadline=None, derandomize=True, max_examples=40)

NODES = np.array([[0.0, 0, 0], [0.3, 0, 0.02], [0.1, 0.25, -0.01], [-0.15, 0.2, 0.03], [0.2, -0.2, 0]])
MASS = np.array([0.02, 0.03, 0.015, 0.025, 0.01])
WRENCH = np.array([0.5, -0.2, 1.1, 0.04, -0.02, 0.03])


def test_minimum_norm_forces_have_their_published_values():
    f = distribute(WRENCH, NODES, about=mass_center(MASS, NODES))
    printed = [0.10787666, -0.040893531, 0.13697216, 0.097473017, -0.033086901, 0.29302678]
    printed += [0.09450247, -0.026220837, 0.37004763, 0.07741039, -0.073766008, 0.20379067]
    printed += [0.12273747, -0.026032724, 0.096162759]
    np.testing.assert_allclose(f.ravel(), printed, rtol=1e-7)


def test_boomerang_forces_have_their_published_values():
    a = boomerang_acceleration()
    least = distribute(resultant(BOOMERANG_MASS, BOOMERANG, a, BOOMERANG[0]), BOOMERANG, about=BOOMERANG[0])
    np.testing.assert_allclose(
        least.ravel(), [0.01065574, 0.1989071, 0.01065574, 0.4005464, 0.1786885, 0.4005464], rtol=3e-7
    )
    rigid = distribute(resultant(BOOMERANG_MASS, BOOMERANG, a), BOOMERANG, weight=BOOMERANG_MASS)
    np.testing.assert_allclose(
        rigid.ravel(), [0.02065463, 0.1707675, 0.03442438, 0.4606847, 0.144921, 0.3685478], rtol=3e-7
    )


@free
@given(st.integers(0, 10**6), st.sampled_from([2, 3]), st.booleans())
def test_distributed_forces_have_the_resultant_and_the_least_weighted_norm(seed, axis, weighted):
    rng = np.random.default_rng(seed)
    x, p = rng.normal(size=(3, 6, axis)), rng.normal(size=(3, axis))
    g = rng.normal(size=(3, axis * (axis + 1) // 2))
    w = rng.uniform(0.1, 3, 6) if weighted else None
    f = distribute(g, x, w, p)
    np.testing.assert_allclose(sum_nodal(f, x, p), g, atol=1e-10 * np.abs(g).max())
    root = np.sqrt(np.repeat(w if weighted else np.ones(6), axis))
    for k in range(3):
        A = summation_operator(x[k], p[k]).T * root
        lstsq = root * np.linalg.lstsq(A, g[k], rcond=None)[0]
        np.testing.assert_allclose(f[k].ravel(), lstsq, atol=1e-9 * np.abs(lstsq).max())


def test_default_point_is_the_center_of_the_weights():
    np.testing.assert_allclose(
        distribute(WRENCH, NODES, MASS), distribute(WRENCH, NODES, MASS, mass_center(MASS, NODES)), rtol=1e-12
    )
    np.testing.assert_allclose(
        distribute(WRENCH, NODES), distribute(WRENCH, NODES, about=NODES.mean(axis=0)), rtol=1e-12
    )


def test_mass_weighted_forces_are_the_pattern_of_a_rigid_acceleration():
    f = distribute(WRENCH, NODES, MASS)
    a = (f / MASS[:, None]).ravel()
    S = summation_operator(NODES)
    rigid = S @ np.linalg.lstsq(S, a, rcond=None)[0]
    np.testing.assert_allclose(a, rigid, atol=1e-12 * np.abs(a).max())


def test_collinear_nodes_carry_all_but_the_moment_about_their_line():
    line = 3.7 + np.linspace(0, 1, 4)[:, None] * np.array([1.0, 2.0, -1.0])
    along = np.array([1.0, 2.0, -1.0]) / np.sqrt(6)
    across = np.cross(along, [0, 0, 1.0])
    f = distribute([1, 2, 3, *across], line)
    np.testing.assert_allclose(sum_nodal(f, line, line.mean(axis=0)), [1, 2, 3, *across], atol=1e-10)
    with pytest.raises(EstimationError, match="on a line"):
        distribute([1, 2, 3, *along], line)
    np.testing.assert_allclose(distribute([1, 2, 3, 0, 0, 0], line[:1]), [[1, 2, 3]])
    with pytest.raises(EstimationError, match="in a point"):
        distribute([0, 0, 1.0], [[0.1, 0.7]])


def test_gap_in_time_stays_a_gap_and_gap_in_a_node_without_weight_is_none():
    g, x = np.tile(WRENCH, (4, 1)), np.tile(NODES, (4, 1, 1))
    g[1, 2], x[2, 3, 0] = np.nan, np.nan
    f = distribute(g, x, MASS)
    assert np.isnan(f[1]).any()
    assert np.isnan(f[2]).any()
    np.testing.assert_allclose(f[[0, 3]], np.tile(distribute(WRENCH, NODES, MASS), (2, 1, 1)))
    assert np.isfinite(distribute(g[2], x[2], MASS * [1, 1, 1, 0, 1])).all()


def test_weights_that_mean_nothing_are_refused():
    for weight in ([1.0, 1, 1, 1, -1], np.zeros(5), [1.0]):
        with pytest.raises(DataError, match="weight must be 5 numbers"):
            distribute(WRENCH, NODES, weight)


def problem(seed, loads, time=40):
    """Loads of random direction at the nodes, the wrench they make about the center, with noise."""
    rng = np.random.default_rng(seed)
    G = summation_operator(NODES, NODES.mean(axis=0)).T @ rng.normal(size=(15, loads))
    L = rng.normal(size=(6, 6)) * np.repeat([0.05, 0.005], 3)[:, None]
    truth = rng.normal(size=(time, loads))
    return G, L @ L.T, truth, truth @ G.T + rng.normal(size=(time, 6)) @ L.T


@pytest.mark.parametrize("loads", [2, 4, 6])
def test_determined_loads_are_the_weighted_least_squares_solution(loads):
    G, C, _, g = problem(loads, loads)
    p = solve_loads(g, C, G, length=0.2)
    inverse = np.linalg.inv(C)
    cov = np.linalg.inv(G.T @ inverse @ G)
    np.testing.assert_allclose(p.load_cov, np.broadcast_to(cov, (40, loads, loads)), rtol=1e-7)
    np.testing.assert_allclose(p.load, g @ (cov @ G.T @ inverse).T, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(p.estimable, np.eye(loads), atol=1e-12)
    assert p.null_space.shape == (loads, 0)
    assert p.dof == 6 - loads
    assert undetermined(p) == ()


def test_answer_does_not_depend_on_the_moment_point():
    G, C, _, g = problem(1, 4)
    arm = np.array([0.4, -1.1, 0.7])
    here, there = (
        solve_loads(g, C, G, 0.2),
        solve_loads(transport(g, arm), transport_cov(C, arm), transport_matrix(arm) @ G, 0.2),
    )
    np.testing.assert_allclose(there.load, here.load, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(there.load_cov, here.load_cov, rtol=1e-7)
    np.testing.assert_allclose(there.chi_square, here.chi_square, rtol=1e-7)
    untold = solve_loads(transport(g, arm), C, transport_matrix(arm) @ G, 0.2)
    assert np.abs(untold.load - here.load).max() > 1e-2


def test_errors_and_misfit_follow_the_claimed_distributions():
    n = 4000
    G, C, truth, g = problem(2, 3, time=n)
    p = solve_loads(g, C, G, 0.2)
    error = p.load - truth
    nees = np.einsum("ti,tij,tj->t", error, np.linalg.inv(p.load_cov), error)
    for statistic in (nees, p.chi_square):
        total = statistic.sum()
        assert chi2.ppf(0.005, 3 * n) < total < chi2.ppf(0.995, 3 * n)
    outside = (p.chi_square > chi2.ppf(0.95, p.dof)).mean()
    assert abs(outside - 0.05) < 4 * np.sqrt(0.05 * 0.95 / n)


def test_more_loads_than_equations_keep_what_is_determined_and_say_what_is_not():
    G, C, truth, g = problem(3, 8)
    exact = truth @ G.T
    p = solve_loads(exact, C, G, 0.2)
    assert (p.estimable.shape, p.null_space.shape, p.dof) == ((6, 8), (8, 2), 0)
    np.testing.assert_allclose(G @ p.null_space, 0, atol=1e-12)
    np.testing.assert_allclose(p.estimable @ p.null_space, 0, atol=1e-10)
    np.testing.assert_allclose(p.load @ p.estimable.T, truth @ p.estimable.T, atol=1e-9)
    np.testing.assert_allclose(p.load, exact @ np.linalg.pinv(G).T, atol=1e-9)
    np.testing.assert_allclose(p.load @ p.null_space, 0, atol=1e-9)
    np.testing.assert_allclose(solve_loads(g, C, G, 0.2).chi_square, 0, atol=1e-9)


def test_two_forces_on_one_line_are_known_by_their_sum_only():
    G = np.array(
        [transport([*d, 0, 0, 0], r) for d, r in (((1.0, 0, 0), (0.1, 0.2, 0)), ((1.0, 0, 0), (0.9, 0.2, 0)))]
    )
    G = np.c_[G.T, [0, 0, 1.0, 0, 0, 0]]
    g = np.array([[1.0, 2.0, 3.0]]) @ G.T
    p = solve_loads(g, np.eye(6) * 1e-4, G, 0.2, name=["left", "right", "lift"])
    np.testing.assert_allclose(p.estimable, [[1, 1, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(p.estimable @ p.load[0], [3, 3], rtol=1e-10)
    assert p.dof == 4
    assert p.name == ("left", "right", "lift")
    assert undetermined(p) == ("left", "right")


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_rank_does_not_depend_on_the_unit_of_length(unit):
    offset = 1e-4  # two parallel forces, a ten thousandth of the body's radius apart
    G = np.array([[0, 0, 1, y * unit, 0, 0] for y in (0.0, offset)]).T
    p = solve_loads(np.zeros((1, 6)), np.diag([1, 1, 1, unit**2, unit**2, unit**2]), G, length=unit)
    assert p.dof == 4
    assert solve_loads(np.zeros((1, 6)), np.eye(6), G, length=unit, tolerance=1e-3).dof == 5


def test_loads_that_turn_with_the_body_are_solved_sample_by_sample():
    G, C, _, g = problem(5, 4)
    t = np.linspace(0, 2, 40)
    c, s, o = np.cos(t), np.sin(t), np.zeros(40)
    R = np.stack([c, -s, o, s, c, o, o, o, o + 1], axis=-1).reshape(40, 3, 3)
    T = np.zeros((40, 6, 6))
    T[:, :3, :3] = T[:, 3:, 3:] = R
    p = solve_loads((T @ g[..., None])[..., 0], T @ C @ T.mT, T @ G, 0.2)
    fixed = solve_loads(g, C, G, 0.2)
    np.testing.assert_allclose(p.load, fixed.load, atol=1e-9)
    np.testing.assert_allclose(p.chi_square, fixed.chi_square, rtol=1e-8)
    np.testing.assert_allclose(p.estimable, np.eye(4), atol=1e-9)


def test_what_one_sample_cannot_tell_apart_is_not_estimable_throughout():
    apart, aligned = np.eye(6)[:, :2], np.eye(6)[:, [0, 0]]
    p = solve_loads(np.ones((3, 6)), np.eye(6), np.stack([apart, aligned, apart]), 0.2)
    np.testing.assert_allclose(p.estimable, [[1, 1]], atol=1e-12)
    np.testing.assert_allclose(np.abs(p.null_space), np.full((2, 1), np.sqrt(0.5)), atol=1e-12)
    np.testing.assert_allclose(p.load, [[1, 1], [0.5, 0.5], [1, 1]], atol=1e-12)
    assert p.dof == 4
    np.testing.assert_array_equal(np.isnan(p.chi_square), [False, True, False])


def test_gap_in_the_wrench_is_a_gap_in_the_loads_and_nowhere_else():
    G, C, _, g = problem(6, 3)
    whole = solve_loads(g, C, G, 0.2)
    covs = np.tile(C, (40, 1, 1))
    Gs = np.tile(G, (40, 1, 1))
    g[3, 1], covs[7, 0, 0], Gs[11, 2, 1] = np.nan, np.nan, np.nan
    p = solve_loads(g, covs, Gs, 0.2)
    gap = np.isin(np.arange(40), [3, 7, 11])
    for part in (p.load, p.load_cov.reshape(40, -1), p.chi_square[:, None]):
        np.testing.assert_array_equal(np.isnan(part).all(axis=1), gap)
        assert np.isfinite(part[~gap]).all()
    np.testing.assert_allclose(p.load[~gap], whole.load[~gap], rtol=1e-10)
    nothing = solve_loads(np.full((5, 6), np.nan), C, G, 0.2)
    assert np.isnan(nothing.load).all()


def test_wrench_without_uncertainty_or_of_the_wrong_shape_is_refused():
    G, C, _, g = problem(0, 2)
    with pytest.raises(DataError, match="wrench_cov must be positive definite"):
        solve_loads(g, np.zeros((6, 6)), G, 0.2)
    with pytest.raises(DataError, match=r"wrench has shape \(40, 5\)"):
        solve_loads(g[:, :5], C, G, 0.2)
