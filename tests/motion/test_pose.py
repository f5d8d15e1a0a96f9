import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from evidence.races.rotations import ill_conditioned_errors, our_fit
from forceid.estimation.body.deforming.modes import split_rigid
from forceid.motion import pose as pose_module
from forceid.motion.frames import fit_pose
from forceid.motion.pose import exp, fit_rotation, log, pose_rank
from forceid.motion.reading_cov import ReadingCov
from forceid.principal.operator import summation_operator

free = settings(deadline=None, derandomize=True, max_examples=60)
MASS = np.array([0.2, 0.1, 0.15, 0.05, 0.12, 0.08])
SHAPE = np.array(
    [[0.3, 0, 0], [0, 0.2, 0.1], [-0.2, 0.1, 0], [0, -0.3, 0.1], [0.1, 0.1, -0.2], [-0.1, 0, 0.2]]
)
SHAPE -= MASS @ SHAPE / MASS.sum()
SIGMA = 1e-3
WHITE = SIGMA**2 * np.eye(18)
vector = st.lists(st.floats(-3, 3), min_size=3, max_size=3).map(np.array)


def place(shape, turn, center):
    return center[..., None, :] + np.einsum("...ab,...nb->...na", exp(turn), shape)


def random_poses(count, seed=0):
    rng = np.random.default_rng(seed)
    return exp(2 * rng.standard_normal((count, 3))), rng.standard_normal((count, 3)), rng


@free
@given(st.sets(st.integers(0, 5), min_size=3), vector, vector)
def test_pose_is_recovered_exactly_from_any_markers_that_fix_it(markers, turn, center):
    seen = sorted(markers)
    assume(pose_rank(summation_operator(SHAPE[seen])) == 6)
    x = np.full((1, 6, 3), np.nan)
    x[0, seen] = place(SHAPE, turn, center)[seen]
    pose = fit_pose(x, SHAPE, MASS, WHITE)
    np.testing.assert_allclose(pose.center[0], center, atol=1e-10)
    np.testing.assert_allclose(pose.rotation[0], exp(turn), atol=1e-10)
    np.testing.assert_allclose(pose.residual[0, seen], 0, atol=1e-10)
    assert pose.dof[0] == 3 * len(seen) - 6
    assert np.linalg.eigvalsh(pose.cov[0]).min() > 0


def test_rotation_is_that_of_scipy_align_vectors():
    R, c, rng = random_poses(50)
    x = np.einsum("tab,nb->tna", R, SHAPE) + c[:, None] + 0.05 * rng.standard_normal((50, 6, 3))
    center, rotation = fit_rotation(x, SHAPE, MASS)
    middle = np.einsum("n,tna->ta", MASS, x) / MASS.sum()
    np.testing.assert_allclose(center, middle, atol=1e-12)
    for k in range(50):
        wanted = Rotation.align_vectors(x[k] - middle[k], SHAPE, weights=MASS)[0].as_matrix()
        np.testing.assert_allclose(rotation[k], wanted, atol=1e-10)


@pytest.mark.parametrize("nodes", [[0, 1, 2], [0, 1, 2, 3], [0, 1, 2, 3, 4, 5]])
def test_planar_and_mirrored_sets_give_a_proper_rotation(nodes):
    R, c, _ = random_poses(40)
    flat, mass = SHAPE[nodes] * [1, 1, 0], MASS[nodes]
    x = np.einsum("tab,nb->tna", R, flat) + c[:, None]
    np.testing.assert_allclose(fit_rotation(x, flat, mass)[1], R, atol=1e-9)
    mirrored = np.einsum("tab,nb->tna", R, SHAPE[nodes] * [1, 1, -1]) + c[:, None]
    rotation = fit_rotation(mirrored, SHAPE[nodes], mass)[1]
    np.testing.assert_allclose(np.linalg.det(rotation), 1, atol=1e-12)


def test_collinear_and_missing_markers_leave_the_pose_unknown():
    line = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.25, 0, 0]])
    R, c, _ = random_poses(3)
    x = np.einsum("tab,nb->tna", R, line) + c[:, None]
    x = np.concatenate([x, np.full((1, 3, 3), np.nan)])
    pose = fit_pose(x, line, np.ones(3), np.eye(9))
    for found in (pose.center, pose.rotation, pose.cov, pose.chi_square, pose.residual):
        assert np.isnan(found).all()


def test_one_frame_without_a_pose_leaves_the_others_alone():
    R, c, rng = random_poses(5)
    x = np.einsum("tab,nb->tna", R, SHAPE) + c[:, None] + SIGMA * rng.standard_normal((5, 6, 3))
    holed = x.copy()
    holed[2, 2:] = np.nan
    whole, part = fit_pose(x, SHAPE, MASS, WHITE), fit_pose(holed, SHAPE, MASS, WHITE)
    assert np.isnan(part.center[2]).all()
    others = [0, 1, 3, 4]
    np.testing.assert_array_equal(part.center[others], whole.center[others])
    np.testing.assert_array_equal(part.cov[others], whole.cov[others])


