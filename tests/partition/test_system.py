"""Bad input to a partitioned system: what is wrong, where, and what to do, in one sentence."""

import re

import lecture_cases as lc
import numpy as np
import pytest
import scipy.sparse as sp

from forceid.errors import ConfigError, DataError, EstimationError
from forceid.partition import PartitionedSystem, boolean_from_names
from forceid.principal.operator import summation_operator

PAIR = np.array([[1.0, -1.0], [-1.0, 1.0]])
HELD = PAIR + np.diag([0.0, 1.0])
UPPER = np.array([[0.0, 1.0], [0.0, 0.0]])
LINE = (np.eye(3)[:2], np.eye(3)[1:])


def build(stiffness=(PAIR, HELD), mass=None, boolean=LINE, modes=None):
    """Two springs in line, the second held: what is given replaces what is right."""
    return PartitionedSystem(stiffness, mass, boolean, modes)


def test_what_is_replaced_here_is_right_as_it_stands():
    assert build().solve([1.0, 0.0, 0.0]).u == pytest.approx([3.0, 2.0, 2.0, 1.0], rel=1e-14)


@pytest.mark.parametrize(
    ("replaced", "told"),
    [
        ({"stiffness": [PAIR]}, "boolean has 2 entries, expected 1, one a partition"),
        ({"boolean": [np.eye(2)]}, "boolean has 1 entries, expected 2"),
        ({"mass": [PAIR]}, "mass has 1 entries, expected 2"),
        ({"modes": [None]}, "rigid_modes has 1 entries, expected 2"),
        ({"stiffness": [PAIR[:1], HELD]}, r"stiffness of partition 0 has shape \(1, 2\), expected a square"),
        ({"stiffness": [PAIR, np.eye(3)]}, "Boolean matrix 1 has 2 rows, expected 3, as its stiffness"),
        ({"stiffness": [PAIR, HELD + 0.1 * UPPER]}, "partition 1 is not symmetric: .* 5.0e-02"),
        ({"stiffness": [PAIR * np.nan, HELD]}, "stiffness of partition 0 holds numbers that are not finite"),
        ({"stiffness": [PAIR, -np.eye(2)]}, "stiffness of partition 1 is not positive semidefinite"),
        ({"stiffness": [PAIR, [[1, 2], [2, 1]]]}, "stiffness of partition 1 is not positive semidefinite"),
        ({"mass": [PAIR + UPPER, HELD]}, "mass of partition 0 is not symmetric"),
        ({"mass": [np.eye(3), np.eye(2)]}, r"mass of partition 0 has shape \(3, 3\), expected \(2, 2\)"),
        ({"boolean": [np.eye(3)[:2], [[0, 1, 1], [0, 0, 1]]]}, "partition 1 has 2 ones in row 0"),
        ({"boolean": [np.eye(4)[:2], np.eye(4)[2:]]}, "share nothing: .* solve each piece by itself"),
        ({"modes": [[[1.0], [-1.0]], None]}, "rigid modes of partition 0 strain it: K R is 1.4e"),
        ({"modes": [np.ones((2, 2)), None]}, "rigid modes of partition 0 depend on each other"),
        ({"modes": [np.zeros((2, 1)), None]}, "rigid modes of partition 0 .* zero or not finite"),
        ({"modes": [[[np.nan], [1.0]], None]}, "rigid modes of partition 0 .* zero or not finite"),
        ({"modes": [np.ones((3, 1)), None]}, r"rigid modes of partition 0 have shape \(3, 1\)"),
        ({"modes": [np.ones((1, 2)), None]}, r"rigid modes of partition 0 have shape \(1, 2\)"),
    ],
)
def test_matrices_that_make_no_system_are_refused_by_partition(replaced, told):
    with pytest.raises(DataError, match=told):
        build(**replaced)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (HELD * 1j, "holds complex numbers, expected real numbers; give an array of float64"),
        ([["a", "b"], ["c", "d"]], "holds text, expected real numbers"),
        ([[1, None], [None, 1]], "holds objects, expected real numbers"),
        (None, "holds objects, expected real numbers"),
        ([[1, 2], [3]], "has rows of different lengths, expected an array; fill it"),
        ([1.0, 2.0], r"has shape \(2,\), expected 2 axes; give rows and columns"),
        (3.0, r"has shape \(\), expected 2 axes"),
    ],
)
@pytest.mark.parametrize("name", ["stiffness", "mass", "boolean"])
def test_what_is_no_matrix_of_real_numbers_is_told_by_partition(name, given, told):
    right = {"stiffness": PAIR, "mass": PAIR, "boolean": LINE[0]}[name]
    where = "Boolean matrix" if name == "boolean" else name
    with pytest.raises(DataError, match=f"^{where} of partition 1 {told}"):
        build(**{name: [right, given]})


