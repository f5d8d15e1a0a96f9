import itertools

import numpy as np
import pytest
import scipy.sparse
from principal_bodies import (
    BARS,
    BOOMERANG,
    TRUSS,
    assemble,
    bar_stiffness,
    boomerang_stiffness,
    truss_stiffness,
)
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.principal.change_of_frame import DENSE_DOF, objectivity


def test_two_spring_boomerang_has_a_hinge_mechanism_and_the_hinge_spring_cures_it():
    loose = objectivity(boomerang_stiffness(), BOOMERANG)
    assert (loose.nullity, loose.rigid, loose.mechanisms) == (4, 3, 1)
    assert loose.residual <= 1e-12
    assert "lets 1 motion beyond the 3 rigid ones go free (a mechanism)" in loose.reasons[0]
    assert "add a spring" in loose.reasons[0]
    sound = objectivity(boomerang_stiffness(40.0), BOOMERANG)
    assert (sound.nullity, sound.mechanisms, sound.reasons) == (3, 0, ())


@pytest.mark.parametrize("kind", [np.asarray, scipy.sparse.csc_array])
def test_truss_lets_exactly_the_six_rigid_motions_go(kind):
    check = objectivity(kind(truss_stiffness()), TRUSS)
    assert (check.nullity, check.rigid, check.mechanisms, check.reasons) == (6, 6, 0, ())
    assert check.residual <= 1e-12


def test_verdict_stands_wherever_the_body_is_and_however_it_is_turned():
    R = Rotation.from_rotvec([0.7, -1.1, 2.0]).as_matrix()
    x = TRUSS @ R.T
    check = objectivity(truss_stiffness(x), x + np.array([1e4, -2e4, 3e3]))
    assert (check.nullity, check.mechanisms) == (6, 0)
    assert check.residual <= 1e-11  # coordinates themselves keep 12 digits of the shape there


def test_a_missing_bar_is_a_mechanism_and_a_stiffness_contrast_is_not():
    assert objectivity(assemble(TRUSS, BARS[:-2], bar_stiffness, 3), TRUSS).mechanisms == 1
    K = truss_stiffness() + 1e6 * assemble(TRUSS, BARS[:4], bar_stiffness, 3)
    check = objectivity(K, TRUSS)
    assert (check.nullity, check.mechanisms) == (6, 0)


def test_stiffness_of_another_shape_resists_rotation_and_says_so():
    moved = TRUSS.copy()
    moved[4, 0] += 0.05
    check = objectivity(truss_stiffness(), moved)
    assert check.residual > 1e-3
    assert "resists rigid motion" in check.reasons[0]


def test_held_body_keeps_no_rigid_motion_and_shows_no_mechanism():
    K = truss_stiffness() + np.diag(np.r_[np.full(9, 1e7), np.zeros(18)])
    check = objectivity(K, TRUSS)
    assert (check.nullity, check.rigid, check.mechanisms) == (0, 0, 0)
    assert "the body is held" in check.reasons[0]


def beam(length, EI, EA):
    K = np.zeros((6, 6))
    K[np.ix_([0, 3], [0, 3])] = EA / length * np.array([[1, -1], [-1, 1]])
    q = length
    K[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = (
        EI
        / q**3
        * np.array(
            [
                [12, 6 * q, -12, 6 * q],
                [6 * q, 4 * q * q, -6 * q, 2 * q * q],
                [-12, -6 * q, 12, -6 * q],
                [6 * q, 2 * q * q, -6 * q, 4 * q * q],
            ]
        )
    )
    return K


@pytest.mark.parametrize("length", [1e-3, 1.0, 1e3])
def test_free_beam_with_nodal_rotations_is_sound_in_any_unit_of_length(length):
    n = 41
    x = np.c_[np.linspace(0, length, n), np.zeros(n)]
    K = assemble(
        x, zip(range(n - 1), range(1, n), strict=True), lambda d: beam(d[0], 2.0, 3e4 / length**2), 3
    )
    check = objectivity(K, x, rotations=True)
    assert (check.nullity, check.rigid, check.mechanisms, check.reasons) == (3, 3, 0, ())


def lattice(*size):
    """Cubic lattice: its nodes, and its bars along edges and face diagonals."""
    grid = np.array(list(itertools.product(*map(range, size))), dtype=float)
    number = {tuple(g): k for k, g in enumerate(grid.astype(int))}
    steps = [s for s in itertools.product((-1, 0, 1), repeat=3) if s > (0, 0, 0) and sum(map(abs, s)) < 3]
    pairs = [
        (k, number[tuple(g + s)])
        for g, k in number.items()
        for s in np.array(steps)
        if tuple(g + s) in number
    ]
    return grid, pairs


def test_large_sparse_stiffness_gives_the_same_answer_without_becoming_dense():
    grid, pairs = lattice(112, 3, 3)
    loose = len(grid)  # one more node, on one bar: it may swing two ways
    x = np.vstack([grid, [0.0, 0.0, -1.0]])
    i, j = np.array([*pairs, (0, loose)]).T
    n = (x[j] - x[i]) / np.linalg.norm(x[j] - x[i], axis=1)[:, None]
    rows = np.repeat(np.arange(len(i)), 6)
    columns = np.c_[3 * i, 3 * i + 1, 3 * i + 2, 3 * j, 3 * j + 1, 3 * j + 2].ravel()
    strain = scipy.sparse.coo_array((np.c_[-n, n].ravel(), (rows, columns)), shape=(len(i), x.size)).tocsr()
    assert x.size > DENSE_DOF
    check = objectivity(1e6 * (strain.T @ strain), x)
    assert (check.nullity, check.rigid, check.mechanisms) == (8, 6, 2)
    assert f"node {loose}, counted from 0, moves most" in check.reasons[0]
    # the slender body bends at 1e-6 of its stiffness, which must not pass for free
    sound = objectivity(1e6 * (strain[:-1].T @ strain[:-1])[: grid.size, : grid.size], grid)
    assert (sound.nullity, sound.mechanisms, sound.reasons) == (6, 0, ())


def test_stiffness_of_the_wrong_size_is_refused():
    with pytest.raises(DataError, match=r"stiffness has shape \(6, 6\), expected \(27, 27\)"):
        objectivity(np.eye(6), TRUSS)
