import numpy as np
import pytest
from scipy.stats import chi2

from forceid.errors import DataError
from forceid.partition.coupling.resultants import link_resultants
from forceid.partition.grids import gathered, solid_parts
from forceid.partition.operators.topology import boolean_from_positions
from forceid.partition.solution.interface_forces import interface_forces
from forceid.partition.system import PartitionedSystem
from forceid.principal.operator import summation_operator
from forceid.principal.wrench import transport, transport_cov


def chain(r=4):
    return solid_parts((4, 1), r)


def ring(r=3):
    """A square frame of four strips that meet along four edges, and at no point three of them."""
    strips = [((3, 1), (0, 0)), ((3, 1), (0, 2)), ((1, 1), (0, 1)), ((1, 1), (2, 1))]
    found = []
    for size, at in strips:
        boxes = solid_parts(size, r)
        K, M = (
            sum(L.T @ m @ L for L, m in zip(boxes.boolean, each, strict=True))
            for each in (boxes.stiffness, boxes.mass)
        )
        found.append((K, M, boxes.place + np.array(at, dtype=float)))
    K, M, x = (list(each) for each in zip(*found, strict=True))
    return gathered(K, M, x)


def motions(parts, about, fixed=None):
    S = summation_operator(parts.place, about)
    return S if fixed is None else S[np.repeat(~fixed, parts.place.shape[1])]


def shaken(parts, samples=(), seed=0, fixed=None):
    """A motion of the body, the loads that make it, and the forces that its stiffness then passes."""
    system, rng = parts.system(fixed), np.random.default_rng(seed)
    top = system.topology
    u, a = rng.normal(size=(2, *samples, top.size)) * np.array([1e-3, 1.0]).reshape(
        2, *[1] * (len(samples) + 1)
    )
    K, M = (
        sum(L.T @ k @ L for L, k in zip([top.L[d] for d in top.dofs], each, strict=True))
        for each in (system.stiffness, system.mass)
    )
    f = (K @ u.T + M @ a.T).T
    lam = []
    for k, m, g, b in zip(system.stiffness, system.mass, top.glob, top.boundary, strict=True):
        lam.append((f[..., g] / top.count[g] - (k @ u[..., g].T + m @ a[..., g].T).T)[..., b])
    return system, f, u, a, np.concatenate(lam, axis=-1)


def carried(found, system, S, lam):
    """S^T lambda of the first partition of every link on its interface."""
    top, wrench = system.topology, []
    for (a, _), k in zip(found.resultant.links, found.between, strict=True):
        at = top.glob[a][top.boundary[a]]
        on = np.isin(at, found.interfaces[k].dof)
        wrench.append(lam[..., top.rows[a]][..., on] @ S[at[on]])
    return np.stack(wrench, axis=-2)


def nees(error, cov):
    return np.einsum("ti,ij,tj->t", error, np.linalg.pinv(cov, rcond=1e-9, hermitian=True), error)


def within_99(values, dof):
    low, high = chi2.ppf([0.005, 0.995], dof * len(values)) / len(values)
    return low < values.mean() < high


def test_a_chain_at_rest_has_exact_resultants_and_wrong_forces_point_by_point():
    parts = chain()
    fixed = np.isclose(parts.place[:, 0], 0)
    system, S = parts.system(fixed), motions(parts, [2.0, 0.5], fixed)
    load = np.random.default_rng(1).normal(size=system.topology.size)
    true = system.solve(load).lam
    found = interface_forces(system, load, motions=S)
    expected = carried(found, system, S, true)
    assert found.resultant.links == ((0, 1), (1, 2), (2, 3))
    assert found.resultant.loops == 0
    assert found.resultant.determined.all()
    np.testing.assert_allclose(found.resultant.wrench, expected, atol=1e-12 * np.abs(expected).max())
    assert np.linalg.norm(found.lam - true) > 0.1 * np.linalg.norm(true)
    assert found.balance.reasons == ()
    np.testing.assert_allclose(found.lam, system.start_vector(load), atol=1e-13)


