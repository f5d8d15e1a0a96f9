"""Projected conjugate gradients: projectors, start vector, printed steps and conditions, scipy's face."""

from functools import cache

import lecture_cases as lc
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag
from scipy.sparse.linalg import LinearOperator, cg

from forceid.errors import EstimationError
from forceid.partition import PartitionedSystem
from forceid.partition.operators.projection import Projection

NAMES = list(lc.PRINTED)


@cache
def iterated(name, preconditioner, weights="multiplicity"):
    system, force, _ = lc.solved(name)
    return system.solve_cg(force, preconditioner, weights)


@pytest.mark.parametrize("name", NAMES)
def test_steps_are_the_printed_ones(name):
    steps = [iterated(name, p).iterations.count for p in lc.PRECONDITIONERS]
    assert np.abs(np.subtract(steps, lc.PRINTED[name].steps)).max() <= 2


@pytest.mark.parametrize(("grid", "r"), lc.GROWTH)
def test_conditions_and_steps_grow_as_printed(grid, r):
    condition, steps = lc.GROWTH[grid, r]
    case = lc.plane_stress(grid, r)
    system = case.system
    found = [system.solve_cg(case.force, p).iterations for p in lc.PRECONDITIONERS]
    assert [f.condition for f in found] == pytest.approx(condition, rel=0.02)
    assert np.abs(np.subtract([f.count for f in found], steps)).max() <= 2


@pytest.mark.parametrize("weights", ["multiplicity", "stiffness"])
@pytest.mark.parametrize("preconditioner", lc.PRECONDITIONERS)
@pytest.mark.parametrize("name", NAMES)
def test_iterated_solution_is_the_direct_one_and_in_balance(name, preconditioner, weights):
    system, force, direct = lc.solved(name)
    found = iterated(name, preconditioner, weights)
    for field in ("lam", "u", "u_f", "alpha"):
        assert lc.largest(getattr(found, field), getattr(direct, field)) < 1e-8
    assert found.energy == pytest.approx(direct.energy, rel=1e-8)
    assert lc.imbalance(system, force, found.lam) < 1e-12


@pytest.mark.parametrize("preconditioner", lc.PRECONDITIONERS)
def test_floating_plate_is_iterated_to_the_direct_solution(preconditioner):
    system, load = lc.free_plate()
    direct, found = system.solve(load, relief=True), system.solve_cg(load, preconditioner, relief=True)
    assert lc.largest(found.lam, direct.lam) < 1e-8
    assert lc.largest(found.u, direct.u) < 1e-8
    assert np.array_equal(found.acceleration, direct.acceleration)
    assert found.deficiency == 3


PROJECTED = {
    "plate": lambda: lc.solved("plane_stress_4")[0],
    "solid": lambda: lc.solved("solid_8")[0],
    "floating": lambda: lc.free_plate()[0],
    "jumping": lambda: lc.plane_stress((2, 2), 3, [1e3, 1e7, 1e5, 1e3]).system,
}


@cache
def projector(name, weights):
    system = PROJECTED[name]()
    return system, system.projection if weights == "multiplicity" else system.by_stiffness


@pytest.mark.parametrize("weights", ["multiplicity", "stiffness"])
@pytest.mark.parametrize("name", PROJECTED)
def test_projector_leaves_forces_that_balance_and_repeats_itself(name, weights):
    system, P = projector(name, weights)
    once = P.forces(np.random.default_rng(7).standard_normal(len(P.weight)))
    size = np.abs(once).max()
    rounding = 1e-12 * P.weight.max() / P.weight.min()
    assert np.abs(P.forces(once) - once).max() < rounding * size
    assert np.abs(P.R_b.T @ once).max() < rounding * size
    assert np.abs(system.topology.L_f.T @ once).max() < rounding * size


@pytest.mark.parametrize("weights", ["multiplicity", "stiffness"])
@pytest.mark.parametrize("name", PROJECTED)
def test_projector_of_gaps_is_the_adjoint_of_that_of_forces(name, weights):
    _, P = projector(name, weights)
    x, y = np.random.default_rng(8).standard_normal((2, len(P.weight)))
    forces, gaps = P.forces(x), P.gaps(y)
    size = np.linalg.norm(forces) * np.linalg.norm(y)
    assert abs(forces @ y - x @ gaps) < 1e-13 * P.weight.max() / P.weight.min() * size


