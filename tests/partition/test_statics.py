"""Bodies in parts at rest: printed values, assembled solutions, balance, gauges, supports, mechanisms."""

from functools import cache

import lecture_cases as lc
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag

from forceid.errors import DataError, EstimationError
from forceid.partition import PartitionedSystem
from forceid.partition.grids import assemble_elements, box_element, solid_parts
from forceid.partition.operators.inverse import validated_symmetric, zero_modes
from forceid.partition.saddle import deficiency, four_field, reduced_matrix
from forceid.partition.statics import relieved
from forceid.principal.operator import summation_operator

NAMES = list(lc.PRINTED)
EPS = np.finfo(float).eps
CONDITION = 1e3  # of the stiffness of a plate of a few elements, an order of magnitude above the true one


@pytest.mark.parametrize("name", NAMES)
def test_multipliers_interface_motion_and_energy_are_the_printed_ones(name):
    system, force, found = lc.solved(name)
    printed = lc.PRINTED[name]
    assert np.linalg.norm(found.lam) == pytest.approx(printed.lam, rel=1e-8)
    assert np.linalg.norm(system.start_vector(force)) == pytest.approx(printed.start, rel=1e-8)
    assert np.linalg.norm(found.u_f) == pytest.approx(printed.u_f, rel=1e-8)
    assert found.energy == pytest.approx(printed.energy, rel=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_direct_solution_is_that_of_the_assembled_stiffness(name):
    system, force, found = lc.solved(name)
    u = lc.assembled(system, force)
    assert lc.largest(found.u, system.topology.L @ u) < 1e-11
    assert lc.largest(found.u_f, u[system.topology.interface]) < 1e-11
    assert found.energy == pytest.approx(0.5 * force @ u, rel=1e-11)


@pytest.mark.parametrize("name", NAMES)
def test_every_partition_and_every_interface_node_is_in_balance(name):
    system, force, found = lc.solved(name)
    assert lc.imbalance(system, force, found.lam) < 1e-12


@pytest.mark.parametrize("name", NAMES)
def test_what_holds_a_partition_is_its_load_less_its_multipliers(name):
    system, force, found = lc.solved(name)
    f = system.loads(force)
    held = block_diag(*[K.toarray() for K in system.stiffness]) @ found.u
    assert np.abs(held - (f - system.topology.B @ found.lam)).max() < 1e-12 * np.linalg.norm(f)


@pytest.mark.parametrize("name", ["plane_stress_4", "truss_4", "solid_2"])
def test_held_body_leaves_nothing_open_in_either_saddle_point_system(name):
    system, _, found = lc.solved(name)
    assert (deficiency(four_field(system)), deficiency(reduced_matrix(system)), found.deficiency) == (0, 0, 0)


@pytest.mark.parametrize(
    ("case", "open_motions"),
    [(lc.plane_stress((2, 2), 2), 3), (lc.truss((2, 1), 2), 3), (lc.solid((2, 1, 1), 2), 6)],
    ids=["plate", "truss", "solid"],
)
def test_floating_body_leaves_its_rigid_motions_open_in_both_saddle_point_systems(case, open_motions):
    system = case.parts.system()
    assert deficiency(four_field(system)) == deficiency(reduced_matrix(system)) == open_motions
    assert system.solve(case.load.ravel(), relief=True).deficiency == open_motions


def test_floating_plate_accelerates_as_printed():
    system, load = lc.free_plate()
    found = system.solve(load, relief=True)
    resultant = system.whole().T @ system.loads(load)
    assert resultant == pytest.approx([0.3, -0.883333333, -0.948148148], abs=1e-9)
    mass, inertia = 0.8, 0.8 * 8 / 12  # two meters by two, a tenth thick, two kg/m3
    assert found.acceleration == pytest.approx(resultant / [mass, mass, inertia], rel=1e-12)
    assert found.acceleration == pytest.approx([0.375, -1.10416667, -1.77777778], abs=1e-8)
    assert np.linalg.norm(found.lam) == pytest.approx(0.34967974, abs=1e-8)


def test_floating_plate_is_in_balance_with_its_inertia_and_does_not_move_as_a_whole():
    system, load = lc.free_plate()
    found = system.solve(load, relief=True)
    f, _ = relieved(system, system.loads(load), relief=True)
    S = system.whole()
    assert np.abs(S.T @ f).max() < 1e-12
    assert np.abs(S.T @ found.u).max() < 1e-12 * np.abs(found.u).max() * len(S)
    assert np.abs(system.resultant(f - system.topology.B @ found.lam)).max() < 1e-12


def test_floating_plate_in_equilibrium_needs_no_relief():
    system, _ = lc.free_plate()
    place = lc.plane_stress((2, 2), 3).parts.place
    pull = np.zeros_like(place)
    pull[:, 0] = np.isclose(place[:, 0], 2) * 1.0 - np.isclose(place[:, 0], 0)
    pull = pull.ravel()
    found = system.solve(pull)
    assert found.acceleration.tolist() == [0, 0, 0]
    assert lc.largest(found.lam, system.solve(pull, relief=True).lam) < 1e-14


@pytest.mark.parametrize("relief", [False, True])
def test_load_split_otherwise_moves_the_multipliers_by_the_split_and_nothing_else(relief):
    system, force = lc.free_plate() if relief else lc.solved("plane_stress_16")[:2]
    f, top = system.loads(force), system.topology
    other = system.projection.balanced(np.random.default_rng(3).standard_normal(len(top.frame)))
    found, split = (system.solve(x, relief=relief) for x in (f, f + top.B @ other))
    assert lc.largest(split.lam - found.lam, other) < 1e-12
    assert lc.largest(split.u, found.u) < 1e-11
    assert lc.largest(split.u_f, found.u_f) < 1e-11


def test_loads_given_by_partition_are_the_same_as_in_one_array():
    system, force, found = lc.solved("truss_4")
    f = system.loads(force)
    assert np.array_equal(system.solve([f[d] for d in system.topology.dofs]).lam, found.lam)


@pytest.mark.parametrize("name", ["plane_stress_4", "truss_4", "solid_8"])
def test_rigid_part_of_the_motion_is_what_the_pseudoinverse_leaves(name):
    system, force, found = lc.solved(name)
    u = found.u - system.modes @ found.alpha
    assert np.abs(system.modes.T @ u).max() < 1e-11 * np.abs(found.u).max()
    f = system.loads(force) - system.topology.B @ found.lam
    for K, d in zip(system.stiffness, system.topology.dofs, strict=True):
        assert lc.largest(u[d], np.linalg.pinv(K.toarray(), rcond=1e-10, hermitian=True) @ f[d]) < 1e-10


def test_multipliers_are_those_of_the_pseudoinverse():
    system, force, found = lc.solved("plane_stress_4")
    top, f = system.topology, system.loads(force)
    plus = block_diag(*[np.linalg.pinv(K.toarray(), rcond=1e-10, hermitian=True) for K in system.stiffness])
    B, R_b, L_f = top.B.toarray(), system.R_b, top.L_f.toarray()
    a, m = R_b.shape[1], L_f.shape[1]
    A = np.block([[B.T @ plus @ B, -R_b, L_f], [-R_b.T, np.zeros((a, a + m))], [L_f.T, np.zeros((m, a + m))]])
    x = np.linalg.solve(A, np.concatenate([B.T @ plus @ f, -system.modes.T @ f, np.zeros(m)]))
    n = len(B.T)
    assert lc.largest(found.lam, x[:n]) < 1e-10
    assert lc.largest(found.alpha, x[n : n + a]) < 1e-10


def test_multipliers_do_not_depend_on_which_degrees_of_freedom_fix_a_partition():
    system, force, found = lc.solved("plane_stress_4")
    rng = np.random.default_rng(4)
    mixed = [
        R @ rng.standard_normal((R.shape[1], R.shape[1])) * [1, 1, 50][: R.shape[1]]
        for R in system.rigid_modes
    ]
    other = PartitionedSystem(system.stiffness, None, system.boolean, mixed)
    (_, plate), (_, same) = (s.factored[0] for s in (system, other))
    assert not np.array_equal(plate.free, same.free)
    again = other.solve(force)
    assert lc.largest(again.lam, found.lam) < 1e-11
    assert lc.largest(again.u, found.u) < 1e-11


def test_multipliers_do_not_depend_on_the_order_of_degrees_of_freedom():
    system, force, found = lc.solved("truss_4")
    rng = np.random.default_rng(5)
    order = [rng.permutation(K.shape[0]) for K in system.stiffness]
    K = [k[p][:, p] for k, p in zip(system.stiffness, order, strict=True)]
    L, R = ([x[p] for x, p in zip(of, order, strict=True)] for of in (system.boolean, system.rigid_modes))
    again = PartitionedSystem(K, None, L, R).solve(force)
    for d, rows, b, p in zip(
        system.topology.dofs, system.topology.rows, system.topology.boundary, order, strict=True
    ):
        assert lc.largest(again.u[d], found.u[d][p]) < 1e-11
        at = np.full(len(p), -1)
        at[b] = np.arange(len(b))
        assert (
            np.abs(again.lam[rows] - found.lam[rows][at[p][at[p] >= 0]]).max()
            < 1e-11 * np.abs(found.lam).max()
        )


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_units_of_stiffness_and_of_rigid_modes_change_no_force(unit):
    system, force, found = lc.solved("truss_4")
    K = [unit * k for k in system.stiffness]
    R = [r * np.array([1.0, 1.0, 1e6])[: r.shape[1]] for r in system.rigid_modes]
    again = PartitionedSystem(K, None, system.boolean, R).solve(force)
    assert lc.largest(again.lam, found.lam) < 1e-11
    assert lc.largest(unit * again.u, found.u) < 1e-11


@settings(deadline=None, derandomize=True, max_examples=40)
@given(
    st.lists(st.tuples(st.floats(0.1, 10), st.floats(-5, 5)), min_size=2, max_size=8),
)
def test_chain_of_springs_stretches_by_what_each_carries(chain):
    stiffness, load = np.array(chain).T
    carried = np.cumsum(load[::-1])[::-1]
    end = np.cumsum(carried / stiffness)
    system = lc.springs(stiffness)
    share = load / system.topology.count
    lam = [share[0] - carried[0]]
    for s in range(1, len(chain)):
        lam += [share[s - 1] + carried[s], share[s] - carried[s]][: 2 if s < len(chain) - 1 else 1]
    found = system.solve(load)
    size = np.abs(load).max() + 1e-300
    assert np.abs(found.lam - lam).max() < 1e-12 * size
    assert np.abs(found.u_f - end[:-1]).max() < 1e-11 * size
    assert np.abs(system.topology.L @ end - found.u).max() < 1e-11 * size


@cache
def jumping(kind, jump):
    """Plates some of which are stiffer by the factor, and how they move when assembled."""
    at = np.array([(i, j) for i in range(4) for j in range(2)])
    stiffer = at[:, 0] % 2 if kind == "strips" else at.sum(1) % 2
    case = lc.plane_stress((4, 2), 4, np.where(stiffer, 1000 * jump, 1000.0))
    system = case.system
    return system, case.force, system.topology.L @ lc.assembled(system, case.force)


def strained(system, u):
    """sqrt of twice the energy of displacements (dof,)."""
    parts = zip(system.stiffness, system.topology.dofs, strict=True)
    return np.sqrt(sum(u[d] @ (K @ u[d]) for K, d in parts))


@pytest.mark.parametrize("jump", [1.0, 1e2, 1e4, 1e6])
@pytest.mark.parametrize("kind", ["strips", "checkerboard"])
def test_jump_of_stiffness_leaves_the_solution_that_of_the_assembled_body(kind, jump):
    # rounding of the stiff parts is as large as so much of the soft ones
    system, force, u = jumping(kind, jump)
    found = system.solve(force)
    assert strained(system, found.u - u) < CONDITION * EPS * jump * strained(system, u)
    assert lc.imbalance(system, force, found.lam) < 1e-12


@pytest.mark.parametrize("jump", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("kind", ["strips", "checkerboard"])
def test_weights_by_stiffness_keep_the_steps_where_stiffness_jumps(kind, jump):
    for name in ("lumped", "dirichlet"):
        plain = jumping(kind, 1.0)
        steps = plain[0].solve_cg(plain[1], name, "stiffness").iterations.count
        system, force, u = jumping(kind, jump)
        found = system.solve_cg(force, name, "stiffness")
        assert found.iterations.count <= 2 * steps
        error = strained(system, found.u - u)
        assert error < max(1e-8, CONDITION * EPS * jump) * strained(system, u)
        assert lc.imbalance(system, force, found.lam) < 1e-12


def test_weights_by_multiplicity_lose_steps_where_stiffness_jumps():
    system, force, _ = jumping("strips", 1e4)
    by_count, by_stiffness = (
        system.solve_cg(force, weights=w).iterations.count for w in ("multiplicity", "stiffness")
    )
    assert by_count > 4 * by_stiffness


def test_fixed_partitions_have_no_rigid_modes():
    system, _, _ = lc.solved("plane_stress_4")
    assert [R.shape[1] for R in system.rigid_modes] == [0, 0, 3, 3]


@pytest.mark.parametrize("given", [True, False])
def test_partitions_pinned_at_one_node_keep_one_turn(given):
    case = lc.plane_stress((2, 2), 3)
    place = case.parts.place
    pinned = np.isclose(place[:, 1], 0) & (np.isclose(place[:, 0], 0) | np.isclose(place[:, 0], 2))
    system = case.parts.system(pinned)
    if not given:
        system = PartitionedSystem(system.stiffness, None, system.boolean, None)
    force = case.load[~pinned].ravel()
    found = system.solve(force)
    assert [R.shape[1] for R in system.rigid_modes] == [1, 3, 1, 3]
    assert found.deficiency == 0
    assert lc.largest(found.u, system.topology.L @ lc.assembled(system, force)) < 1e-11
    assert lc.imbalance(system, force, found.lam) < 1e-12


def test_body_pinned_at_one_node_carries_what_does_not_turn_it():
    case = lc.plane_stress((2, 2), 3)
    place = case.parts.place
    pinned = (place == 0).all(1)
    system, tip = case.parts.system(pinned), (place == 2).all(1)
    pull, turn = (np.where(tip[:, None], way, 0.0)[~pinned].ravel() for way in ([1.0, 1.0], [1.0, -1.0]))
    found = system.solve(pull)
    assert found.deficiency == 1
    assert lc.imbalance(system, pull, found.lam) < 1e-12
    with pytest.raises(EstimationError, match="nothing holds 1 motions"):
        system.solve(turn)


def braced(angle, modes=None):
    """A square of four hinged bars and its two diagonals, each a partition, held at two corners."""
    x, L = lc.turned(angle), np.eye(8)[4:, 4:]
    K = [lc.bars(pairs, x)[4:][:, 4:] for pairs in (lc.EDGES, lc.DIAGONALS)]
    return PartitionedSystem(K, None, [L, L], modes)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.1, 2.9])
