"""Boolean matrices: what they assemble, what they share, and how names, positions and supports make them."""

import itertools

import lecture_cases as lc
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from forceid.errors import DataError
from forceid.partition import boolean_from_names, boolean_from_positions, topology
from forceid.partition.grids import solid_parts
from forceid.partition.operators.topology import compatible, without_fixed
from forceid.principal.operator import summation_operator


@st.composite
def cut_chain(draw):
    """Names of nodes of partitions along a chain, each of which starts where the last one ended."""
    lengths = draw(st.lists(st.integers(1, 4), min_size=2, max_size=5))
    ends = np.cumsum([0, *lengths])
    parts = [np.arange(a, b + 1) for a, b in itertools.pairwise(ends)]
    return [draw(st.permutations(part.tolist())) for part in parts]


@settings(deadline=None, derandomize=True, max_examples=40)
@given(cut_chain(), st.integers(1, 3))
def test_every_degree_of_freedom_of_a_partition_is_one_of_the_body(names, axes):
    top = topology(boolean_from_names(names, axes))
    L = top.L.toarray()
    assert (L.sum(1) == 1).all()
    assert L.sum() == sum(map(len, names)) * axes
    for d in top.dofs:
        assert L[d].sum(0).max() == 1
    assert np.array_equal(top.count, L.sum(0))
    assert len(top.interface) == axes * (len(names) - 1)


@settings(deadline=None, derandomize=True, max_examples=40)
@given(cut_chain(), st.integers(1, 3))
def test_interface_matrices_say_the_same_as_the_assembly(names, axes):
    top = topology(boolean_from_names(names, axes))
    assert np.array_equal((top.B.T @ top.L).toarray()[:, top.interface], top.L_f.toarray())
    multiplicity = (top.L_f.T @ top.L_f).toarray()
    assert np.array_equal(multiplicity, np.diag(top.count[top.interface]))


def test_dense_and_sparse_boolean_matrices_are_the_same():
    L = boolean_from_names([["a", "b"], ["b", "c"]], 2)
    dense, sparse = topology([x.toarray() for x in L]), topology(L)
    assert np.array_equal(dense.L.toarray(), sparse.L.toarray())
    assert np.array_equal(dense.L_f.toarray(), sparse.L_f.toarray())


def test_four_plates_meet_in_one_node_with_four_multipliers_an_axis():
    top = topology(solid_parts((2, 2), 2).boolean)
    place = solid_parts((2, 2), 2).place
    middle = int(np.flatnonzero((place == 1).all(1))[0])
    assert top.count[2 * middle] == 4
    assert sorted(np.unique(top.count[top.interface])) == [2, 4]


@pytest.mark.parametrize("name", lc.PRINTED)
def test_numbers_of_multipliers_modes_and_interface_motions_are_the_printed_ones(name):
    system, _, _ = lc.solved(name)
    top = system.topology
    assert (len(top.frame), system.R_b.shape[1], len(top.interface)) == lc.PRINTED[name].sizes


def test_equal_shares_add_up_to_the_assembled_load():
    system, force, _ = lc.solved("plane_stress_16")
    top = system.topology
    shares = top.shared(force)
    assert np.abs(top.assembled(shares) - force).max() <= 4 * np.finfo(float).eps * np.abs(force).max()
    L = top.L.toarray()
    assert shares == pytest.approx(L @ np.linalg.solve(L.T @ L, force), rel=1e-13, abs=1e-16)


def test_names_make_the_nodes_in_the_order_in_which_they_come():
    L = boolean_from_names([["tip", 3], [3, ("a", 1)]], axes=2)
    assert np.array_equal(L[0].toarray(), np.eye(6)[:4])
    assert np.array_equal(L[1].toarray(), np.eye(6)[2:])