@pytest.mark.parametrize("nodes", [[0, 1, 2, 3, 4, 5], [0, 1, 2], [0, 3, 4, 5]])
def test_covariance_is_what_monte_carlo_finds(nodes):
    R, c, rng = random_poses(4000, seed=len(nodes))
    noise = np.linalg.cholesky(0.5 * WHITE + 0.5 * WHITE[0, 0] * np.ones((18, 18))) @ rng.standard_normal(
        (18, 4000)
    )
    body = SHAPE + noise.T.reshape(-1, 6, 3)
    x = np.full((4000, 6, 3), np.nan)
    x[:, nodes] = (np.einsum("tab,tnb->tna", R, body) + c[:, None])[:, nodes]
    pose = fit_pose(x, SHAPE, MASS, 0.5 * WHITE + 0.5 * WHITE[0, 0] * np.ones((18, 18)))
    error = np.concatenate([pose.center - c, log(pose.rotation @ R.swapaxes(1, 2))], 1)
    white = np.einsum("tij,tj->ti", np.linalg.inv(np.linalg.cholesky(pose.cov)), error)
    np.testing.assert_allclose(white.T @ white / 4000, np.eye(6), atol=0.1)  # four of its standard errors
    assert abs(pose.chi_square.mean() / max(pose.dof[0], 1) - 1) < 0.1


def mode():
    """A bending shape in the mass gauge, its largest entry 1."""
    shape = split_rigid(np.random.default_rng(3).standard_normal((6, 3)), SHAPE, MASS)[1]
    return shape / abs(shape).max()


def test_lost_marker_of_a_deforming_body_causes_no_bias_when_the_covariance_knows_the_mode():
    R, c, _ = random_poses(200)
    q = 5e-3 * np.sin(np.arange(200.0))
    x = np.einsum("tab,tnb->tna", R, SHAPE + q[:, None, None] * mode()) + c[:, None]
    x[::2, 4] = np.nan
    noise = 1e-10 * np.eye(18)
    known = fit_pose(x, SHAPE, MASS, noise + 2.5e-5 * np.outer(mode(), mode()))
    naive = fit_pose(x, SHAPE, MASS, noise)

    def error(pose):
        return abs(np.concatenate([pose.center - c, 0.2 * log(pose.rotation @ R.swapaxes(1, 2))], 1)).max()

    assert error(naive) > 5e-4
    assert error(known) < 0.03 * error(naive)  # second order in the deformation


@free
@given(vector, vector)
def test_pose_turns_and_shifts_with_the_world(turn, shift):
    R, c, rng = random_poses(4)
    x = np.einsum("tab,nb->tna", R, SHAPE) + c[:, None] + SIGMA * rng.standard_normal((4, 6, 3))
    x[1, 0] = np.nan
    Q = exp(turn)
    one, other = fit_pose(x, SHAPE, MASS, WHITE), fit_pose(x @ Q.T + shift, SHAPE, MASS, WHITE)
    np.testing.assert_allclose(other.center, one.center @ Q.T + shift, atol=1e-10)
    np.testing.assert_allclose(other.rotation, Q @ one.rotation, atol=1e-10)
    np.testing.assert_allclose(other.residual, one.residual, atol=1e-10)
    np.testing.assert_allclose(other.chi_square, one.chi_square, rtol=1e-7)
    QQ = np.kron(np.eye(2), Q)
    np.testing.assert_allclose(other.cov, QQ @ one.cov @ QQ.T, atol=1e-10 * one.cov.max())


def test_massless_markers_alone_fix_the_pose():
    R, c, _ = random_poses(30)
    x = np.einsum("tab,nb->tna", R, SHAPE) + c[:, None]
    x[:, 0] = np.nan
    pose = fit_pose(x, SHAPE, np.array([1.0, 0.1, 0, 0, 0, 0]), WHITE)
    np.testing.assert_allclose(pose.rotation, R, atol=1e-10)


@pytest.mark.skipif(pose_module.compiled is None, reason="no compiler was here")
@pytest.mark.parametrize("markers", [3, 4, 15])
def test_compiled_poses_are_those_in_numpy(markers, monkeypatch):
    rng = np.random.default_rng(markers)
    X = rng.uniform(-0.2, 0.2, (markers, 3)) * ([1, 1, 0] if markers == 4 else [1, 1, 1])
    R = Rotation.random(300, rng=rng).as_matrix()
    x = (
        rng.standard_normal((300, 1, 3))
        + X @ R.swapaxes(1, 2)
        + 1e-3 * rng.standard_normal((300, markers, 3))
    )
    x[::7, 1], x[5] = np.nan, np.nan
    shape = rng.standard_normal((3 * markers, 2))
    cov = 1e-6 * (np.eye(3 * markers) + (shape @ shape.T if markers == 15 else 0))
    weight = rng.uniform(0, 1, markers)
    ours = fit_pose(x, X, weight, cov)
    monkeypatch.setattr(pose_module, "compiled", None)
    plain = fit_pose(x, X, weight, cov)
    for name in ("center", "rotation", "cov", "residual", "chi_square", "dof"):
        scale = np.nanmax(np.abs(getattr(plain, name)))
        # two Gauss-Newton steps leave the fourth power of the first error
        np.testing.assert_allclose(getattr(ours, name), getattr(plain, name), rtol=0, atol=1e-9 * scale)


