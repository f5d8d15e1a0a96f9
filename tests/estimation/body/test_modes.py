import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import eigh

from forceid.estimation.body.deforming.mode_selection import observable_modes, observed_shapes
from forceid.estimation.body.deforming.modes import (
    deflected_shape,
    elastic_modes,
    fit_amplitudes,
    given_modes,
    mean_shape,
    principal_deformations,
    split_rigid,
)
from forceid.estimation.body.deforming.strains import strain_shapes
from forceid.motion.pose import exp
from forceid.motion.reading_cov import ReadingCov
from forceid.principal.operator import summation_operator
from forceid.principal.wrench import resultant

free = settings(deadline=None, derandomize=True, max_examples=30)
MASS = np.array([0.2, 0.1, 0.15, 0.05, 0.12, 0.08, 0.1])
SEEN = np.array([True, True, True, True, False, True, False])
RNG = np.random.default_rng(12)
SHAPE = 0.3 * RNG.standard_normal((7, 3))
SHAPE -= MASS @ SHAPE / MASS.sum()
GAUGES = {"mass": MASS, "euclidean": np.ones(7), "sensor": SEEN.astype(float)}
SIGMA = 1e-3
WHITE = ReadingCov(np.full(21, SIGMA**2), np.zeros((21, 0)))
field = arrays(float, (7, 3), elements=st.floats(-1, 1))


@pytest.mark.parametrize("gauge", GAUGES)
@free
@given(u=field)
def test_deformation_is_orthogonal_to_rigid_motion_in_its_gauge(gauge, u):
    W = GAUGES[gauge]
    R = summation_operator(SHAPE)
    alpha, u_d = split_rigid(u, SHAPE, W)
    np.testing.assert_allclose(R.T @ (np.repeat(W, 3) * u_d.ravel()), 0, atol=1e-12)
    np.testing.assert_allclose(R @ alpha + u_d.ravel(), u.ravel(), atol=1e-12)
    np.testing.assert_allclose(split_rigid(u_d, SHAPE, W)[0], 0, atol=1e-11)


def test_gauges_disagree_on_the_mean_motion_of_the_same_displacement():
    u = RNG.standard_normal((7, 3))
    alpha = [split_rigid(u, SHAPE, weight)[0] for weight in GAUGES.values()]
    assert min(abs(a - b).max() for a, b in zip(alpha, alpha[1:] + alpha[:1], strict=True)) > 0.01


@free
@given(acceleration=field)
def test_in_the_mass_gauge_the_mean_motion_alone_gives_the_resultant(acceleration):
    """S^T M u'' = M_alpha alpha'': principal equations 2.5."""
    alpha, _ = split_rigid(acceleration, SHAPE, MASS)
    S = summation_operator(SHAPE)
    M_alpha = S.T @ (np.repeat(MASS, 3)[:, None] * S)
    wanted = resultant(MASS, SHAPE, acceleration, about=np.zeros(3))
    np.testing.assert_allclose(M_alpha @ alpha, wanted, atol=1e-12)


def test_in_the_other_gauges_the_mean_motion_alone_misses_the_resultant():
    acceleration = np.random.default_rng(0).standard_normal((7, 3))
    S = summation_operator(SHAPE)
    M_alpha = S.T @ (np.repeat(MASS, 3)[:, None] * S)
    wanted = resultant(MASS, SHAPE, acceleration, about=np.zeros(3))
    for gauge in ("euclidean", "sensor"):
        alpha, _ = split_rigid(acceleration, SHAPE, GAUGES[gauge])
        assert abs(M_alpha @ alpha - wanted).max() > 0.05 * abs(wanted).max()


def test_split_takes_a_whole_record_as_it_takes_each_frame():
    u = RNG.standard_normal((5, 7, 3))
    alpha, u_d = split_rigid(u, SHAPE, MASS)
    for k in range(5):
        one = split_rigid(u[k], SHAPE, MASS)
        np.testing.assert_allclose(alpha[k], one[0], atol=1e-13)
        np.testing.assert_allclose(u_d[k], one[1], atol=1e-13)


def planted():
    shape = split_rigid(np.random.default_rng(2).standard_normal((7, 3)), SHAPE, np.ones(7))[1]
    return shape / np.linalg.norm(shape)


def test_planted_mode_is_found_with_its_variance():
    rng = np.random.default_rng(0)
    q = 5 * SIGMA * rng.standard_normal(800)
    residual = q[:, None, None] * planted() + SIGMA * rng.standard_normal((800, 7, 3))
    residual[rng.random((800, 7)) < 0.02] = np.nan
    shapes, variance = principal_deformations(residual, SIGMA**2)
    assert len(shapes) == 1
    assert abs(np.vdot(shapes[0], planted())) > 0.995
    assert abs(variance[0] / (5 * SIGMA) ** 2 - 1) < 0.2