def test_boolean_rows_with_two_ones_or_none_are_told_with_what_they_say():
    for row, ones in (([0, 1, 1], 2), ([0, 0, 0], 0)):
        with pytest.raises(DataError, match=f"has {ones} ones in row 0, expected exactly one; say of that"):
            build(boolean=[np.eye(3)[:2], [row, [0, 0, 1]]])


def test_negative_mass_is_refused():
    with pytest.raises(DataError, match="mass of partition 1 is -1 kg at degree of freedom 1, expected zero"):
        build(mass=[np.eye(2), np.diag([1.0, -1.0])])


def test_names_that_cannot_be_compared_and_axes_that_are_no_number_are_told():
    with pytest.raises(DataError, match=r"names hold \[0, 1\], expected text, numbers or tuples"):
        boolean_from_names([[[0, 1]]], 1)
    with pytest.raises(DataError, match=r"axes is 1.5, expected a whole number above zero"):
        boolean_from_names([["a"]], 1.5)


def test_asymmetry_of_rounding_size_is_none():
    K = HELD + 1e-12 * UPPER
    assert build([PAIR, K]).solve([1.0, 0.0, 0.0]).u == pytest.approx([3.0, 2.0, 2.0, 1.0], rel=1e-10)


@pytest.mark.parametrize(
    "none", [[], np.zeros((2, 0)), sp.csr_array((2, 0))], ids=["list", "dense", "sparse"]
)
def test_a_free_partition_said_to_have_no_rigid_mode_is_a_mechanism(none):
    assert build(modes=[None, none]).solve([1.0, 0.0, 0.0]).deficiency == 0
    with pytest.raises(DataError, match="partition 0 has more zero modes than the 0 given: a mechanism"):
        build(modes=[none, none]).solve([1.0, 0.0, 0.0])