def test_a_chain_in_motion_has_exact_resultants_at_every_sample():
    parts = chain(2)
    system, f, _, a, true = shaken(parts, (7,), seed=2)
    found = interface_forces(system, f, a)
    S = motions(parts, parts.place.mean(axis=0))
    expected = carried(found, system, S, true)
    np.testing.assert_allclose(found.resultant.wrench, expected, atol=1e-12 * np.abs(expected).max())
    assert found.resultant.dof == 3
    np.testing.assert_allclose(found.resultant.chi_square, 0, atol=1e-18)
    assert found.balance.reasons == ()
    assert np.linalg.norm(found.lam - true) > 0.1 * np.linalg.norm(true)


def test_a_ring_of_four_hides_one_planar_wrench_and_tells_the_rest():
    parts = ring()
    system, f, _, a, true = shaken(parts, (5,), seed=3)
    found = interface_forces(system, f, a)
    passed = found.resultant
    assert passed.links == ((0, 2), (0, 3), (1, 2), (1, 3))
    assert passed.loops == 1
    assert passed.null_space.shape == (12, 3)
    assert not passed.determined.any()
    expected = carried(found, system, motions(parts, parts.place.mean(axis=0)), true).reshape(5, -1)
    np.testing.assert_allclose(
        passed.wrench.reshape(5, -1), expected @ passed.estimable, atol=1e-12 * np.abs(expected).max()
    )
    assert np.abs(expected @ passed.null_space).max() > 1e-3


def test_where_four_squares_meet_the_middle_passes_forces_between_three_pairs():
    parts = solid_parts((2, 2), 3)
    system, f, _, a, true = shaken(parts, seed=4)
    found = interface_forces(system, f, a)
    assert [i.partitions for i in found.interfaces] == [(0, 1), (0, 1, 2, 3), (0, 2), (1, 3), (2, 3)]
    assert found.resultant.links == ((0, 1), (0, 3), (1, 3), (2, 3), (0, 2), (1, 3), (2, 3))
    # four wrenches and three forces, less the balances of four squares that hang together freely
    assert found.resultant.null_space.shape == (21, 4 * 3 + 3 * 2 - (4 * 3 - 3))
    expected = carried(found, system, motions(parts, [1.0, 1.0]), true).ravel()
    np.testing.assert_allclose(
        found.resultant.wrench.ravel(), found.resultant.estimable @ expected, atol=1e-11
    )


@pytest.mark.parametrize("ends", [(0,), (0, 4)])
def test_supports_at_both_ends_close_a_loop_through_the_ground(ends):
    parts = chain(2)
    fixed = np.isin(np.round(parts.place[:, 0], 6), ends)
    system, f, _, a, true = shaken(parts, seed=5, fixed=fixed)
    S = motions(parts, [0.0, 0.0], fixed)
    found = interface_forces(system, f, a, motions=S)
    loops = len(ends) - 1
    assert (found.resultant.loops, found.resultant.null_space.shape[1]) == (loops, 3 * loops)
    expected = carried(found, system, S, true).ravel()
    np.testing.assert_allclose(
        found.resultant.wrench.ravel(), found.resultant.estimable @ expected, atol=1e-11
    )


def test_parts_that_float_agree_with_the_graph_of_their_links():
    for parts, seed in ((chain(2), 6), (ring(2), 7)):
        system, f, _, a, _ = shaken(parts, seed=seed)
        found = interface_forces(system, f, a).resultant
        top = system.topology
        net = top.shared(f) - np.concatenate([m @ a[g] for m, g in zip(system.mass, top.glob, strict=True)])
        graph = link_resultants(found.links, system.resultant(net).reshape(4, 3))
        np.testing.assert_allclose(graph.estimable, found.estimable, atol=1e-9)
        np.testing.assert_allclose(graph.wrench, found.wrench, atol=1e-11)
        assert graph.loops == found.loops


def test_a_solid_chain_passes_six_components():
    parts = solid_parts((3, 1, 1), 1)
    system, f, _, a, true = shaken(parts, seed=8)
    found = interface_forces(system, f, a)
    expected = carried(found, system, motions(parts, parts.place.mean(axis=0)), true)
    assert expected.shape == (2, 6)
    np.testing.assert_allclose(found.resultant.wrench, expected, atol=1e-12 * np.abs(expected).max())