@pytest.mark.parametrize("frames", [60, 400, 3000])
def test_white_noise_shows_no_mode_in_nineteen_of_twenty_records(frames):
    found = [
        len(principal_deformations(SIGMA * rng.standard_normal((frames, 7, 3)), SIGMA**2)[0])
        for rng in map(np.random.default_rng, range(100))
    ]
    assert np.mean(np.array(found) == 0) >= 0.95


def test_record_without_a_whole_frame_shows_no_mode():
    residual = np.full((10, 7, 3), np.nan)
    assert principal_deformations(residual, 1.0)[0].shape == (0, 7, 3)


def test_few_frames_show_no_more_shapes_than_there_are_frames():
    residual = 1e-3 * np.random.default_rng(5).standard_normal((4, 30, 3))
    shapes, var = principal_deformations(residual, 1e-8, most=8)
    assert len(shapes) == len(var) == 4
    flat = shapes.reshape(4, -1)
    np.testing.assert_allclose(flat @ flat.T, np.eye(4), atol=1e-9)
    still = principal_deformations(np.zeros((4, 30, 3)), 1e-8, most=8)
    assert len(still[0]) == len(still[1]) == 0


def test_amplitudes_are_free_of_pose_errors_and_unknown_where_not_determined():
    rng = np.random.default_rng(9)
    q = 0.01 * rng.standard_normal((300, 1))
    R = summation_operator(SHAPE)
    rigid = (R @ (1e-3 * rng.standard_normal((6, 300)))).T.reshape(300, 7, 3)
    residual = q[..., None] * planted() + rigid
    residual[:100, 3] = np.nan
    residual[100:200, 2:] = np.nan
    fitted, var = fit_amplitudes(residual, planted()[None], R, WHITE)
    known = np.r_[0:100, 200:300]
    np.testing.assert_allclose(fitted[known], q[known], atol=1e-12)
    assert np.isnan(fitted[100:200]).all()
    assert np.isnan(var[100:200]).all()
    assert var[0, 0] > var[250, 0]  # fewer markers, more noise


def test_variance_of_amplitudes_is_what_monte_carlo_finds():
    residual = SIGMA * np.random.default_rng(1).standard_normal((5000, 7, 3))
    residual[:, 5] = np.nan
    shapes = np.stack([planted(), strain_shapes(SHAPE, np.eye(3))[0]])
    q, var = fit_amplitudes(residual, shapes, summation_operator(SHAPE), WHITE)
    np.testing.assert_allclose(q.var(axis=0) / var[0], 1, atol=0.08)


def spinning(shape, count=200, seed=0):
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 1, count)
    R = exp(time[:, None] * np.array([1.0, -2.0, 40.0]))
    return np.einsum("tab,nb->tna", R, shape) + rng.standard_normal((count, 1, 3))


def test_changed_spinning_shape_is_recovered():
    changed = SHAPE + split_rigid(0.01 * RNG.standard_normal((7, 3)), SHAPE, MASS)[1]
    x = spinning(changed) + 1e-4 * np.random.default_rng(5).standard_normal((200, 7, 3))
    x[::3, 2] = np.nan
    found = mean_shape(x, SHAPE, MASS)
    _, off = split_rigid(found - changed, SHAPE, MASS)  # up to a rotation of the body axes, of second order
    assert abs(off).max() < 5 * 1e-4 / np.sqrt(130)


def test_node_never_seen_keeps_its_reference_position():
    x = spinning(SHAPE)
    x[:, 4] = np.nan
    weight = np.where(np.arange(7) == 4, 0.0, MASS)
    found = mean_shape(x, SHAPE, weight)
    np.testing.assert_array_equal(found[4], SHAPE[4])
    np.testing.assert_allclose(found, SHAPE, atol=1e-9)


def test_marker_seen_only_while_another_is_lost_does_not_poison_the_mean_shape():
    x = spinning(SHAPE)
    x[:100, 0] = np.nan
    x[100:, 4] = np.nan
    weight = np.where(np.arange(7) == 4, 0.0, MASS)
    found = mean_shape(x, SHAPE, weight)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, SHAPE, atol=1e-9)