def test_hinged_square_is_carried_with_its_mechanism_by_the_diagonals(angle):
    system = braced(angle)
    assert [R.shape[1] for R in system.rigid_modes] == [1, 2]
    force = np.random.default_rng(6).standard_normal(4)
    found = system.solve(force)
    assert found.deficiency == 0
    assert lc.largest(found.u, system.topology.L @ lc.assembled(system, force)) < 1e-11
    assert lc.imbalance(system, force, found.lam) < 1e-12
    assert lc.largest(system.solve_cg(force).lam, found.lam) < 1e-8


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.1, 2.9])
def test_hinged_square_has_four_zero_modes_and_a_braced_one_three(angle):
    x = lc.turned(angle)
    for pairs, modes in ((lc.EDGES, 4), (lc.EDGES + lc.DIAGONALS, 3)):
        assert zero_modes(validated_symmetric(lc.bars(pairs, x), 0)).shape == (8, modes)


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.floats(-4, 4))
def test_hinged_square_said_to_be_rigid_is_refused_as_a_mechanism(angle):
    x = lc.turned(angle)
    K = [lc.bars(pairs, x) for pairs in (lc.EDGES, lc.DIAGONALS)]
    system = PartitionedSystem(K, None, [np.eye(8)] * 2, [summation_operator(x, x.mean(0)), None])
    with pytest.raises(DataError, match=r"partition 0 has more zero modes than the 3 given: a mechanism"):
        system.solve(np.zeros(8))


