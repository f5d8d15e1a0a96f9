"""A moment shakes with its arms: what forces on points that deform may make of it, unseen."""

from dataclasses import dataclass

import numpy as np

from forceid.estimation.loads.hidden.deforming_body import fast_square, widened_by_arms


@dataclass(frozen=True)
class Mass:
    """What of the mass of a body arms are weighed by."""

    weight: np.ndarray


@dataclass(frozen=True)
class Kin:
    """What of the kinematics of a body its arms come from."""

    time: np.ndarray
    shape: np.ndarray
    shapes: np.ndarray
    seen: np.ndarray
    inertia: Mass
    elastic: object = None
    markers: object = object()


@dataclass(frozen=True)
class State:
    """What of the state of a flight arms shake."""

    rotation: np.ndarray
    moment: np.ndarray
    wrench_cov: np.ndarray


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


def test_forces_on_drawn_masses_that_bend_shake_the_moment_by_what_is_claimed():
    rng = np.random.default_rng(2)
    time, X = np.arange(400) / 200, rng.uniform(-0.2, 0.2, (12, 3)) * [1, 0.5, 0.01]
    weight = rng.uniform(0.5, 1.0, 12)
    X -= weight @ X / weight.sum()
    bent = rng.standard_normal((2, 12, 3)) * X[:, :1] ** 2  # no part of it stretches or turns
    q = 0.1 * np.stack([np.sin(2 * np.pi * 30 * time), np.cos(2 * np.pi * 47 * time)], 1)
    q += np.sin(2 * np.pi * 2 * time)[:, None]  # slow, and followed
    kin = Kin(time, X, bent, np.ones(12, bool), Mass(weight))
    f = np.sqrt(weight)[:, None] * rng.standard_normal((20_000, 12, 3))  # alike on all masses, and steady
    moment = np.cross(X, f).sum(1)
    state = State(np.tile(np.eye(3), (400, 1, 1)), moment, np.zeros((400, 6, 6)))
    found = widened_by_arms(state, kin, q, 10.0).wrench_cov
    fast = q - np.sin(2 * np.pi * 2 * time)[:, None]
    moved = np.einsum("tk,kna->tna", fast[50::7], bent)
    shaken = np.cross(moved[:, None], f[:2000]).sum(2).reshape(-1, 3)
    np.testing.assert_allclose(found[0, 3:, 3:], np.cov(shaken.T), atol=0.05 * np.trace(found[0, 3:, 3:]))
    assert not found[:, :3].any()


def test_only_what_is_faster_than_the_band_counts():
    t = np.arange(1000) / 500
    A, B = np.random.default_rng(1).standard_normal((2, 4))
    q = np.outer(np.sin(2 * np.pi * 3 * t), A) + np.outer(np.cos(2 * np.pi * 60 * t), B)
    slow, fast, none = (fast_square(t, q, band) for band in (1.0, 20.0, 90.0))
    np.testing.assert_allclose(slow, 0.5 * (np.outer(A, A) + np.outer(B, B)), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(fast, 0.5 * np.outer(B, B), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(none, 0, atol=1e-6)