def bar_stiffness(position):
    """Every two nodes joined by an axial spring of 100 N/m: stiffness (dof, dof) of a free body."""
    n = len(position)
    K = np.zeros((3 * n, 3 * n))
    for a in range(n):
        for b in range(a):
            e = (position[a] - position[b]) / np.linalg.norm(position[a] - position[b])
            row = np.zeros((n, 3))
            row[a], row[b] = e, -e
            K += 100.0 * np.outer(row, row)
    return K


def test_elastic_modes_are_those_of_the_generalized_eigenproblem():
    K, M = bar_stiffness(SHAPE), np.diag(np.repeat(MASS, 3))
    modes = elastic_modes(MASS, K, SHAPE)
    squared, vectors = eigh(K, M)
    np.testing.assert_allclose(1 / modes.compliance, squared[6:], rtol=1e-9)
    flat = modes.shape.reshape(15, -1)
    np.testing.assert_allclose(np.abs(flat @ M @ vectors[:, 6:]), np.eye(15), atol=1e-7)
    np.testing.assert_allclose(summation_operator(SHAPE).T @ M @ flat.T, 0.0, atol=1e-13)


def test_node_without_mass_follows_its_springs_and_makes_no_mode():
    K, mass = bar_stiffness(SHAPE), np.where(np.arange(7) == 2, 0.0, MASS)
    modes = elastic_modes(mass, K, SHAPE)
    assert len(modes.shape) == 12
    np.testing.assert_allclose((modes.shape.reshape(12, -1) @ K)[:, 6:9], 0.0, atol=1e-8)


def test_modes_given_in_any_scale_and_gauge_are_the_same_modes():
    modes = elastic_modes(MASS, bar_stiffness(SHAPE), SHAPE)
    rigid = (summation_operator(SHAPE) @ RNG.standard_normal((6, 15))).T.reshape(modes.shape.shape)
    given_hz = 1 / (2 * np.pi * np.sqrt(modes.compliance))
    found = given_modes(3.0 * modes.shape + rigid, given_hz, MASS, SHAPE)
    np.testing.assert_allclose(found.shape, modes.shape, atol=1e-10)
    np.testing.assert_allclose(found.compliance, modes.compliance, rtol=1e-12)
    assert given_modes(modes.shape, None, MASS, SHAPE).compliance is None


def test_two_planted_modes_are_told_from_the_others_by_five_markers():
    modes = elastic_modes(MASS, bar_stiffness(SHAPE), SHAPE)
    unit = modes.shape / np.linalg.norm(modes.shape, axis=(1, 2))[:, None, None]
    rng = np.random.default_rng(4)
    q = SIGMA * rng.standard_normal((800, 2)) * [4.0, 6.0]
    u = np.tensordot(q, unit[[0, 2]], 1) + SIGMA * rng.standard_normal((800, 7, 3))
    shown = observed_shapes(SEEN, SHAPE, unit)
    y, D = shown.of(u), shown.of(unit)
    assert D.shape == (15, 9)
    kept, var = observable_modes(y.T @ y / 800, 800, D, SIGMA**2)
    assert kept.tolist() == [0, 2]
    np.testing.assert_allclose(np.sqrt(var) / SIGMA, [4.0, 6.0], rtol=0.15)
    assert len(observable_modes(y.T @ y / 800, 800, D, SIGMA**2, most=1)[0]) == 1


def test_unmarked_nodes_bend_with_the_spin_of_the_body():
    # about a principal axis: a spin that no moment need hold
    K, spin = bar_stiffness(SHAPE), 1.5 * np.linalg.eigh(SHAPE.T * MASS @ SHAPE)[1][:, 2]
    modes = elastic_modes(MASS, K, SHAPE)
    pull = MASS[:, None] * -np.cross(spin, np.cross(spin, SHAPE))
    u = np.linalg.lstsq(K, pull.ravel(), rcond=1e-10)[0].reshape(7, 3)
    bent = SHAPE + split_rigid(u, SHAPE, MASS)[1]
    time = np.arange(200) * 2e-3
    R = exp(time[:, None] * (exp(np.array([[0.2, 0.1, 0.4]])) @ spin))
    R = R @ exp(np.array([[0.2, 0.1, 0.4]]))
    x = np.einsum("tab,nb->tna", R, bent) + 1e-7 * np.random.default_rng(3).standard_normal((200, 7, 3))
    x[:, ~SEEN] = np.nan
    found = deflected_shape(time, x, SHAPE, modes, MASS, SEEN.astype(float), 1e-14)
    assert np.abs(u).max() > 1e-4
    assert np.abs(found - bent).max() < 0.02 * np.abs(bent - SHAPE).max()
    np.testing.assert_allclose(MASS @ found, 0.0, atol=1e-12)
