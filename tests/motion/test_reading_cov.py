import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.motion import ReadingCov, fit_pose, pose_gain
from forceid.principal import summation_operator


def drawn(seed):
    """A body of some markers at random, and what they are off by: each for itself, and many together."""
    rng = np.random.default_rng(seed)
    nodes, common = int(rng.integers(5, 12)), int(rng.integers(0, 6))
    white = 10 ** rng.uniform(-8, -6, 3 * nodes)
    together = 10 ** rng.uniform(-5, -1) * rng.standard_normal((3 * nodes, common))
    return rng, rng.uniform(-0.2, 0.2, (nodes, 3)), ReadingCov(white, together)


@pytest.mark.parametrize("seed", range(20))
def test_errors_whitened_and_read_are_those_times_the_inverse_of_their_covariance(seed):
    rng, shape, cov = drawn(seed)
    V = np.diag(cov.white) + cov.together @ cov.together.T
    e = rng.standard_normal((4, shape.size)) @ np.linalg.cholesky(V).T
    exact = np.linalg.solve(V, e.T).T
    off = np.abs(cov.reading(cov.whitened(e)) - exact).max()
    assert off < 10 * np.finfo(float).eps * np.linalg.cond(V) * np.abs(exact).max()
    np.testing.assert_allclose((cov.whitened(e) ** 2).sum(1), (e * exact).sum(1), rtol=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_a_pose_under_errors_of_many_together_is_that_of_generalized_least_squares(seed):
    rng, shape, cov = drawn(100 + seed)
    seen, S = rng.random(len(shape)) < 0.8, summation_operator(shape)
    seen[:4] = True
    own = np.where(rng.random(len(shape)) < 0.3, 1e-5, 0.0)
    rows = np.repeat(seen, 3)
    V = (np.diag(cov.white + np.repeat(own, 3)) + cov.together @ cov.together.T)[np.ix_(rows, rows)]
    root = np.linalg.cholesky(V)
    unit = np.linalg.solve(root, S[rows])
    C = np.linalg.inv(unit.T @ unit)
    gain, found, _ = pose_gain(S, seen, cov, own)
    np.testing.assert_allclose(found, C, rtol=1e-6, atol=1e-9 * np.abs(C).max())
    exact = C @ np.linalg.solve(root.T, unit).T
    np.testing.assert_allclose(gain, exact, atol=1e-6 * np.abs(exact).max())


def test_a_covariance_is_the_same_told_as_a_matrix_or_by_its_parts():
    rng, shape, cov = drawn(3)
    R = Rotation.from_rotvec(rng.standard_normal((10, 3))).as_matrix()
    x = np.einsum("tab,nb->tna", R, shape) + 1e-3 * rng.standard_normal((10, *shape.shape))
    matrix = np.diag(cov.white) + cov.together @ cov.together.T
    by_parts, by_matrix = (fit_pose(x, shape, np.ones(len(shape)), c) for c in (cov, matrix))
    for name in ("center", "rotation", "cov", "chi_square"):
        np.testing.assert_allclose(getattr(by_matrix, name), getattr(by_parts, name), rtol=1e-6, atol=1e-9)