def test_mean_motions_of_the_partitions_are_all_that_is_asked_for():
    system, f, _, a, _ = shaken(chain(2), (4,), seed=9)
    R, top = system.modes, system.topology
    each = [r.T @ m for r, m in zip(system.rigid_modes, system.mass, strict=True)]
    carries = np.concatenate([(rm @ a[:, g].T).T for rm, g in zip(each, top.glob, strict=True)], axis=-1)
    M_alpha = np.concatenate([R[d, :].T @ rm.T for rm, d in zip(each, top.dofs, strict=True)], axis=1)
    mean = np.linalg.solve(M_alpha, carries.T).T
    np.testing.assert_allclose(
        interface_forces(system, f, mean, mean_motion=True).lam,
        interface_forces(system, f, a).lam,
        atol=1e-11,
    )


def test_assembled_and_separate_arrays_say_the_same():
    system, f, u, a, _ = shaken(chain(1), (3,), seed=10)
    top = system.topology
    shares = [f[:, g] / top.count[g] for g in top.glob]
    lists = interface_forces(system, shares, [a[:, g] for g in top.glob]).lam
    np.testing.assert_allclose(lists, interface_forces(system, f, a).lam, atol=1e-13)
    rows = interface_forces(system, np.concatenate(shares, axis=1), a[:, np.concatenate(top.glob)]).lam
    np.testing.assert_allclose(rows, lists, atol=1e-13)
    np.testing.assert_allclose(
        interface_forces(system, shares, a, [u[:, g] for g in top.glob]).lam,
        interface_forces(system, f, a, u).lam,
        atol=1e-13,
    )


def test_stiffness_gives_the_forces_of_the_solution_at_rest():
    parts = solid_parts((2, 2), 3)
    fixed = np.isclose(parts.place[:, 0], 0)
    system = parts.system(fixed)
    load = np.random.default_rng(11).normal(size=system.topology.size)
    solved = system.solve(load)
    found = interface_forces(system, load, displacement=solved.u, motions=motions(parts, [0.0, 0.0], fixed))
    np.testing.assert_allclose(found.lam, solved.lam, atol=1e-10 * np.abs(solved.lam).max())
    assert found.balance.reasons == ()
    assert found.resultant.null_space.shape[1] == 0
    expected = carried(found, system, motions(parts, [0.0, 0.0], fixed), solved.lam)
    np.testing.assert_allclose(found.resultant.wrench, expected, atol=1e-9)


def test_stiffness_gives_the_forces_of_a_body_in_motion_and_of_inertia_relief():
    parts = ring(2)
    system, f, u, a, true = shaken(parts, (3,), seed=12)
    found = interface_forces(system, f, a, u)
    np.testing.assert_allclose(found.lam, true, atol=1e-12)
    assert found.balance.reasons == ()
    load = np.random.default_rng(13).normal(size=system.topology.size)
    solved = system.solve(load, relief=True)
    rigid = system.whole() @ solved.acceleration
    top = system.topology
    # relief shares out the inertia too: so must the load that is left
    relieved = load - top.assembled(
        np.concatenate([m @ rigid[d] for m, d in zip(system.mass, top.dofs, strict=True)])
    )
    np.testing.assert_allclose(interface_forces(system, relieved, None, solved.u).lam, solved.lam, atol=1e-10)


@pytest.mark.parametrize("body", [chain, ring])
def test_covariance_of_resultants_is_that_of_repeated_draws(body):
    parts = body(2)
    system, f, _, a, _ = shaken(parts, seed=14)
    rng, count = np.random.default_rng(15), 1500
    std = rng.uniform(0.5, 2.0, size=system.topology.size)
    noise = std * rng.normal(size=(count, system.topology.size))
    exact = interface_forces(system, f, a)
    found = interface_forces(system, f, a + noise, acceleration_cov=std**2)
    error = (found.resultant.wrench - exact.resultant.wrench).reshape(count, -1)
    assert np.linalg.matrix_rank(found.resultant.joint_cov, tol=1e-9) == 9
    assert within_99(nees(error, found.resultant.joint_cov), 9)
    assert within_99(found.resultant.chi_square, found.resultant.dof)
    assert np.trace(found.lam_cov) == pytest.approx(((found.lam - exact.lam) ** 2).sum(-1).mean(), rel=0.05)
    full = interface_forces(system, f, a, acceleration_cov=np.diag(std**2))
    np.testing.assert_allclose(full.lam_cov, found.lam_cov, atol=1e-12)
    assert found.balance.reasons == ()


