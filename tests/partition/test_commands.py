import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import eigh, expm, null_space

from forceid.errors import DataError, EstimationError
from forceid.partition.coupling.commands import mean_control, solve_commands
from forceid.partition.grids import assemble_elements, bar, box_element
from forceid.principal.operator import summation_operator


def rod(elements=8, mass=3.0, stiffness=50.0):
    """Free uniform rod along one axis: its modes are cosines at the nodes, whatever the mesh."""
    x = np.linspace(0.0, 1.0, elements + 1)
    pairs = np.stack([np.arange(elements), np.arange(1, elements + 1)], axis=1)
    one = bar(np.array([[0.0], [1 / elements]]), stiffness, mass / elements)
    K, M = (assemble_elements(pairs, m, 1, elements + 1) for m in one)
    modes = np.cos(np.pi * np.outer(x, np.arange(1, elements)))
    return x, K, M, np.ones((elements + 1, 1)), modes


def plate(columns=6, rows=2):
    """Free planar beam of rectangles, its rigid modes about the mass center and its modes."""
    x = np.array([[0.2 * i, 0.1 * j] for i in range(columns + 1) for j in range(rows + 1)])
    first = np.array([i * (rows + 1) + j for i in range(columns) for j in range(rows)])
    quads = first[:, None] + np.array([0, 1, rows + 1, rows + 2])
    one = box_element(np.array([0.2, 0.1]), 1000.0, 0.3, 2.0, 0.1)
    K, M = (assemble_elements(quads, m, 2, len(x)) for m in one)
    R = summation_operator(x, x.mean(axis=0))
    still = null_space(R.T @ M)  # without mean motion, of which a solver leaves rounding in soft modes
    value, mode = eigh(still.T @ K @ still, still.T @ M @ still)
    return x, K, M, R, still @ mode, np.sqrt(value)


def moved(K, M, force, duration):
    """Displacement and velocity under a constant force from rest, by the exponential of the state matrix."""
    n = len(force)
    A = np.zeros((2 * n + 1, 2 * n + 1))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -np.linalg.solve(M.toarray(), K.toarray())
    A[n : 2 * n, -1] = np.linalg.solve(M.toarray(), force)
    state = expm(A * duration)[:, -1]
    return state[:n], state[n : 2 * n]


def ends(count):
    B = np.zeros((count, 2))
    B[0, 0] = B[-1, 1] = 1.0
    return B


def test_a_force_at_each_end_of_a_rod_commands_mean_and_first_mode_as_by_hand():
    x, _, M, R, modes = rod()
    done = solve_commands(ends(len(x)), R, modes[:, :1], [3.0], [1.0], residual=modes[:, 1:], mass=M)
    np.testing.assert_allclose(done.c, [2.0, 1.0], rtol=1e-14)
    # the ends of mode k move by 1 and (-1)^k, so every other mode gets what the mean or mode 1 gets
    np.testing.assert_allclose(done.spill, [3.0, 1.0, 3.0, 1.0, 3.0, 1.0], rtol=1e-13)
    assert (done.rank, done.independent, done.unreachable.shape) == (2, True, (0, 2))
    assert done.name == ("mean 0", "mode 0")


def test_the_condition_of_two_end_forces_is_the_ratio_of_their_cosines():
    x, _, _, R, modes = rod()
    done = solve_commands(ends(len(x)), R, modes[:, :1], [0.0], [0.0])
    # rows (1, 1)/|R| and (1, -1)/|Phi| are orthogonal, their condition the ratio of the norms of the modes
    expected = np.linalg.norm(R) / np.linalg.norm(modes[:, 0])
    assert done.condition == pytest.approx(expected, rel=1e-13)
    np.testing.assert_array_equal(done.c, 0.0)


def test_end_forces_cannot_tell_the_mean_from_an_even_mode_and_the_error_says_so():
    x, _, _, R, modes = rod()
    even = modes[:, 1:2]
    done = solve_commands(ends(len(x)), R, even, [2.0], [2.0])
    np.testing.assert_allclose(done.c, [1.0, 1.0], rtol=1e-13)
    assert (done.rank, done.independent, done.condition) == (1, False, np.inf)
    np.testing.assert_allclose(done.unreachable / done.unreachable[0, 0], [[1.0, -1.0]], rtol=1e-12)
    with pytest.raises(EstimationError, match=r"\(mean 0\) .*1 \(mode 0\) = .*5.*reach 1 of 2"):
        solve_commands(ends(len(x)), R, even, [3.0], [-2.0])


