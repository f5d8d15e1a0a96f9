import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from principal_bodies import BARS, TRUSS
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.principal.operator import cross_matrix, sum_nodal, summation_operator

near = st.floats(-10, 10)
free = settings(deadline=None, derandomize=True, max_examples=50)


def test_spatial_node_rows_are_those_of_the_theory():
    x, y, z = 0.3, -0.7, 1.1
    printed = [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 1, 0, 0, 0],
        [0, -z, y, 1, 0, 0],
        [z, 0, -x, 0, 1, 0],
        [-y, x, 0, 0, 0, 1],
    ]
    node = np.array([[x, y, z]])
    np.testing.assert_array_equal(summation_operator(node, rotations=True).T, printed)
    np.testing.assert_array_equal(summation_operator(node).T, np.array(printed)[:, :3])


def test_planar_node_rows_are_those_of_the_theory():
    S = summation_operator([[0.3, -0.7]], about=[0.1, 0.2], rotations=True)
    np.testing.assert_allclose(S, [[1, 0, 0.9], [0, 1, 0.2], [0, 0, 1]], atol=1e-15)
    np.testing.assert_array_equal(summation_operator([[0.3, -0.7]], about=[0.1, 0.2]), S[:2])


def test_cross_matrix_turns_columns_into_cross_products():
    r, b = np.random.default_rng(1).normal(size=(2, 40, 3))
    np.testing.assert_allclose((cross_matrix(r) @ b[..., None])[..., 0], np.cross(r, b), atol=1e-15)


@free
@given(arrays(float, (4, 5, 3), elements=near), arrays(float, (4, 3), elements=near))
def test_every_frame_and_moment_point_of_a_batch_is_its_own_operator(position, about):
    S = summation_operator(position, about)
    assert S.shape == (4, 15, 6)
    for k in range(4):
        np.testing.assert_array_equal(S[k], summation_operator(position[k], about[k]))


@free
@given(
    arrays(float, (5, 3), elements=near),
    arrays(float, (2, 5, 6), elements=near),
    arrays(float, 3, elements=near),
)
def test_sums_of_nodal_forces_and_moments_equal_the_operator_times_them(position, nodal, about):
    for rotations in (False, True):
        f = nodal if rotations else nodal[..., :3]
        expected = f.reshape(2, -1) @ summation_operator(position, about, rotations)
        np.testing.assert_allclose(sum_nodal(f, position, about), expected, atol=1e-11)
        w = np.arange(5.0)
        weighted = (w[:, None] * f).reshape(2, -1) @ summation_operator(position, about, rotations)
        np.testing.assert_allclose(sum_nodal(f, position, about, weight=w), weighted, atol=1e-10)


def test_planar_operator_is_the_planar_part_of_the_spatial_one():
    rng = np.random.default_rng(2)
    x, f, p = rng.normal(size=(6, 2)), rng.normal(size=(6, 2)), rng.normal(size=2)
    spatial = sum_nodal(np.c_[f, np.zeros(6)], np.c_[x, np.zeros(6)], np.r_[p, 0.0])
    np.testing.assert_allclose(sum_nodal(f, x, p), spatial[[0, 1, 5]], atol=1e-14)


def spring_forces(x, rest):
    """Internal force and tangent stiffness of springs along the truss bars at a deformed, stressed shape."""
    force, K = np.zeros_like(x), np.zeros((x.size, x.size))
    for (i, j), l0 in zip(BARS, rest, strict=True):
        d = x[j] - x[i]
        length = np.linalg.norm(d)
        n, k = d / length, 1000.0 / l0
        pull = k * (length - l0)
        force[i] -= pull * n
        force[j] += pull * n
        block = k * np.outer(n, n) + pull / length * (np.eye(3) - np.outer(n, n))
        for a, b, s in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            K[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += s * block
    return force, K


REST = [np.linalg.norm(TRUSS[j] - TRUSS[i]) for i, j in BARS]


@free
@given(st.integers(0, 10**6))
def test_internal_forces_have_no_resultant_at_any_rotated_and_deformed_shape(seed):
    rng = np.random.default_rng(seed)
    x = (TRUSS + 0.1 * rng.normal(size=TRUSS.shape)) @ Rotation.random(rng=rng).as_matrix().T
    force, _ = spring_forces(x, REST)
    assert np.abs(sum_nodal(force, x)).max() <= 1e-11 * np.abs(force).max()


def test_undeformed_operator_leaves_a_spurious_moment():
    rng = np.random.default_rng(3)
    x = TRUSS + 0.1 * rng.normal(size=TRUSS.shape)
    force, _ = spring_forces(x, REST)
    assert np.abs(sum_nodal(force, TRUSS)[3:]).max() > 1e-2 * np.abs(force).max()


def test_tangent_stiffness_of_a_loaded_body_turns_its_internal_forces():
    x = TRUSS + 0.1 * np.random.default_rng(4).normal(size=TRUSS.shape)
    force, K_T = spring_forces(x, REST)
    turned = (K_T @ summation_operator(x)[:, 3:]).reshape(-1, 3, 3)
    np.testing.assert_allclose(turned, -cross_matrix(force), atol=1e-12 * np.abs(K_T).max())
    assert np.abs(turned).max() > 1.0
    np.testing.assert_allclose(K_T @ summation_operator(x)[:, :3], 0, atol=1e-12 * np.abs(K_T).max())


@pytest.mark.parametrize(
    ("position", "about", "named"),
    [
        (np.zeros((4, 5)), None, "position"),
        (np.zeros(3), None, "position"),
        (np.zeros((4, 3)), [0.0, 1.0], "about"),
    ],
)
def test_coordinates_of_the_wrong_kind_are_named(position, about, named):
    with pytest.raises(DataError, match=f"^{named} has shape"):
        summation_operator(position, about)