def test_covariance_of_what_moves_the_parts_passes_through_the_published_operator():
    system, f, _, a, _ = shaken(solid_parts((2, 2), 2), seed=16)
    root = np.random.default_rng(17).normal(size=(3, 12, 12))
    C, L_f, R_b = root @ root.mT, system.topology.L_f.toarray(), system.R_b
    P_L = np.eye(len(L_f)) - L_f @ np.linalg.inv(L_f.T @ L_f) @ L_f.T
    N = P_L @ R_b @ np.linalg.pinv(R_b.T @ P_L @ R_b, rcond=1e-10)
    found = interface_forces(system, f, a, resultant_cov=C)
    net = system.topology.shared(f) - np.concatenate(
        [m @ a[g] for m, g in zip(system.mass, system.topology.glob, strict=True)]
    )
    np.testing.assert_allclose(found.lam_cov, N @ C @ N.T, atol=1e-10)
    np.testing.assert_allclose(
        interface_forces(system, f, 0 * a).lam, N @ system.modes.T @ system.topology.shared(f)
    )
    np.testing.assert_allclose(R_b.T @ found.lam - system.modes.T @ net, 0, atol=1e-11)
    assert found.resultant.cov.shape == (3, 7, 3, 3)


def test_covariance_by_stiffness_is_that_of_repeated_draws():
    system, f, u, a, true = shaken(chain(1), seed=18)
    rng, count, size = np.random.default_rng(19), 1500, system.topology.size
    found = interface_forces(
        system,
        f,
        displacement=u + 1e-4 * rng.normal(size=(count, size)),
        acceleration=a + 0.3 * rng.normal(size=(count, size)),
        displacement_cov=np.full(size, 1e-8),
        acceleration_cov=np.full(size, 0.09),
    )
    rank = np.linalg.matrix_rank(found.lam_cov, tol=1e-9, hermitian=True)
    assert within_99(nees(found.lam - true, found.lam_cov), rank)
    assert found.balance.reasons == ()


def test_resultants_do_not_depend_on_the_point_that_moments_are_about():
    parts, arm = ring(2), np.array([30.0, -4.0])
    system, f, _, a, _ = shaken(parts, (2,), seed=20)
    options = {"acceleration_cov": np.ones(system.topology.size)}
    here = interface_forces(system, f, a, motions=motions(parts, [0.0, 0.0]), **options).resultant
    there = interface_forces(system, f, a, motions=motions(parts, -arm), **options).resultant
    T = np.kron(np.eye(4), transport(np.eye(3), arm).T)
    moved = here.wrench.reshape(2, -1) @ T.T
    np.testing.assert_allclose(there.estimable @ T @ here.null_space, 0, atol=1e-9)
    np.testing.assert_allclose(moved @ there.estimable, there.wrench.reshape(2, -1), atol=1e-8)
    tree = chain(2)
    system, f, _, a, _ = shaken(tree, seed=21)
    options = {"acceleration_cov": np.ones(system.topology.size)}
    here = interface_forces(system, f, a, motions=motions(tree, [0.0, 0.0]), **options).resultant
    there = interface_forces(system, f, a, motions=motions(tree, -arm), **options).resultant
    np.testing.assert_allclose(there.wrench, transport(here.wrench, arm), atol=1e-10)
    np.testing.assert_allclose(there.cov, transport_cov(here.cov, arm), atol=1e-8)
    np.testing.assert_allclose(there.chi_square, here.chi_square, atol=1e-18)


