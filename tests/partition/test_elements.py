"""Bars, rectangles and bricks: closed forms, patch test, rigid motions, masses."""

from itertools import product

import lecture_cases as lc
import numpy as np
import pytest

from forceid.errors import DataError
from forceid.partition.grids import assemble_elements, bar, box_element, elasticity, solid_parts, strain_of
from forceid.partition.operators.inverse import validated_symmetric, zero_modes
from forceid.principal.operator import summation_operator

YOUNG, POISSON, DENSITY, THICKNESS = 70.0, 0.3, 2.7, 0.2
BOXES = [np.array([0.7, 0.4]), np.array([0.5, 0.8, 0.3])]


def box(size):
    return box_element(size, YOUNG, POISSON, DENSITY, THICKNESS)


def corners(size):
    return np.array(list(product((0.0, 1.0), repeat=len(size)))) * size


def extent(size):
    """Volume, m3."""
    return np.prod(size) * (THICKNESS if len(size) == 2 else 1.0)


def test_square_in_plane_stress_is_the_published_matrix():
    # O. Sigmund, A 99 line topology optimization code written in Matlab (2001): nodes around, thickness one
    v = POISSON
    k = [1 / 2 - v / 6, 1 / 8 + v / 8, -1 / 4 - v / 12, -1 / 8 + 3 * v / 8]
    k += [-1 / 4 + v / 12, -1 / 8 - v / 8, v / 6, 1 / 8 - 3 * v / 8]
    order = [
        [0, 1, 2, 3, 4, 5, 6, 7],
        [1, 0, 7, 6, 5, 4, 3, 2],
        [2, 7, 0, 5, 6, 3, 4, 1],
        [3, 6, 5, 0, 7, 2, 1, 4],
        [4, 5, 6, 7, 0, 1, 2, 3],
        [5, 4, 3, 2, 1, 0, 7, 6],
        [6, 3, 4, 1, 2, 7, 0, 5],
        [7, 2, 1, 4, 3, 6, 5, 0],
    ]
    published = YOUNG / (1 - v**2) * np.array(k)[np.array(order)]
    around = np.array([0, 2, 3, 1])  # of our nodes, the last axis fastest
    dof = (2 * around[:, None] + np.arange(2)).ravel()
    K, _ = box_element(np.ones(2), YOUNG, POISSON, DENSITY)
    assert lc.largest(K[np.ix_(dof, dof)], published) < 1e-14


@pytest.mark.parametrize("size", BOXES, ids=["rectangle", "brick"])
def test_box_is_its_integrals_along_the_edges_multiplied(size):
    """Integrals of products of hat functions and slopes along an edge are known, and the box multiplies."""
    axes = len(size)
    C = elasticity(YOUNG, POISSON, axes)
    shear, lame = C[-1, -1], C[0, 1]

    def along(edge, left, right):
        """Of the integral of N or N' of one node times N or N' of another."""
        slope, mixed = np.array([[1.0, -1], [-1, 1]]), np.array([[-0.5, -0.5], [0.5, 0.5]])
        hats = np.array([[2.0, 1], [1, 2]]) / 6
        return {(0, 0): hats * edge, (1, 1): slope / edge, (1, 0): mixed, (0, 1): mixed.T}[left, right]

    def integral(i, j):
        """Of dN_a/dx_i dN_b/dx_j over the box (node, node)."""
        found = np.ones((1, 1)) * (THICKNESS if axes == 2 else 1.0)
        for a, edge in enumerate(size):
            found = np.kron(found, along(edge, int(a == i), int(a == j)))
        return found

    nodes = 2**axes
    K = np.zeros((nodes, axes, nodes, axes))
    for i, j in product(range(axes), repeat=2):
        K[:, i, :, j] += lame * integral(i, j) + shear * integral(j, i)
        K[:, i, :, i] += shear * integral(j, j)
    assert lc.largest(box(size)[0], K.reshape(nodes * axes, -1)) < 1e-14


@pytest.mark.parametrize("size", BOXES, ids=["rectangle", "brick"])
def test_linear_displacement_stores_the_energy_of_its_constant_strain(size):
    axes, rng = len(size), np.random.default_rng(1)
    K, _ = box(size)
    for gradient in rng.standard_normal((5, axes, axes)):
        u = (corners(size) @ gradient.T + rng.standard_normal(axes)).ravel()
        pairs = [(0, 1)] if axes == 2 else [(1, 2), (0, 2), (0, 1)]
        strain = np.array([*np.diag(gradient), *(gradient[a, b] + gradient[b, a] for a, b in pairs)])
        energy = 0.5 * strain @ elasticity(YOUNG, POISSON, axes) @ strain * extent(size)
        assert 0.5 * u @ K @ u == pytest.approx(energy, rel=1e-13)


@pytest.mark.parametrize("axes", [2, 3])
def test_patch_moved_linearly_at_its_boundary_is_strained_alike_inside(axes):
    (K,), (x,) = (solid_parts((1,) * axes, 3).stiffness, solid_parts((1,) * axes, 3).position)
    u = x @ np.random.default_rng(2).standard_normal((axes, axes))
    inside = np.repeat(((x > 0.01) & (x < 0.99)).all(1), axes)
    load = -K[inside][:, ~inside] @ u.ravel()[~inside]
    found = np.linalg.solve(K[inside][:, inside].toarray(), load)
    assert np.abs(found - u.ravel()[inside]).max() < 1e-13 * np.abs(u).max()