def test_positions_make_the_same_body_as_names():
    places = [np.array([[0.0, 0], [1, 0]]), np.array([[1.0, 1e-9], [2, 0]])]
    by_place = boolean_from_positions(places, 1e-6)
    by_name = boolean_from_names([["a", "b"], ["b", "c"]], axes=2)
    assert [x.toarray().tolist() for x in by_place] == [x.toarray().tolist() for x in by_name]


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.floats(-10, 10), st.floats(-0.9, 0.9))
def test_nodes_within_the_tolerance_are_one_wherever_they_lie(place, off):
    tolerance = 1e-3
    x = [np.array([[place - 1.0], [place]]), np.array([[place + off * tolerance], [place + 1.0]])]
    assert topology(boolean_from_positions(x, tolerance)).interface.tolist() == [1]


def test_nodes_at_half_a_tolerance_are_one_in_spite_of_rounding():
    x = [np.array([[0.0], [0.0115]]), np.array([[0.0115 - 1e-15], [0.03]])]
    assert topology(boolean_from_positions(x, 1e-3)).interface.tolist() == [1]


def test_nodes_farther_apart_than_the_tolerance_stay_two():
    x = [np.array([[0.0], [1.0]]), np.array([[1.0021], [2.0]])]
    with pytest.raises(DataError, match="fall into 2 pieces"):
        topology(boolean_from_positions(x, 1e-3))


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan])
def test_a_tolerance_that_is_no_distance_is_refused(tolerance):
    with pytest.raises(DataError, match="tolerance"):
        boolean_from_positions([np.zeros((1, 2))], tolerance)


def test_held_degrees_of_freedom_are_gone_from_the_body_and_from_its_partitions():
    cut, kept = without_fixed(boolean_from_names([["a", "b"], ["b", "c"]], axes=1), np.array([0]))
    assert [k.tolist() for k in kept] == [[1], [0, 1]]
    assert [L.toarray().tolist() for L in cut] == [[[1, 0]], [[1, 0], [0, 1]]]


def test_a_partition_pinned_at_one_node_keeps_its_turn_about_the_pin():
    x = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    (mode,) = compatible(summation_operator(x, x.mean(0)), np.arange(2, 6)).T
    turn = np.array([0.0, 2.0, -1.0, 2.0])
    assert abs(mode @ turn) == pytest.approx(np.linalg.norm(mode) * np.linalg.norm(turn), rel=1e-14)


def test_a_partition_held_at_two_nodes_keeps_no_rigid_mode():
    x = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    assert compatible(summation_operator(x), np.array([4, 5])).shape == (2, 0)


def test_a_partition_that_nothing_holds_keeps_its_rigid_modes_as_they_are():
    S = summation_operator(np.array([[0.0, 0.0], [2.0, 0.0]]))
    assert np.array_equal(compatible(S, np.arange(4)), S)


def boolean(*rows, size=3):
    return np.eye(size)[list(rows)]


@pytest.mark.parametrize(
    ("matrices", "told"),
    [
        ([np.array([[1.0, 1, 0], [0, 0, 1]]), boolean(0, 1)], "partition 0 has 2 ones in row 0"),
        ([boolean(0, 1), np.array([[0.0, 1, 0], [0, 0, 0]])], "partition 1 has 0 ones in row 1"),
        ([boolean(0, 1), 0.5 * boolean(1, 2)], "partition 1 holds numbers other than 0 and 1"),
        ([boolean(0, 1), np.nan * boolean(1, 2)], "partition 1 holds numbers other than 0 and 1"),
        ([boolean(0, 0), boolean(1, 2)], "partition 0 uses the assembled degree of freedom 0 twice"),
        ([boolean(0, 1), boolean(1, 2, size=4)], r"have \[3, 4\] columns"),
        ([boolean(0, 1), boolean(1, 0)], "leave 1 assembled degrees of freedom unused, the first 2"),
        ([boolean(0, 1), boolean(2)], r"fall into 2 pieces that share nothing: \[0\], \[1\]"),
        ([boolean(0, 1, 2), np.zeros((0, 3))], "partition 1 has no row"),
        ([], "expected one number for all"),
    ],
)
def test_matrices_that_are_not_boolean_assemblies_are_refused_by_name(matrices, told):
    with pytest.raises(DataError, match=told):
        topology([sp.csr_array(m) for m in matrices])