def dangling(load):
    """A braced square held at two corners, and two bars in line between the others, free at their hinge."""
    x = np.array([[1.0, 0.0], [1.0, 0.5], [1.0, 1.0]])
    K = [lc.bars(lc.EDGES + lc.DIAGONALS)[4:][:, 4:], lc.bars([(0, 1), (1, 2)], x)]
    L = [np.eye(6)[:4], np.eye(6)[[0, 1, 4, 5, 2, 3]]]
    return PartitionedSystem(K, None, L, None), np.array([0, 0, 0, 0, *load])


def test_mechanism_inside_a_partition_is_counted_and_carries_what_does_not_move_it():
    system, force = dangling([0.0, 1.0])
    found = system.solve(force)
    assert found.deficiency == 1
    assert lc.imbalance(system, force, found.lam) < 1e-12
    assert found.energy == pytest.approx(
        0.5 * force @ (system.topology.L.T @ found.u / system.topology.count), rel=1e-12
    )
    assert lc.largest(system.solve_cg(force).lam, found.lam) < 1e-8


def test_mechanism_inside_a_partition_is_told_with_the_force_that_moves_it():
    system, force = dangling([2.0, 1.0])
    with pytest.raises(EstimationError, match=r"nothing holds 1 motions .* adds up to \(-?2\)"):
        system.solve(force)


