"""A moment shakes with its arms: what forces on points that deform may make of it, unseen."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.estimation.loads.hidden.deforming_body import arms_of, fast_square


@dataclass(frozen=True)
class Mass:
    """What of the mass of a body arms are weighed by."""

    weight: np.ndarray


@dataclass(frozen=True)
class Kin:
    """What of the kinematics of a body its arms come from."""

    shape: np.ndarray
    shapes: np.ndarray
    seen: np.ndarray
    elastic: object
    inertia: Mass


def test_variance_is_that_of_the_moment_of_drawn_first_moments_on_moving_arms():
    rng = np.random.default_rng(0)
    dG, arm = 0.1 * rng.standard_normal((3, 3)), np.array([0.3, 0.2, 0.02])  # m: nodes of a plate
    K = rng.standard_normal((200_000, 3, 3)) * arm  # forces alike
    N = K @ dG.T
    shaken = np.stack([N[:, 2, 1] - N[:, 1, 2], N[:, 0, 2] - N[:, 2, 0], N[:, 1, 0] - N[:, 0, 1]], 1)
    moment = np.stack([K[:, 2, 1] - K[:, 1, 2], K[:, 0, 2] - K[:, 2, 0], K[:, 1, 0] - K[:, 0, 1]], 1)
    M = (dG * arm**2) @ dG.T
    claimed = (moment**2).sum(1).mean() / (2 * arm @ arm) * (np.trace(M) * np.eye(3) - M)
    np.testing.assert_allclose(np.cov(shaken.T), claimed, atol=0.02 * np.trace(M))


def test_a_plate_moves_its_arms_by_no_more_than_its_nodes_move():
    rng = np.random.default_rng(2)
    X = rng.uniform(-0.2, 0.2, (40, 3)) * [1, 1, 1e-3]
    X -= X.mean(0)
    bent = np.zeros((1, 40, 3))
    bent[0, :, 2] = X[:, 0] ** 2 - X[:, 1] ** 2
    few = rng.permutation(40) < 5
    weight = rng.uniform(0.5, 1.0, 40)
    for told, elastic in ((few, None), (few, object())):
        kin = Kin(X - weight @ X / weight.sum(), bent, told, elastic, Mass(weight))
        arms, square = arms_of(kin)
        own = told | (elastic is not None)
        moved = (weight[own, None] * bent[0, own] ** 2).sum()
        assert np.sum(arms**2) <= moved * (1 + 1e-9)
        assert square == np.trace((weight[own] * kin.shape[own].T) @ kin.shape[own])


def test_only_what_is_faster_than_the_band_counts_and_turns_with_the_body():
    t = np.arange(1000) / 500
    A, B = np.random.default_rng(1).standard_normal((2, 3, 3))
    strain = np.sin(2 * np.pi * 3 * t)[:, None, None] * A + np.cos(2 * np.pi * 60 * t)[:, None, None] * B
    R = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    slow, fast, none = (fast_square(t, strain, band) for band in (1.0, 20.0, 90.0))
    np.testing.assert_allclose(slow, 0.5 * (A @ A.T + B @ B.T), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(fast, 0.5 * B @ B.T, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(none, 0, atol=1e-6)
    np.testing.assert_allclose(fast_square(t, R @ strain, 20.0), R @ fast @ R.T, atol=1e-9)