def test_the_error_names_a_mode_alone_where_actuators_sit_on_its_nodes():
    x, _, _, R, modes = rod()
    B = np.zeros((len(x), 2))
    B[2, 0] = B[6, 1] = 1.0  # x = 1/4 and 3/4, where mode 2 stands still and modes 1 and 3 move
    with pytest.raises(EstimationError, match=r"asks for \+1 \(second\) = 0\.5, "):
        solve_commands(B, R, modes[:, 1:2], [1.0], [0.5], name=("push", "second"))
    assert solve_commands(B, R, modes[:, :1], [1.0], [0.5]).independent


def test_rounding_in_a_target_out_of_reach_is_no_request():
    x, _, _, R, modes = rod()
    done = solve_commands(ends(len(x)), R, modes[:, 1:2], [2.0], [2.0 + 1e-12])
    np.testing.assert_allclose(done.c, [1.0, 1.0], rtol=1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_commands_meet_their_targets_with_least_effort(seed):
    rng = np.random.default_rng(seed)
    B, R, Phi, rest = (rng.standard_normal((30, k)) for k in (9, 3, 4, 5))
    tau_alpha, tau_q = rng.standard_normal((2, 7, 3)), rng.standard_normal((2, 7, 4))
    G = np.hstack([R, Phi]).T @ B
    X = rng.standard_normal((9, 9))
    for effort, W in ((None, np.eye(9)), (np.arange(1.0, 10.0),) * 2, (X @ X.T + np.eye(9),) * 2):
        done = solve_commands(B, R, Phi, tau_alpha, tau_q, residual=rest, effort=effort)
        W = np.diag(W) if W.ndim == 1 else W
        np.testing.assert_allclose(done.c @ G.T, np.concatenate([tau_alpha, tau_q], axis=-1), atol=1e-12)
        np.testing.assert_allclose(done.spill, done.c @ B.T @ rest, atol=1e-12)
        # least: its gradient has no part along commands that change nothing
        null = np.linalg.svd(G)[2][7:].T
        np.testing.assert_allclose(done.c @ W @ null, 0.0, atol=1e-10)


@pytest.mark.parametrize("seed", range(4))
def test_rank_condition_and_closed_combinations_do_not_depend_on_units(seed):
    rng = np.random.default_rng(seed)
    B, R, Phi = rng.standard_normal((20, 4)), rng.standard_normal((20, 3)), rng.standard_normal((20, 3))
    unit, tall = 10.0 ** rng.uniform(-6, 6, 4), 10.0 ** rng.uniform(-6, 6, 3)
    plain = solve_commands(B, R, Phi, np.zeros(3), np.zeros(3))
    other = solve_commands(B * unit, R, Phi * tall, np.zeros(3), np.zeros(3))
    assert plain.rank == other.rank == 4
    np.testing.assert_allclose(other.unreachable * np.r_[np.ones(3), tall], plain.unreachable, atol=1e-10)
    np.testing.assert_allclose(plain.unreachable @ np.hstack([R, Phi]).T @ B, 0.0, atol=1e-12)
    few = solve_commands(B, R, Phi[:, :1], np.zeros(3), np.zeros(1))
    scaled = solve_commands(B * unit, R, Phi[:, :1] * tall[0], np.zeros(3), np.zeros(1))
    assert scaled.condition == pytest.approx(few.condition, rel=1e-9)


def test_forces_of_one_direction_leave_the_mean_across_it_out_of_reach():
    x, _, M, R, modes, _ = plate()
    B = np.eye(2 * len(x))[:, 1::4]
    done = solve_commands(B, R, modes[:, :2], [0.0, 1.0, 0.0], [0.3, 0.0], mass=M)
    np.testing.assert_allclose(done.unreachable / done.unreachable.max(), [[1.0, 0, 0, 0, 0]], atol=1e-9)
    with pytest.raises(EstimationError, match=r"asks for \+1 \(mean 0\) = 0\.7,.*reach 4 of 5"):
        solve_commands(B, R, modes[:, :2], [0.7, 1.0, 0.0], [0.3, 0.0], mass=M)


def test_spare_actuators_quiet_the_residual_modes_when_effort_is_spill():
    x, _, M, R, modes, _ = plate()
    B, rest = np.eye(2 * len(x))[:, 1::4], modes[:, 2:6]
    X = rest.T @ B
    asked = (B, R[:, 1:], modes[:, :2], [1.0, 0.0], [0.3, 0.0], rest, M)
    plain, quiet = solve_commands(*asked), solve_commands(*asked, X.T @ X + 1e-9 * np.eye(B.shape[1]))
    assert plain.independent
    assert np.linalg.norm(quiet.spill) < 1e-3 * np.linalg.norm(plain.spill)
    np.testing.assert_allclose(R[:, 1:].T @ B @ quiet.c, [1.0, 0.0], atol=1e-9)
    assert np.linalg.norm(quiet.c) > np.linalg.norm(plain.c)


def test_mean_and_mode_commands_do_not_disturb_each_other():
    x, K, M, R, modes, omega = plate()
    B = np.eye(2 * len(x))[:, [0, 1, 4, 5, 21, 37, 41]]
    done = solve_commands(B, R, modes[:, :2], [0.2, -0.5, 0.1], [0.0, 0.4], mass=M)
    u, v = moved(K, M, B @ done.c, 2.0)
    M_alpha = R.T @ (M @ R)
    np.testing.assert_allclose(R.T @ (M @ u), [0.4, -1.0, 0.2], rtol=1e-9)
    np.testing.assert_allclose(
        np.linalg.solve(M_alpha, R.T @ (M @ v)), 2 * np.linalg.solve(M_alpha, [0.2, -0.5, 0.1]), rtol=1e-9
    )
    q = modes[:, :2].T @ (M @ u)
    assert abs(q[0]) < 1e-10
    assert q[1] == pytest.approx(0.4 * (1 - np.cos(2 * omega[1])) / omega[1] ** 2, rel=1e-8)


def test_pure_mean_control_leaves_all_modes_of_a_free_beam_at_rest():
    _, K, M, R, modes, _ = plate()
    tau = np.array([0.3, -1.0, 0.2])
    force = mean_control(M, R, tau)
    np.testing.assert_allclose(R.T @ force, tau, rtol=1e-13)
    np.testing.assert_allclose(modes.T @ force, 0.0, atol=1e-12)
    u, v = moved(K, M, force, 3.0)
    shared = R @ np.linalg.solve(R.T @ (M @ R), tau)
    np.testing.assert_allclose(u, 4.5 * shared, atol=1e-9 * np.abs(u).max())
    np.testing.assert_allclose(v, 3.0 * shared, atol=1e-9 * np.abs(v).max())
    np.testing.assert_allclose(modes.T @ (M @ u), 0.0, atol=1e-10 * np.abs(u).max())


def test_the_same_resultant_in_equal_nodal_forces_does_move_the_modes():
    _, K, M, R, modes, _ = plate()
    tau = np.array([0.0, 0.0, 0.2])
    force = mean_control(np.ones(len(R)), R, tau)
    np.testing.assert_allclose(R.T @ force, tau, atol=1e-14)
    q = modes.T @ (M @ moved(K, M, force, 3.0)[0])
    assert np.linalg.norm(q) > 1e-6


def test_mean_control_is_the_load_of_least_inertial_norm_for_every_sample():
    rng = np.random.default_rng(3)
    X = rng.standard_normal((12, 12))
    M, R, tau = X @ X.T + np.eye(12), rng.standard_normal((12, 3)), rng.standard_normal((5, 4, 3))
    force = mean_control(sp.csr_array(M), R, tau)
    np.testing.assert_allclose(force @ R, tau, atol=1e-12)
    null = np.linalg.svd(R.T)[2][3:].T
    np.testing.assert_allclose(np.linalg.solve(M, force[..., None])[..., 0] @ null, 0.0, atol=1e-12)


def mass_gauge(M, R, Phi):
    """The modes less their mean motion, so that R^T M Phi = 0."""
    return Phi - R @ np.linalg.solve(R.T @ M @ R, R.T @ M @ Phi)


def test_mean_control_needs_no_stiffness_and_no_mode_in_mass_gauge_feels_it():
    rng = np.random.default_rng(4)
    X = rng.standard_normal((12, 12))
    M, R = X @ X.T + np.eye(12), rng.standard_normal((12, 3))
    Phi = mass_gauge(M, R, rng.standard_normal((12, 5)))
    np.testing.assert_allclose(R.T @ M @ Phi, 0.0, atol=1e-11)
    np.testing.assert_allclose(Phi.T @ mean_control(M, R, [1.0, 2.0, 3.0]), 0.0, atol=1e-12)


def test_modes_that_couple_to_the_mean_are_refused_until_they_are_in_mass_gauge():
    x, _, M, R, modes = rod()
    skew = modes[:, :1] + 0.2
    with pytest.raises(DataError, match=r"couple in the mass.*take Phi - R"):
        solve_commands(ends(len(x)), R, skew, [1.0], [1.0], mass=M)
    mended = mass_gauge(M, R, skew)
    np.testing.assert_allclose(mended, modes[:, :1], atol=1e-12)
    assert solve_commands(ends(len(x)), R, mended, [1.0], [1.0], mass=M).independent


def test_actuators_that_do_nothing_reach_nothing():
    x, _, _, R, modes = rod()
    done = solve_commands(sp.csr_array(np.zeros((len(x), 2))), R, modes[:, :1], [0.0], [0.0])
    assert (done.rank, done.unreachable.tolist()[0][1]) == (0, 0.0)
    np.testing.assert_array_equal(done.c, [0.0, 0.0])
    with pytest.raises(EstimationError, match=r"\+1 \(mean 0\) = 1, .*reach 0 of 2"):
        solve_commands(np.zeros((len(x), 2)), R, modes[:, :1], [1.0], [0.0])


def test_one_actuator_cannot_command_two_motions_but_can_command_their_ratio():
    x, _, _, R, modes = rod()
    B = ends(len(x))[:, :1]
    done = solve_commands(B, R, modes[:, :1], [2.0], [2.0])
    np.testing.assert_allclose(done.c, [2.0], rtol=1e-13)
    assert not done.independent
    with pytest.raises(EstimationError, match="reach 1 of 2"):
        solve_commands(B, R, modes[:, :1], [2.0], [0.0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"actuators": np.ones(4)}, r"actuators has shape \(4,\)"),
        ({"actuators": np.full((4, 2), np.nan)}, "actuators holds numbers that are not finite"),
        ({"R": np.ones((3, 1))}, r"R has shape \(3, 1\), expected \(4, mode\)"),
        ({"Phi": np.zeros((4, 1))}, "Phi is zero in column 0"),
        ({"residual": np.full((4, 1), np.inf)}, "residual holds numbers"),
        ({"tau_alpha": [1.0, 2.0]}, r"tau_alpha has shape \(2,\), expected \(..., 1\)"),
        ({"tau_q": [np.nan]}, "tau_q holds numbers"),
        ({"tau_alpha": np.ones((2, 1)), "tau_q": np.ones((3, 1))}, "tau_q has shape .* does not go with"),
        ({"mass": np.ones(5)}, r"mass has shape \(5,\)"),
        ({"mass": np.full(4, np.nan)}, "mass holds numbers"),
        ({"effort": [1.0]}, "effort must be"),
        ({"effort": [1.0, 0.0]}, "effort is not positive definite"),
        ({"name": ("a",)}, "name has 1 entries, expected 2"),
        ({"R": np.ones((4, 0)), "Phi": np.ones((4, 0)), "tau_alpha": [], "tau_q": []}, "at least one"),
    ],
)
def test_bad_input_is_told_by_name(change, message):
    good = {"actuators": np.eye(4)[:, :2], "R": np.ones((4, 1)), "Phi": [[1.0], [-1.0], [0.0], [0.0]]}
    good |= {"tau_alpha": [1.0], "tau_q": [1.0]}
    with pytest.raises(DataError, match=message):
        solve_commands(**(good | change))


def test_rigid_modes_without_mass_are_refused():
    with pytest.raises(DataError, match="carry no mass, or that depend"):
        mean_control([1.0, 0.0], [[0.0], [1.0]], [1.0])
    with pytest.raises(DataError, match="carry no mass, or that depend"):
        mean_control([1.0, 1.0], [[1.0, 2.0], [1.0, 2.0]], [1.0, 1.0])
