import numpy as np
import pytest
from scipy.stats import chi2

from forceid.errors import DataError
from forceid.partition.coupling.resultants import incidence, link_resultants
from forceid.principal.wrench import transport

CHAIN = [(0, 1), (1, 2), (2, 3)]
LOOP = [*CHAIN, (3, 0)]


def given_away(links, g, parts):
    """What each part gives to links that pass g (..., link, n)."""
    return np.einsum("pl,...ln->...pn", incidence(links, parts), g)


def hinge(point):
    """Planar forces through a point, with their moments about the origin."""
    x, y = point
    return np.array([[1.0, 0.0], [0.0, 1.0], [-y, x]])


@pytest.mark.parametrize("n", [3, 6])
def test_links_of_a_tree_pass_the_sums_of_what_lies_beyond_them(n):
    g = np.random.default_rng(1).normal(size=(50, 5, n))
    tree = [(0, 1), (1, 2), (3, 1), (3, 4), (2, 5)]
    found = link_resultants(tree, given_away(tree, g, 6))
    np.testing.assert_allclose(found.wrench, g, atol=1e-12)
    assert found.loops == 0
    assert found.null_space.shape == (5 * n, 0)
    assert found.determined.all()
    assert found.dof == n
    np.testing.assert_allclose(found.chi_square, 0, atol=1e-24)


def test_the_ground_takes_what_a_hanging_chain_cannot_keep():
    weights = np.array([[0.0, -1.0, 0.2], [0.0, -2.0, 0.5], [0.0, -3.0, 0.1]])
    found = link_resultants([(0, -1), (1, 0), (2, 1)], weights)
    np.testing.assert_allclose(found.wrench, np.cumsum(weights[::-1], axis=0)[::-1], atol=1e-12)
    assert (found.loops, found.dof) == (0, 0)


@pytest.mark.parametrize("n", [3, 6])
def test_a_loop_leaves_one_wrench_open_and_tells_the_rest_exactly(n):
    g = np.random.default_rng(2).normal(size=(20, 4, n))
    found = link_resultants(LOOP, given_away(LOOP, g, 4))
    assert found.loops == 1
    assert found.null_space.shape == (4 * n, n)
    assert not found.determined.any()
    np.testing.assert_allclose(found.null_space.T @ found.null_space, np.eye(n), atol=1e-12)
    np.testing.assert_allclose(found.wrench.reshape(20, -1), g.reshape(20, -1) @ found.estimable, atol=1e-12)
    # around the loop one and the same wrench: links differ by what is known
    np.testing.assert_allclose(np.diff(found.wrench, axis=1), np.diff(g, axis=1), atol=1e-12)


def test_a_link_outside_the_loop_is_told_beside_it():
    links = [*LOOP, (2, 4)]
    g = np.random.default_rng(3).normal(size=(5, 6))
    found = link_resultants(links, given_away(links, g, 5))
    assert found.determined.tolist() == [False] * 4 + [True]
    np.testing.assert_allclose(found.wrench[4], g[4], atol=1e-12)


def test_the_ground_closes_a_loop_on_a_chain_held_at_both_ends():
    links = [(0, -1), *CHAIN, (3, -1)]
    found = link_resultants(links, np.zeros((4, 3)))
    assert found.loops == 1
    assert found.null_space.shape == (15, 3)
    assert found.dof == 0


@pytest.mark.parametrize(("hinges", "open_", "dof"), [(4, 0, 4), (3, 0, 3), (2, 1, 3), (1, 2, 3), (0, 3, 3)])
def test_hinges_close_a_planar_loop_of_four_bars(hinges, open_, dof):
    rng, points = np.random.default_rng(4), [(1.0, 0.0), (1.3, 0.9), (0.1, 1.0), (-0.2, 0.1)]
    passes = [hinge(p) if k < hinges else None for k, p in enumerate(points)]
    g = np.array([p @ rng.normal(size=2) if p is not None else rng.normal(size=3) for p in passes])
    found = link_resultants(LOOP, given_away(LOOP, g, 4), passes=passes)
    assert (found.null_space.shape[1], found.dof) == (open_, dof)
    np.testing.assert_allclose(found.wrench.ravel(), found.estimable @ g.ravel(), atol=1e-12)
    if not open_:
        np.testing.assert_allclose(found.wrench, g, atol=1e-11)


def test_a_hinge_that_travels_passes_forces_through_where_it_is():
    rng, t = np.random.default_rng(5), np.linspace(0, 1, 30)
    elbow = np.stack([np.cos(t), np.sin(t)], axis=-1)
    force = rng.normal(size=(30, 2, 2))
    moving = np.array([hinge(p) for p in elbow])
    g = np.stack([(hinge((0, 0)) @ force[:, 0, :, None])[..., 0], (moving @ force[:, 1, :, None])[..., 0]], 1)
    links = [(0, -1), (1, 0)]
    found = link_resultants(
        links, given_away(links, g, 2), np.broadcast_to(np.eye(3), (2, 3, 3)), [hinge((0, 0)), moving]
    )
    np.testing.assert_allclose(found.wrench, g, atol=1e-12)
    assert found.dof == 2
    assert found.wrench.shape == (30, 2, 3)
    assert found.joint_cov.shape == (30, 6, 6)