def test_zero_modes_of_a_large_part_are_found_sparsely_and_serve_as_given_ones():
    case = lc.plane_stress((2, 1), 28)
    system = case.system
    again = PartitionedSystem(system.stiffness, None, system.boolean, None)
    assert min(K.shape[0] for K in system.stiffness) > 1500
    assert [R.shape[1] for R in again.rigid_modes] == [0, 3]
    found, other = system.solve(case.force), again.solve(case.force)
    assert lc.largest(other.lam, found.lam) < 1e-10
    assert lc.largest(found.u, system.topology.L @ lc.assembled(system, case.force)) < 1e-10


@pytest.mark.parametrize("length", [300, 700])
def test_bending_of_a_slender_strip_is_no_zero_mode(length):
    K, _ = box_element(np.ones(2), 1000.0, 0.3, 1.0)
    elements = np.arange(4) + 2 * np.arange(length)[:, None]
    found = zero_modes(validated_symmetric(assemble_elements(elements, K, 2, 2 * (length + 1)), 0))
    x = np.array([(i, j) for i in range(length + 1) for j in range(2)], float)
    S = np.linalg.qr(summation_operator(x, x.mean(0)))[0]
    assert found.shape[1] == 3
    assert np.linalg.svd(S.T @ found)[1] == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("supported", [True, False])
def test_one_partition_is_the_body_itself(supported):
    P = solid_parts((1, 1), 2)
    fixed = P.place[:, 0] == 0 if supported else np.zeros(len(P.place), bool)
    system = P.system(fixed)
    pull = np.zeros_like(P.place)
    pull[:, 0] = P.place[:, 0] - 0.5
    force = pull[~fixed].ravel()
    found = system.solve(force)
    K = system.stiffness[0].toarray()
    assert len(found.lam) == len(found.u_f) == 0
    assert lc.largest(found.u, np.linalg.pinv(K, rcond=1e-10, hermitian=True) @ force) < 1e-12
    assert np.array_equal(system.solve_cg(force).u, found.u)


def test_equal_partitions_are_factored_once():
    system, _, _ = lc.solved("plane_stress_16")
    each, which = system.factored
    assert len(each) == 2  # held, and free
    assert len(which) == 16
