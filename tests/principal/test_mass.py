import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from principal_bodies import (
    BOOMERANG,
    BOOMERANG_MASS,
    TRUSS,
    boomerang_stiffness,
    frame_mass,
    rods,
    truss_mass,
    truss_stiffness,
)
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.principal.mass import mass_center, mass_properties
from forceid.principal.operator import cross_matrix

free = settings(deadline=None, derandomize=True, max_examples=40)


def frequencies(K, M):
    value = scipy.linalg.eigh(K, M, eigvals_only=True)
    return np.sqrt(value[value > 1e-6 * value[-1]]) / (2 * np.pi)


def test_boomerang_has_its_published_mass_properties():
    p = mass_properties(BOOMERANG_MASS, BOOMERANG)
    np.testing.assert_allclose(p.center, [0.225, -0.25 / 3], rtol=1e-12)
    np.testing.assert_allclose(p.inertia, 0.003691666667, rtol=1e-9)
    about_1 = mass_properties(BOOMERANG_MASS, BOOMERANG, about=BOOMERANG[0])
    np.testing.assert_allclose(about_1.matrix[:, 2], [0.01, 0.027, 0.0106], rtol=1e-12)
    np.testing.assert_allclose(about_1.matrix, about_1.matrix.T, atol=1e-18)


def test_boomerang_with_hinge_spring_has_its_published_frequencies():
    f = frequencies(boomerang_stiffness(40.0), np.diag(np.repeat(BOOMERANG_MASS, 2)))
    np.testing.assert_allclose(f, [30.438025, 43.448509, 54.105279], rtol=2e-8)


BAR = np.array([[0.0, 0.0], [1.5, 1.5]]) / np.sqrt(2)


def test_consistent_bar_has_the_inertia_of_a_rod_and_lumped_bar_has_not():
    consistent = 2.0 / 6 * np.kron([[2, 1], [1, 2]], np.eye(2))
    end, middle = (mass_properties(consistent, BAR, about=p) for p in (BAR[0], BAR.mean(axis=0)))
    np.testing.assert_allclose(end.matrix[:, 2], [-1.060660172, 1.060660172, 1.5], rtol=1e-9)
    np.testing.assert_allclose(middle.inertia, 0.375, rtol=1e-12)
    np.testing.assert_allclose(middle.matrix[:2, 2], 0, atol=1e-15)
    lumped = [mass_properties([1.0, 1.0], BAR, about=p).inertia for p in (BAR[0], BAR.mean(axis=0))]
    np.testing.assert_allclose(lumped, [2.25, 1.125], rtol=1e-12)


def test_space_truss_has_its_published_mass_properties_and_frequencies():
    p = mass_properties(truss_mass(), TRUSS)
    np.testing.assert_allclose(p.mass, 25.813503528, rtol=1e-10)
    np.testing.assert_allclose(p.center, [0.502701735, 0.4928071109, 0.6805074061], rtol=1e-9)
    np.testing.assert_allclose(
        np.linalg.eigvalsh(p.inertia), [6.528381923, 11.33341633, 11.7547512], rtol=1e-9
    )
    first = frequencies(truss_stiffness(), truss_mass())[:3]
    np.testing.assert_allclose(first, [278.01805, 381.16773, 399.90847], rtol=2e-8)