def test_forces_that_do_not_balance_are_told_in_a_sentence():
    system, f, u, a, _ = shaken(chain(2), seed=22)
    lost = f.copy()
    lost[-1] += 1.0  # a load that nobody knows of, at the far end
    found = interface_forces(system, lost, a)
    assert len(found.balance.reasons) == 1
    assert "times what rounding and covariances explain; look at its mass" in found.balance.reasons[0]
    # every motion of the whole takes its part of what is left
    whole = system.projection.whole
    np.testing.assert_allclose(
        found.balance.parts @ whole, (system.resultant(system.topology.shared(lost - f))) @ whole, atol=1e-11
    )
    assert interface_forces(system, lost, a, acceleration_cov=np.full(len(a), 1e4)).balance.reasons == ()
    assert found.resultant.chi_square > 0.01
    left = interface_forces(system, lost, a, u).balance
    assert "at partition 3" in left.reasons[0]
    np.testing.assert_allclose(left.nodes, 0, atol=1e-12)


def test_a_displacement_that_jumps_at_one_side_shows_at_the_nodes():
    system, f, u, a, _ = shaken(chain(2), seed=23)
    each = [u[g].copy() for g in system.topology.glob]
    shared = system.topology.boundary[2][0]
    each[2][shared] += 1e-3
    jumped = system.topology.glob[2][shared]
    told = interface_forces(system, f, a, each).balance
    assert any(f"assembled degree of freedom {jumped}, " in reason for reason in told.reasons)


def test_modes_in_axes_of_each_partition_give_forces_without_resultants():
    parts = chain(2)
    system, f, _, a, _ = shaken(parts, seed=24)
    unnamed = PartitionedSystem(parts.stiffness, parts.mass, parts.boolean)
    found, named = interface_forces(unnamed, f, a), interface_forces(system, f, a)
    assert found.resultant is None
    np.testing.assert_allclose(found.lam, named.lam, atol=1e-9)
    given = interface_forces(unnamed, f, a, motions=motions(parts, parts.place.mean(axis=0)))
    np.testing.assert_allclose(given.resultant.wrench, named.resultant.wrench, atol=1e-9)


def test_a_gap_in_the_accelerations_stays_in_its_sample():
    system, f, _, a, _ = shaken(chain(1), (3,), seed=25)
    whole = interface_forces(system, f, a)
    a[1, 4] = np.nan
    found = interface_forces(system, f, a)
    assert np.isnan(found.resultant.wrench[1]).all()
    np.testing.assert_array_equal(found.lam[[0, 2]], whole.lam[[0, 2]])


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (
            {"acceleration": np.zeros(7)},
            "acceleration has 7 columns, expected 32 of all partitions, or 20 assembled",
        ),
        ({"acceleration": np.zeros(7), "mean_motion": True}, "acceleration has 7 columns, expected 12"),
        ({"acceleration": np.zeros(20), "acceleration_cov": np.eye(3)}, "acceleration_cov has shape"),
        ({"resultant_cov": np.eye(3)}, "resultant_cov has shape"),
        ({"motions": np.eye(3)}, r"motions has shape \(3, 3\), expected \(20, n\)"),
        ({"load": np.zeros(5)}, "load has 5 columns"),
        ({"load": np.full(20, np.nan)}, "load holds numbers that are not finite"),
    ],
)
def test_input_that_does_not_fit_is_named(options, told):
    with pytest.raises(DataError, match=told):
        interface_forces(chain(1).system(), **{"load": np.zeros(20), **options})


def test_accelerations_need_a_mass():
    parts = chain(1)
    system = PartitionedSystem(parts.stiffness, None, boolean_from_positions(parts.position, 1e-6))
    with pytest.raises(DataError, match="mass is not given, and what accelerates needs it"):
        interface_forces(system, np.zeros(20), np.zeros(20))


def test_the_system_takes_displacements_for_stiffness_and_does_without():
    system, f, u, a, true = shaken(chain(1), seed=26)
    np.testing.assert_array_equal(system.interface_forces(f, a).lam, interface_forces(system, f, a).lam)
    np.testing.assert_allclose(system.interface_forces(f, a, displacement=u).lam, true, atol=1e-12)
