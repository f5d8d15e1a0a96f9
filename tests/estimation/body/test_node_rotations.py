"""Matrices of nodes with rotations: a beam of eleven nodes, 66 x 66, as those of its places."""

from dataclasses import replace

import numpy as np
import pytest

from forceid.errors import DataError
from forceid.estimation.body.inertia import without_node_rotations
from forceid.files import recording_from_tree
from forceid.files.tree import tree_from_recording
from forceid.principal import mass_properties, objectivity
from forceid.records import Body, Motion, Recording

NODES, LENGTH = 11, 1.5
EA, EI, GJ, RHO = 4e5, (12.0, 30.0), 9.0, 0.8  # N, N m2, N m2, kg/m
GYRATION = 4e-4  # m2: polar inertia of the section over its area


def element(L):
    """Stiffness and consistent mass (12, 12) of a Bernoulli beam along x, node-major."""
    K, M = np.zeros((12, 12)), np.zeros((12, 12))
    bar, beam = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
    for i, k, m in ((0, EA / L, RHO * L), (3, GJ / L, RHO * L * GYRATION)):
        at = np.ix_([i, i + 6], [i, i + 6])
        K[at], M[at] = k * bar, m * beam
    bend = np.array(
        [[12, 6 * L, -12, 6 * L], [6 * L, 4 * L**2, -6 * L, 2 * L**2],
         [-12, -6 * L, 12, -6 * L], [6 * L, 2 * L**2, -6 * L, 4 * L**2]]
    )  # fmt: skip
    carry = np.array(
        [[156, 22 * L, 54, -13 * L], [22 * L, 4 * L**2, 13 * L, -3 * L**2],
         [54, 13 * L, 156, -22 * L], [-13 * L, -3 * L**2, -22 * L, 4 * L**2]]
    )  # fmt: skip
    for (v, turn, sign), stiff in zip(((1, 5, 1), (2, 4, -1)), EI, strict=True):
        at, s = np.ix_(*[[v, turn, v + 6, turn + 6]] * 2), np.array([1, sign, 1, sign])
        K[at], M[at] = stiff / L**3 * bend * np.outer(s, s), RHO * L / 420 * carry * np.outer(s, s)
    return K, M


def frame(shape):
    """Stiffness and mass (66, 66) of beams from node to node of a shape (11, 3)."""
    K, M = np.zeros((66, 66)), np.zeros((66, 66))
    for k in range(NODES - 1):
        along = shape[k + 1] - shape[k]
        L = np.linalg.norm(along)
        x = along / L
        y = np.cross([0.1, 0.2, 1.0], x)
        y /= np.linalg.norm(y)
        T = np.kron(np.eye(4), np.stack([x, y, np.cross(x, y)]))
        own = slice(6 * k, 6 * k + 12)
        for whole, part in zip((K, M), element(L), strict=True):
            whole[own, own] += T.T @ part @ T
    return K, M


def arch():
    """Eleven nodes of an arch that no plane holds."""
    s = np.linspace(-1, 1, NODES)
    return LENGTH / 2 * np.stack([s, 0.5 * (1 - s**2), 0.2 * s**3], 1)


def body(shape, **matrices):
    return Body(tuple(f"n{k}" for k in range(NODES)), shape, **matrices)


def test_the_places_carry_the_mass_of_every_rigid_motion():
    shape = arch()
    K, M = frame(shape)
    whole = mass_properties(M, shape)
    for known in ({"mass_matrix": M, "stiffness": K}, {"mass_matrix": M}):
        reduced = without_node_rotations(body(shape, **known))
        found = mass_properties(reduced.mass_matrix, shape)
        assert found.mass == pytest.approx(whole.mass, rel=1e-9)
        assert found.center == pytest.approx(whole.center, abs=1e-9)
        assert found.inertia == pytest.approx(whole.inertia, rel=1e-7, abs=1e-9)


def test_the_places_resist_no_rigid_motion_and_every_other():
    shape = arch()
    K, M = frame(shape)
    reduced = without_node_rotations(body(shape, mass_matrix=M, stiffness=K))
    assert reduced.stiffness.shape == (33, 33)
    assert not objectivity(reduced.stiffness, shape).reasons


def test_the_lowest_frequencies_are_those_of_the_whole_matrices():
    shape = arch()
    K, M = frame(shape)
    reduced = without_node_rotations(body(shape, mass_matrix=M, stiffness=K))
    both = [
        np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(m, k)).real)[6:10])
        for k, m in ((K, M), (reduced.stiffness, reduced.mass_matrix))
    ]
    assert both[1] == pytest.approx(both[0], rel=0.01)


def test_a_straight_beam_that_may_turn_about_itself_is_reduced_as_well():
    shape = np.stack([np.linspace(0, LENGTH, NODES), *np.zeros((2, NODES))], 1)
    K, M = frame(shape)
    reduced = without_node_rotations(body(shape, mass_matrix=M, stiffness=K))
    assert np.isfinite(reduced.stiffness).all()
    bent = np.zeros((NODES, 3))
    bent[:, 1] = (shape[:, 0] - LENGTH / 2) ** 2
    energy = 0.5 * bent.ravel() @ reduced.stiffness @ bent.ravel()
    # curvature 2 all along but near the free ends, where no moment acts
    assert 0.8 < energy / (0.5 * 4 * EI[0] * LENGTH) < 1.0


def test_a_file_holds_them_and_one_without_the_other_is_refused():
    shape = arch()
    K, M = frame(shape)
    still = Motion(np.arange(5) / 10, np.tile(shape, (5, 1, 1)))
    recording = Recording(body(shape, mass_matrix=M, stiffness=K), still)
    again = recording_from_tree(tree_from_recording(recording))
    assert again.body.mass_matrix.shape == (66, 66)
    mixed = replace(recording.body, stiffness=np.eye(33))
    with pytest.raises(DataError, match="has 33 rows where the mass matrix has 66"):
        without_node_rotations(mixed)