@pytest.mark.parametrize(("balls", "open_"), [(1, 3), (2, 1), (3, 0)])
def test_ball_joints_open_a_spatial_loop_but_for_the_thrust_between_two(balls, open_):
    points = np.random.default_rng(8).normal(size=(balls, 3))
    forces = [transport(np.hstack([np.eye(3), np.zeros((3, 3))]), p).T for p in points]
    found = link_resultants(LOOP, np.zeros((4, 6)), passes=[*forces, *[None] * (4 - balls)])
    assert found.null_space.shape == (24, open_)
    if balls == 2:
        thrust = transport([*(points[1] - points[0]), 0, 0, 0], points[0])
        np.testing.assert_allclose(found.estimable @ np.tile(thrust, 4), 0, atol=1e-12)


def test_of_two_parts_the_better_known_one_decides():
    cov = np.array([np.eye(3), 3 * np.eye(3)])
    found = link_resultants([(0, 1)], [[4.0, 0, 0], [0.0, 0, 0]], cov)
    np.testing.assert_allclose(found.wrench, [[3.0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(found.cov, 0.75 * np.eye(3)[None], atol=1e-12)
    assert found.chi_square == pytest.approx(4.0)
    assert found.dof == 3


@pytest.mark.parametrize("links", [CHAIN, LOOP])
def test_covariance_and_chi_square_are_those_of_repeated_draws(links):
    rng, count = np.random.default_rng(6), 2000
    g = rng.normal(size=(len(links), 3))
    root = rng.normal(size=(4, 3, 3)) + 2 * np.eye(3)
    noise = (root @ rng.normal(size=(count, 4, 3, 1)))[..., 0]
    found = link_resultants(links, given_away(links, g, 4) + noise, root @ root.mT)
    error = found.wrench.reshape(count, -1) - found.estimable @ g.ravel()
    nees = np.einsum("ti,ij,tj->t", error, np.linalg.pinv(found.joint_cov[0], rcond=1e-10), error)
    for value, dof in ((nees, 9), (found.chi_square, found.dof)):
        low, high = chi2.ppf([0.005, 0.995], dof * count) / count
        assert low < value.mean() < high


def test_links_do_not_depend_on_the_point_that_moments_are_about():
    rng, arm = np.random.default_rng(7), np.array([0.7, -2.0, 0.4])
    links, cov = (
        [*LOOP, (2, 4)],
        np.array([(r := rng.normal(size=(6, 6))) @ r.T + np.eye(6) for _ in range(5)]),
    )
    T = transport(np.eye(6), arm).T
    w = rng.normal(size=(5, 6))  # not in balance
    here = link_resultants(links, w, cov)
    there = link_resultants(links, transport(w, arm), T @ cov @ T.T)
    np.testing.assert_allclose(there.wrench[4], T @ here.wrench[4], atol=1e-11)
    np.testing.assert_allclose(there.cov[4], T @ here.cov[4] @ T.T, rtol=1e-9, atol=1e-11)
    assert there.chi_square == pytest.approx(here.chi_square, rel=1e-10)
    moved = np.kron(np.eye(5), T) @ here.null_space
    np.testing.assert_allclose(there.estimable @ moved, 0, atol=1e-12)
    np.testing.assert_allclose(
        there.estimable @ (np.kron(np.eye(5), T) @ here.wrench.ravel()), there.wrench.ravel(), atol=1e-11
    )


def test_a_gap_in_one_sample_stays_there():
    g = np.ones((3, 3, 3))
    w = given_away(CHAIN, g, 4)
    w[1, 2, 0] = np.nan
    found = link_resultants(CHAIN, w, np.broadcast_to(np.eye(3), (4, 3, 3)))
    assert np.isnan(found.wrench[1]).all()
    assert np.isnan(found.chi_square[1])
    np.testing.assert_allclose(found.wrench[[0, 2]], 1.0)
    gap = np.broadcast_to(np.eye(3), (3, 4, 3, 3)).copy()
    gap[0, 1] = np.nan
    found = link_resultants(CHAIN, given_away(CHAIN, g, 4), gap)
    assert np.isnan(found.cov[0]).all()
    assert np.isfinite(found.cov[1:]).all()


@pytest.mark.parametrize(
    ("links", "options", "told"),
    [
        ([(0, 4)], {}, r"link 0 is \(0, 4\), expected two of the parts 0 to 3"),
        ([(2, 2)], {}, r"link 0 is \(2, 2\)"),
        ([], {}, "links is empty"),
        (CHAIN, {"passes": [None]}, "passes has 1 entries, expected 3"),
        (CHAIN, {"passes": [np.eye(2), None, None]}, "passes of link 0 has shape"),
        (CHAIN, {"cov": np.zeros((4, 3, 3))}, "cov must be positive definite"),
        (CHAIN, {"cov": np.eye(3)}, "cov has shape"),
    ],
)
def test_links_that_make_no_sense_are_named(links, options, told):
    with pytest.raises(DataError, match=told):
        link_resultants(links, np.zeros((4, 3)), **options)


def test_one_wrench_is_not_taken_for_parts():
    with pytest.raises(DataError, match=r"wrench has shape \(3,\)"):
        link_resultants(CHAIN, np.zeros(3))