@pytest.mark.parametrize("weights", ["multiplicity", "stiffness"])
@pytest.mark.parametrize("name", PROJECTED)
def test_rigid_gaps_and_common_motions_are_no_gaps(name, weights):
    system, P = projector(name, weights)
    rng = np.random.default_rng(9)
    L_f = system.topology.L_f
    rigid, common = (A @ rng.standard_normal(A.shape[1]) for A in (P.R_b, L_f))
    rounding = 1e-12 * P.weight.max() / P.weight.min()
    assert np.abs(P.gaps(rigid)).max() < rounding * np.abs(rigid).max()
    assert np.abs(P.gaps(common)).max() < rounding * np.abs(common).max()


@pytest.mark.parametrize("name", ["plate", "floating"])
def test_projector_is_the_dense_one_onto_what_balances(name):
    system, P = projector(name, "multiplicity")
    C = np.hstack([P.R_b, system.topology.L_f.toarray()])
    dense = np.eye(len(C)) - C @ np.linalg.pinv(C, rcond=1e-10)
    assert np.abs(np.array([P.forces(e) for e in np.eye(len(C))]).T - dense).max() < 1e-12
    assert np.linalg.matrix_rank(dense, tol=1e-8) == len(C) - np.linalg.matrix_rank(C, tol=1e-8)


@settings(deadline=None, derandomize=True, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["multiplicity", "stiffness"]))
def test_start_vector_is_the_least_of_all_that_balance(seed, weights):
    system, P = projector("plate", weights)
    rng = np.random.default_rng(seed)
    load = rng.standard_normal(system.topology.size)
    start = P.start(system.resultant(system.loads(load)))
    assert lc.imbalance(system, load, start) < 1e-12
    other = start + P.forces(rng.standard_normal(len(start)))
    assert start @ (start / P.weight) < other @ (other / P.weight)


@pytest.mark.parametrize("name", NAMES)
def test_start_vector_is_the_least_squares_solution_of_both_constraints(name):
    system, force, _ = lc.solved(name)
    L_f = system.topology.L_f.toarray()
    right = np.append(system.resultant(system.loads(force)), np.zeros(L_f.shape[1]))
    least = np.linalg.lstsq(np.vstack([system.R_b.T, L_f.T]), right, rcond=None)[0]
    assert lc.largest(system.start_vector(force), least) < 1e-11


def test_lumped_preconditioner_is_the_stiffness_at_the_interface():
    system, _, _ = lc.solved("solid_2")
    B, K = system.topology.B.toarray(), block_diag(*[k.toarray() for k in system.stiffness])
    x = np.random.default_rng(10).standard_normal(len(B.T))
    assert lc.largest(system.precondition("lumped")(x), B.T @ K @ B @ x) < 1e-13


@pytest.mark.parametrize("name", ["plane_stress_4", "solid_2"])
def test_dirichlet_preconditioner_is_the_condensed_stiffness(name):
    system, _, _ = lc.solved(name)
    x = np.random.default_rng(11).standard_normal(len(system.topology.frame))
    apply = system.precondition("dirichlet")(x)
    for K, b, rows in zip(system.stiffness, system.topology.boundary, system.topology.rows, strict=True):
        K, i = K.toarray(), np.setdiff1d(np.arange(K.shape[0]), b)
        condensed = K[np.ix_(b, b)] - K[np.ix_(b, i)] @ np.linalg.solve(K[np.ix_(i, i)], K[np.ix_(i, b)])
        assert lc.largest(apply[rows], condensed @ x[rows]) < 1e-12


def test_partitions_without_inner_nodes_are_preconditioned():
    case = lc.truss((2, 2), 1)
    system = case.system
    assert lc.largest(system.solve_cg(case.force).lam, system.solve(case.force).lam) < 1e-8