@pytest.mark.parametrize("size", BOXES, ids=["rectangle", "brick"])
def test_rigid_modes_strain_no_box_and_nothing_else_is_free(size):
    K, _ = box(size)
    S = summation_operator(corners(size))
    assert np.abs(K @ S).max() < 1e-14 * np.abs(K).max()
    value = np.linalg.eigvalsh(K)
    assert (value[: S.shape[1]] < 1e-14 * value[-1]).all()
    assert value[S.shape[1]] > 1e-3 * value[-1]


@pytest.mark.parametrize("size", BOXES, ids=["rectangle", "brick"])
def test_consistent_mass_has_the_mass_and_inertia_of_the_box(size):
    _, M = box(size)
    S = summation_operator(corners(size), size / 2)
    mass = DENSITY * extent(size)
    square = size**2 / 12
    inertia = [square.sum()] if len(size) == 2 else square.sum() - square
    assert lc.largest(S.T @ M @ S, np.diag([mass] * len(size) + [mass * j for j in inertia])) < 1e-14


def test_bar_along_a_slope_resists_along_it_only_and_has_the_inertia_of_a_rod():
    length, angle, mass = 2.0, 0.6, 3.0
    e = np.array([np.cos(angle), np.sin(angle)])
    ends = np.array([[0.0, 0.0], length * e])
    K, M = bar(ends, 10.0, mass)
    pull = np.concatenate([-e, e])
    across = np.array([0.0, 0.0, -e[1], e[0]])
    assert pull @ K @ pull == pytest.approx(4 * 10.0 / length, rel=1e-14)
    assert np.abs(K @ across).max() < 1e-15 * np.abs(K).max()
    S = summation_operator(ends)
    rod = mass * np.array(
        [
            [1, 0, -length / 2 * e[1]],
            [0, 1, length / 2 * e[0]],
            [-length / 2 * e[1], length / 2 * e[0], 4 / 3],
        ]
    )
    assert lc.largest(S.T @ M @ S, rod) < 1e-14


def test_solid_that_cannot_contract_is_pulled_by_the_oedometer_modulus():
    C = elasticity(YOUNG, POISSON, 3)
    modulus = YOUNG * (1 - POISSON) / (1 + POISSON) / (1 - 2 * POISSON)
    assert C[0, 0] == pytest.approx(modulus, rel=1e-14)
    compliance = np.linalg.inv(C)
    assert compliance[:3, 0] == pytest.approx(np.array([1, -POISSON, -POISSON]) / YOUNG, rel=1e-13)
    assert 1 / compliance[3, 3] == pytest.approx(YOUNG / 2 / (1 + POISSON), rel=1e-13)


def test_free_sides_of_a_plate_contract_by_the_poisson_number():
    compliance = np.linalg.inv(elasticity(YOUNG, POISSON, 2))
    assert compliance[:2, 0] == pytest.approx(np.array([1, -POISSON]) / YOUNG, rel=1e-13)


def test_shears_come_in_the_order_of_the_axis_they_turn_about():
    dN = np.array([[1.0], [2.0], [3.0]])
    assert strain_of(dN)[3:].tolist() == [[0, 3, 2], [3, 0, 1], [2, 1, 0]]


@pytest.mark.parametrize("poisson", [-1.0, 0.5, 0.7, np.nan])
def test_poisson_numbers_of_no_stable_solid_are_refused(poisson):
    with pytest.raises(DataError, match="poisson"):
        elasticity(YOUNG, poisson, 3)


def test_assembled_springs_add_up_where_they_meet():
    K = assemble_elements(np.array([[0, 1], [1, 2]]), np.array([[1.0, -1.0], [-1.0, 1.0]]), 1, 3)
    assert K.toarray().tolist() == [[1, -1, 0], [-1, 2, -1], [0, -1, 1]]


def test_parts_of_a_plate_add_up_to_the_plate_uncut():
    cut, whole = solid_parts((2, 2), 2), solid_parts((1, 1), 4)
    at = np.lexsort(np.round(4 * cut.place).T[::-1])
    dof = (2 * at[:, None] + np.arange(2)).ravel()
    for parts, uncut in ((cut.stiffness, whole.stiffness[0]), (cut.mass, 4 * whole.mass[0])):
        sum_of = sum(L.T @ K @ L for L, K in zip(cut.boolean, parts, strict=True)).toarray()
        assert lc.largest(sum_of[np.ix_(dof, dof)], uncut.toarray()) < 1e-14


def test_truss_shares_an_edge_once_inside_a_part_and_doubles_it_between_parts():
    one, two = lc.truss_parts((1, 1), 2), lc.truss_parts((2, 1), 1)
    inner = one.stiffness[0].toarray()
    at = 2 * int(np.flatnonzero((one.position[0] == [1, 0]).all(1))[0]) + 1
    up = 2 * int(np.flatnonzero((one.position[0] == [1, 1]).all(1))[0]) + 1
    assert inner[at, up] == pytest.approx(-5e4, rel=1e-14)
    joined = sum(L.T @ K @ L for L, K in zip(two.boolean, two.stiffness, strict=True)).toarray()
    at, up = (2 * int(np.flatnonzero((two.place == p).all(1))[0]) + 1 for p in ([1, 0], [1, 1]))
    assert joined[at, up] == pytest.approx(-1e5, rel=1e-14)


@pytest.mark.parametrize("parts", [lc.truss_parts((1, 1), 2), solid_parts((1, 1), 3)], ids=["truss", "plate"])
def test_zero_modes_of_a_stiff_part_are_its_rigid_ones(parts):
    (x,), (K,) = parts.position, parts.stiffness
    found = zero_modes(validated_symmetric(K, 0))
    S = np.linalg.qr(summation_operator(x))[0]
    assert found.shape == S.shape
    assert np.linalg.svd(S.T @ found)[1] == pytest.approx(1.0, rel=1e-12)