def test_indefinite_stiffness_is_refused_where_its_modes_are_said_to_be_none():
    system = build([PAIR, [[1.0, 2.0], [2.0, 1.0]]], modes=[None, np.zeros((2, 0))])
    with pytest.raises(DataError, match="stiffness of partition 1"):
        system.solve([1.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "load", [np.zeros(2), np.zeros(5), np.zeros((3, 1)), [np.zeros(2), np.zeros(3)], 1.0]
)
def test_a_load_of_another_shape_is_refused_with_both_that_serve(load):
    with pytest.raises(DataError, match=r"load has shape .* expected \(3,\) assembled, or \(4,\) of all"):
        build().solve(load)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_load_that_is_not_finite_is_refused(value):
    for solve in (build().solve, build().solve_cg, build().start_vector):
        with pytest.raises(DataError, match="load holds numbers that are not finite"):
            solve([0.0, value, 0.0])


def test_a_load_on_a_floating_body_out_of_equilibrium_is_told_by_how_much_and_what_to_do():
    system, load = lc.free_plate()
    told = r"nothing holds 3 motions .* \(0.3, -0.8833, -0.9481\); balance it, hold the body, .* relief=True"
    for solve in (system.solve, system.solve_cg):
        with pytest.raises(EstimationError, match=told):
            solve(load)


def test_relief_without_mass_is_refused():
    system = build([PAIR, PAIR])
    with pytest.raises(DataError, match="mass is not given, and what accelerates needs it"):
        system.solve([1.0, 0.0, 0.0], relief=True)


def test_a_large_load_in_equilibrium_but_for_rounding_is_taken():
    place = lc.plane_stress((2, 2), 3).parts.place
    system, _ = lc.free_plate()
    load = np.zeros_like(place)
    load[np.isclose(place[:, 0], 2)], load[np.isclose(place[:, 0], 0)] = [1e9 / 3, 0], [-1e9 / 3, 0]
    assert not system.solve(load.ravel() * (1 + 1e-15 * np.arange(load.size))).acceleration.any()


@pytest.mark.parametrize(
    ("option", "told"),
    [
        ({"preconditioner": "jacobi"}, "unknown preconditioner 'jacobi'; one of none, lumped, dirichlet"),
        ({"weights": "stifness"}, "unknown weights 'stifness'; one of multiplicity, stiffness"),
    ],
)
def test_options_that_do_not_exist_are_refused_with_those_that_do(option, told):
    with pytest.raises(ConfigError, match=told):
        build().solve_cg([1.0, 0.0, 0.0], **option)


def test_partition_of_no_stiffness_moves_freely_and_is_told():
    system = build([np.zeros((2, 2)), HELD])
    assert system.solve([0.0, 0.0, 1.0]).deficiency == 1
    with pytest.raises(EstimationError, match=r"adds up to \(-?1\)"):
        system.solve([1.0, 0.0, 0.0])


def test_partition_of_no_stiffness_may_have_its_modes_given():
    system = build([sp.csr_array((2, 2)), HELD], modes=[np.eye(2), None])
    assert system.solve([0.0, 0.0, 1.0]).u == pytest.approx([0.0, 1.0, 1.0, 1.0], abs=1e-14)


def floating():
    """Two springs in line that nothing holds, pulled at one end."""
    return build([PAIR, PAIR]).solve([1.0, 0.0, 0.0])


def hinged_square():
    """A square of four hinged bars said to be rigid, braced by another part."""
    S = summation_operator(lc.SQUARE)
    parts = [lc.bars(lc.EDGES), lc.bars(lc.EDGES + lc.DIAGONALS)]
    return PartitionedSystem(parts, None, [np.eye(8)] * 2, [S, S]).solve(np.zeros(8))


@pytest.mark.parametrize(
    ("ask", "error", "found", "step"),
    [
        (
            lambda: build([PAIR, HELD + UPPER]),
            DataError,
            "entries differ by 5.0e-01 of the largest",
            "average",
        ),
        (hinged_square, DataError, "more zero modes than the 3 given: a mechanism", "stiffen it, or leave"),
        (lambda: build(boolean=[np.eye(3)[[0, 0]], np.eye(3)[1:]]), DataError, "0 twice", "once at most"),
        (
            lambda: build(boolean=[np.eye(4)[:2], np.eye(4)[2:]]),
            DataError,
            "2 pieces",
            "each piece by itself",
        ),
        (lambda: build(boolean=[np.eye(4)[:2], np.eye(4)[1:3]]), DataError, "the first 3", "drop their col"),
        (floating, EstimationError, "nothing holds 1 motions", "relief=True"),
    ],
    ids=["asymmetry", "mechanism", "repeated", "apart", "unused", "floating"],
)
def test_a_refusal_is_one_line_with_what_was_found_and_the_next_step(ask, error, found, step):
    with pytest.raises(error) as caught:
        ask()
    assert found in caught.value.what
    assert step in caught.value.next_step
    assert "\n" not in str(caught.value)


def test_loads_are_told_to_be_out_of_balance_by_their_resultant_about_the_point_of_the_modes():
    system, load = lc.free_plate()
    place = lc.plane_stress((2, 2), 3).parts.place
    out = summation_operator(place, place.mean(axis=0)).T @ load
    with pytest.raises(EstimationError, match=re.escape("(" + ", ".join(f"{v:.4g}" for v in out) + ")")):
        system.solve(load)


def test_every_way_out_that_is_offered_to_a_floating_body_works():
    case = lc.plane_stress((2, 2), 3)
    system, load = lc.free_plate()
    S = summation_operator(case.parts.place)
    balanced = load - S @ np.linalg.lstsq(S, load, rcond=None)[0]
    relieved = system.solve(load, relief=True)
    assert relieved.acceleration == pytest.approx([0.375, -1.10416667, -1.77777778], rel=1e-8)
    assert not system.solve(balanced).acceleration.any()
    assert case.system.solve(case.force).deficiency == 0


def test_pieces_that_share_nothing_are_named_by_their_partitions_and_solve_by_themselves():
    names = [["a", "b"], ["b", "c"], ["d", "e"], ["e", "f"], ["g", "h"]]
    with pytest.raises(DataError, match=r"fall into 3 pieces that share nothing: \[0, 1\], \[2, 3\], \[4\]"):
        PartitionedSystem([PAIR] * 5, None, boolean_from_names(names, 1))
    piece = PartitionedSystem([PAIR] * 2, None, boolean_from_names(names[2:4], 1))
    assert piece.solve([-1.0, 0.0, 1.0]).u == pytest.approx([-1, 0, 0, 1], abs=1e-12)