@pytest.mark.skipif(pose_module.compiled is None, reason="no compiler was here")
@pytest.mark.parametrize("markers", [3, 7, 40])
def test_compiled_fits_are_those_by_singular_values(markers, monkeypatch):
    """Far from the origin, with gaps, weights of zero, a mirrored frame and one that shows nothing."""
    rng = np.random.default_rng(markers)
    X, weight = rng.standard_normal((markers, 3)), rng.uniform(0.5, 1.5, markers)
    R = Rotation.random(203, rng=rng).as_matrix()
    x = 100.0 + X @ R.mT + 0.05 * rng.standard_normal((203, markers, 3))
    x[1] = 100.0 + X * [-1, 1, 1]
    if markers > 3:
        x[::5, 0], x[2::9, 1, 2], weight[2] = np.nan, np.inf, 0.0
    x[7] = np.nan
    ours = fit_rotation(x, X, weight)
    monkeypatch.setattr(pose_module, "compiled", None)
    plain = fit_rotation(x, X, weight)
    shown = np.arange(203) != 7
    for mine, theirs in zip(ours, plain, strict=True):
        np.testing.assert_allclose(mine[shown], theirs[shown], rtol=0, atol=1e-10)


@pytest.mark.skipif(pose_module.compiled is None, reason="no compiler was here")
def test_the_turn_of_a_thin_set_keeps_its_digits():
    """Where rounding of G costs half a million eps, against the fit in extended precision."""
    assert max(ill_conditioned_errors(our_fit).values()) < 1e-13


@pytest.mark.parametrize("engine", [pose_module.compiled, None])
def test_a_body_stretched_to_a_third_turns_as_its_gauge_says(engine, monkeypatch):
    monkeypatch.setattr(pose_module, "compiled", engine)
    rng = np.random.default_rng(1)
    X, mass = rng.standard_normal((7, 3)), rng.uniform(0.1, 1.0, 7)
    X -= mass @ X / mass.sum()
    E = (mass * X.T) @ X
    F = np.eye(3) + 0.25 * rng.standard_normal((200, 3, 3))
    F = Rotation.random(200, rng=rng).as_matrix() @ F
    F = F[np.linalg.det(F) > 0.2]
    assert np.linalg.svd(F, compute_uv=False).min() < 0.35
    # in the mass gauge maps A with A E symmetric deform, and R is the rotation of F E
    pairs = [(i, j) for i in range(3) for j in range(i + 1)]
    unit = np.eye(3)
    maps = np.array([np.outer(unit[i], unit[j]) + np.outer(unit[j], unit[i]) for i, j in pairs])
    shapes = (X @ (maps @ np.linalg.inv(E)).mT).reshape(6, -1)
    x = 5.0 + np.einsum("tab,nb->tna", F, X)
    found = fit_pose(x, X, mass, 1e-8 * np.eye(21) + 10.0 * shapes.T @ shapes)
    true = np.array([polar(f @ E)[0] for f in F])
    assert np.abs(found.rotation - true).max() < 1e-6
    assert np.abs(found.center - 5.0).max() < 1e-6


@pytest.mark.long
def test_a_frame_that_no_pose_meets_has_the_nearest_and_claims_what_is_left():
    """Three markers and three shapes: of forty bodies, the frames where Newton's steps come to no end."""
    off, met = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        shape, shapes = rng.standard_normal((3, 3)), 0.1 * rng.standard_normal((9, 3))
        shape -= shape.mean(0)
        cov = ReadingCov.of(1e-6 * np.eye(9) + shapes @ shapes.T)
        fit = pose_module.frame_fit(shape, np.ones(3), np.ones(3, bool), cov)
        bent = (rng.standard_normal((200, 3)) @ shapes.T + 1e-3 * rng.standard_normal((200, 9))).reshape(
            -1, 3, 3
        )
        center, R, claimed, residual, _ = pose_module.fitted(fit, shape + bent, np.arange(200))
        error = np.concatenate([center, log(R)], 1)
        left = residual.reshape(200, -1) @ fit.gain[0].T
        own = R.mT @ claimed[:, :3, :3] @ R
        hard = np.trace(own, axis1=1, axis2=2) > np.trace(fit.cov[:3, :3]) * (1 + 1e-9)
        np.testing.assert_allclose(
            own[hard],
            fit.cov[:3, :3] + left[hard, :3, None] * left[hard, None, :3],
            atol=1e-9 * fit.cov.max(),
        )
        off.append(error[hard] / np.sqrt(np.diagonal(claimed[hard], axis1=1, axis2=2)))
        met.append(np.abs(left[~hard]) / np.sqrt(np.diagonal(fit.cov)))
    off, met = np.concatenate(off), np.concatenate(met)
    assert len(off) > 50
    assert (np.median(np.abs(off), 0) < 2.0).all()
    assert met.max() < 2e-3