def projected(system):
    """P^T F P, for the solvers of scipy."""
    n, P = len(system.topology.frame), system.projection
    return LinearOperator(
        (n, n), matvec=lambda x: P.gaps(system.flexibility(P.forces(np.ravel(x)))), dtype=float
    )


def test_condition_by_the_steps_is_that_of_the_operator():
    case = lc.plane_stress((2, 2), 2)
    system = case.system
    A = projected(system) @ np.eye(len(system.topology.frame))
    value = np.linalg.eigvalsh(0.5 * (A + A.T))
    value = value[value > 1e-10 * value[-1]]
    found = system.solve_cg(case.force, "none").iterations.condition
    assert 0.98 * value[-1] / value[0] < found < 1.0001 * value[-1] / value[0]


@pytest.mark.parametrize("name", ["plane_stress_4", "solid_8"])
def test_conjugate_gradients_of_scipy_find_the_same_multipliers(name):
    system, force, direct = lc.solved(name)
    P, start = system.projection, system.start_vector(force)
    gap = system.topology.B.T @ system.inverse(system.loads(force)) - system.flexibility(start)
    x, info = cg(projected(system), P.gaps(gap), rtol=1e-11, atol=0.0)
    assert info == 0
    assert lc.largest(start + P.forces(x), direct.lam) < 1e-8


def test_operator_is_symmetric_and_definite_on_what_balances():
    system, _, _ = lc.solved("plane_stress_4")
    A, P = projected(system), system.projection
    x, y = map(P.forces, np.random.default_rng(12).standard_normal((2, len(P.weight))))
    assert x @ (A @ y) == pytest.approx(y @ (A @ x), rel=1e-11)
    assert x @ (A @ x) > 0


def test_multipliers_that_statics_alone_gives_take_no_step():
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    L = [np.eye(4)[k : k + 2] for k in range(3)]
    system = PartitionedSystem([pair, 3 * pair, 0.7 * pair], None, L, None)
    load = np.array([1.0, 0.2, -0.5, -0.7])
    found = system.solve_cg(load)
    assert found.iterations.count == 0
    assert lc.largest(found.lam, system.solve(load).lam) < 1e-13


def test_unloaded_body_takes_no_step():
    system, force, _ = lc.solved("truss_4")
    found = system.solve_cg(0 * force)
    assert found.iterations.count == 0
    assert not found.u.any()


def test_too_few_steps_are_told_with_what_is_left():
    system, force, _ = lc.solved("plane_stress_4")
    with pytest.raises(
        EstimationError, match=r"leave \d.*e-\d+ of the residual after 5 steps, expected 1e-10"
    ):
        system.solve_cg(force, "none", most=5)


def test_tighter_tolerance_comes_nearer():
    system, force, direct = lc.solved("plane_stress_16")
    coarse, fine = (system.solve_cg(force, tolerance=t) for t in (1e-3, 1e-7))
    assert lc.largest(coarse.lam, direct.lam) > 100 * lc.largest(fine.lam, direct.lam)
    assert coarse.iterations.count < fine.iterations.count
    residual = fine.iterations.residual
    assert residual[-1] <= 1e-7 * residual[0] < residual[-2]


def test_free_motions_are_counted_alike_however_stiffness_jumps():
    system = lc.plane_stress((4, 1), 2, [1e3, 1e14, 1e3, 1e14]).system
    assert system.by_stiffness.free == system.projection.free == 0
    floating = lc.plane_stress((2, 1), 2, [1e3, 1e14]).parts.system()
    assert floating.by_stiffness.whole.shape[1] == 3


def test_weights_are_shares_of_what_a_node_is_out_of_balance():
    system, _, _ = lc.solved("plane_stress_4")
    weight = np.random.default_rng(13).uniform(0.1, 10, len(system.topology.frame))
    P = Projection(system.topology, system.R_b, weight)
    x = np.zeros(len(weight))
    x[0] = 1.0
    at = np.flatnonzero(system.topology.frame == system.topology.frame[0])
    expected = x.copy()
    expected[at] -= weight[at] / weight[at].sum()
    assert P.balanced(x) == pytest.approx(expected, abs=1e-15)
