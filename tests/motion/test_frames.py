"""Six numbers and m more of every frame, against least squares of pose and amplitudes together."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.motion.frames import fit_frames, fit_pose, poses_about, second_order
from forceid.motion.pose import log
from forceid.principal.operator import summation_operator

SIGMA = 1e-4
SHAPE = 0.2 * np.random.default_rng(1).standard_normal((6, 3))
SHAPES = np.random.default_rng(2).standard_normal((2, 6, 3)) / np.sqrt(18)
NOISE = SIGMA**2 * np.eye(18)


def seen(frames, rng, lost=()):
    """Markers of frames that turn and bend, with the truth: center, rotation, amplitudes."""
    R = Rotation.random(frames, random_state=rng).as_matrix()
    c, q = rng.standard_normal((frames, 3)), 5e-4 * rng.standard_normal((frames, 2))
    body = SHAPE + np.einsum("tk,kna->tna", q, SHAPES)
    x = c[:, None] + body @ R.swapaxes(1, 2) + SIGMA * rng.standard_normal((frames, 6, 3))
    x[:, list(lost)] = np.nan
    return x, c, R, q


def fitted(x):
    pose = fit_pose(x, SHAPE, np.ones(6), NOISE + 1e-8 * np.eye(18))
    return fit_frames(x, pose, SHAPE, SHAPES, NOISE)


@pytest.mark.parametrize("lost", [(), (4,)])
def test_frames_hold_the_information_of_the_joint_fit(lost):
    x, _, R, _ = seen(1, np.random.default_rng(0), lost)
    frames = fitted(x)
    rows = np.repeat(np.isfinite(x[0]).all(1), 3)
    G = np.concatenate([summation_operator(SHAPE), SHAPES.reshape(2, -1).T], 1)[rows]
    wanted = np.linalg.inv(G.T @ G / SIGMA**2)
    turn = np.eye(8)
    turn[:3, :3] = turn[3:6, 3:6] = R[0].T
    H = np.block([[np.eye(6), frames.leak[0]], [np.zeros((2, 6)), frames.rows[0]]])
    cov = np.zeros((8, 8))
    cov[:6, :6], cov[6:, 6:] = frames.cov[0], np.eye(2)
    found = turn @ np.linalg.inv(H.T @ np.linalg.solve(cov, H)) @ turn.T
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-3 * np.abs(wanted).max())


@pytest.mark.parametrize("lost", [(), (4,)])
def test_errors_of_frames_are_those_claimed(lost):
    x, c, R, q = seen(4000, np.random.default_rng(5), lost)
    frames = fitted(x)
    pose = np.concatenate([frames.center - c, log(frames.rotation @ R.swapaxes(1, 2))], 1)
    pose = pose - np.einsum("tik,tk->ti", frames.leak, q)
    told = frames.observed - np.einsum("tij,tj->ti", frames.rows, q)
    white = np.linalg.solve(np.linalg.cholesky(frames.cov), pose[..., None])[..., 0]
    both = np.concatenate([white, told], 1)
    np.testing.assert_allclose(both.T @ both / len(both), np.eye(8), atol=0.1)


def test_frames_that_show_fewer_amplitudes_tell_what_they_show():
    shapes = np.random.default_rng(2).standard_normal((5, 6, 3))
    x, *_ = seen(3, np.random.default_rng(0), lost=(0, 1, 2))
    pose = fit_pose(x, SHAPE, np.ones(6), NOISE + 1e-8 * np.eye(18))
    frames = fit_frames(x, pose, SHAPE, shapes, NOISE)
    assert np.isfinite(frames.observed).sum(1).tolist() == [3, 3, 3]  # nine coordinates less six of the pose
    assert np.isfinite(frames.leak).all()


def test_about_a_path_that_is_known_errors_are_as_claimed_however_far_they_turn_a_frame():
    rng = np.random.default_rng(7)
    thin = np.stack([np.full(6, 0.2), np.linspace(-0.1, 0.1, 6), 5e-4 * rng.standard_normal(6)], 1)
    frames = 4000
    R, c = Rotation.random(frames, random_state=rng).as_matrix(), rng.standard_normal((frames, 3))
    x = c[:, None] + thin @ R.swapaxes(1, 2) + SIGMA * rng.standard_normal((frames, 6, 3))
    alone = fit_pose(x, thin, np.ones(6), NOISE)
    about = poses_about(alone, x, thin, np.ones(6), NOISE, (c, R))

    def square(pose):
        error = np.concatenate([pose.center - c, log(pose.rotation @ R.swapaxes(1, 2))], 1)
        return np.einsum("ta,ta->t", error, np.linalg.solve(pose.cov, error[..., None])[..., 0]).mean()

    assert square(about) == pytest.approx(6.0, abs=4 * np.sqrt(12 / frames))
    assert square(alone) > 12.0
    assert np.median(second_order(alone.cov)) > 1.0
