"""Bad input to a partitioned system: what is wrong, where, and what to do, in one sentence."""

import lecture_cases as lc
import numpy as np
import pytest
import scipy.sparse as sp

from forceid.errors import ConfigError, DataError, EstimationError
from forceid.partition import PartitionedSystem

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
    with pytest.raises(DataError, match="mass is not given, and inertia relief needs it"):
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