@pytest.mark.parametrize("about", [None, (0.2, -0.1, 0.3)])
def test_consistent_truss_equals_thin_rods_in_closed_form(about):
    p = mass_properties(truss_mass(), TRUSS, about)
    m, c, J = rods(about=p.about)
    np.testing.assert_allclose(p.mass, m, rtol=1e-12)
    np.testing.assert_allclose(p.center, c, rtol=1e-12)
    np.testing.assert_allclose(p.inertia, J, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(p.matrix[:3, :3], m * np.eye(3), atol=1e-11)
    np.testing.assert_allclose(p.matrix[3:, :3], m * cross_matrix(c - p.about), atol=1e-11)
    np.testing.assert_allclose(p.matrix[3:, 3:], J, atol=1e-11)


def test_inertia_turns_with_the_body():
    R = Rotation.from_rotvec([0.7, -1.1, 2.0]).as_matrix()
    J = mass_properties(truss_mass(), TRUSS).inertia
    turned = mass_properties(truss_mass(), TRUSS @ R.T).inertia
    np.testing.assert_allclose(turned, R @ J @ R.T, rtol=0, atol=1e-13 * np.trace(J))


def test_welded_frame_needs_its_rotations_to_have_its_published_inertia():
    about = (0.2, -0.1, 0.3)
    with_rotations = mass_properties(frame_mass(), TRUSS, about)
    np.testing.assert_allclose(with_rotations.matrix[3, 3], 36.52867943, rtol=1e-9)
    translations = (6 * np.arange(9)[:, None] + np.arange(3)).ravel()
    without = mass_properties(frame_mass()[np.ix_(translations, translations)], TRUSS, about)
    np.testing.assert_allclose(without.matrix[3, 3], 37.931334, rtol=1e-7)


def test_beam_mass_left_behind_by_a_turning_frame_gives_a_wrong_inertia():
    R = Rotation.from_rotvec([0.7, -1.1, 2.0]).as_matrix()
    T = np.kron(np.eye(18), R)
    J = mass_properties(frame_mass(), TRUSS).inertia
    carried = mass_properties(T @ frame_mass() @ T.T, TRUSS @ R.T).inertia
    stale = mass_properties(frame_mass(), TRUSS @ R.T).inertia
    np.testing.assert_allclose(carried, R @ J @ R.T, rtol=0, atol=1e-12 * np.trace(J))
    assert np.abs(stale - R @ J @ R.T).max() > 0.5


def test_sparse_and_dense_mass_give_the_same_record():
    for M, x in ((truss_mass(), TRUSS), (frame_mass(), TRUSS)):
        dense = mass_properties(M, x)
        for sparse in (scipy.sparse.csr_array(M), scipy.sparse.coo_matrix(M)):
            np.testing.assert_allclose(mass_properties(sparse, x).matrix, dense.matrix, atol=1e-12)
            np.testing.assert_allclose(mass_center(sparse, x), dense.center, atol=1e-14)


def test_diagonal_mass_matrix_is_the_lumped_mass():
    m = np.random.default_rng(0).uniform(0.1, 1, 9)
    lumped = mass_properties(m, TRUSS, about=[1.0, 2.0, 3.0])
    matrix = mass_properties(np.diag(np.repeat(m, 3)), TRUSS, about=[1.0, 2.0, 3.0])
    np.testing.assert_allclose(matrix.matrix, lumped.matrix, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(matrix.length, lumped.length, rtol=1e-12)


@pytest.mark.parametrize("kind", ["lumped", "matrix", "planar", "planar matrix"])
def test_properties_of_a_moving_body_are_those_of_each_frame(kind):
    rng = np.random.default_rng(5)
    x = rng.normal(size=(4, 9, 2 if "planar" in kind else 3))
    M = truss_mass(TRUSS[:, : x.shape[-1]]) if "matrix" in kind else rng.uniform(0.1, 1, 9)
    p = mass_properties(M, x)
    for k in range(4):
        q = mass_properties(M, x[k])
        for name in ("mass", "center", "inertia", "matrix", "about", "length"):
            np.testing.assert_allclose(
                np.broadcast_to(getattr(p, name), (4, *np.shape(getattr(q, name))))[k],
                getattr(q, name),
                atol=1e-12,
            )


@free
@given(st.integers(0, 10**6))
def test_coupling_vanishes_at_the_mass_center_only_and_length_ignores_the_point(seed):
    rng = np.random.default_rng(seed)
    m, x, p = rng.uniform(0.1, 1, 6), rng.normal(size=(6, 3)), rng.normal(size=3)
    center, other = mass_properties(m, x), mass_properties(m, x, about=p)
    np.testing.assert_allclose(center.matrix[:3, 3:], 0, atol=1e-13)
    assert np.abs(other.matrix[:3, 3:]).max() > 1e-3
    np.testing.assert_allclose(other.length, center.length, rtol=1e-10)
    rms = np.sqrt(m @ ((x - center.center) ** 2).sum(axis=1) / m.sum())
    np.testing.assert_allclose(center.length, rms, rtol=1e-12)


def test_a_gap_in_a_massless_marker_costs_nothing():
    m, x = np.array([1.0, 0.0, 2.0]), np.array([[0.0, 0, 0], [np.nan] * 3, [3.0, 0, 0]])
    p = mass_properties(m, x)
    np.testing.assert_allclose(p.center, [2, 0, 0])
    np.testing.assert_allclose(p.inertia, np.diag([0, 6, 6]))
    gap = mass_properties([1.0, 1.0, 2.0], np.stack([x, np.eye(3)]))
    assert np.isnan(gap.center[0]).all()
    np.testing.assert_array_equal(np.isnan(gap.inertia).all(axis=(1, 2)), [True, False])


@pytest.mark.parametrize(
    ("mass", "says"),
    [
        ([0.0, 0.0, 0.0], "mass totals 0 kg, expected a positive total"),
        ([1.0, -3.0, 1.0], "mass totals -1 kg"),
        ([1.0, np.nan, 1.0], "mass totals nan kg"),
        (-np.eye(9), "mass totals -3 kg"),
        ([1.0, 2.0], r"mass has shape \(2,\), expected \(3,\) for the 3 nodes"),
        (np.diag([1.0, 2, 3, 1, 2, 3, 1, 2, 3]), "mass gives different masses along the axes, .*node-major"),
    ],
)
def test_impossible_mass_is_refused_in_words(mass, says):
    with pytest.raises(DataError, match=says):
        mass_properties(mass, np.random.default_rng(0).normal(size=(3, 3)))
