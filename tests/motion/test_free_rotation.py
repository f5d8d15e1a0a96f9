"""The turn of a free body over a step, against a fine integration of its equations and closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from forceid.estimation.loads.channels import angular_channel
from forceid.motion.free_rotation import free_turn, momentum_between

J = np.diag([6e-4, 1.1e-3, 1.5e-3])


def tumble(time, R0, H):
    """Rotations (time, 3, 3) of a free top with momentum H, by DOP853."""

    def rate(t, y):
        R = y.reshape(3, 3)
        return np.cross(R @ np.linalg.solve(J, R.T @ H), R, axisb=0, axisc=0).ravel()

    y = solve_ivp(rate, time[[0, -1]], R0.ravel(), "DOP853", time, rtol=1e-11, atol=1e-12).y.T
    return y.reshape(-1, 3, 3)


def flying(share, step=0.01, count=20):
    """A body that turns by about a share of half a turn a step, and wobbles."""
    R0 = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    H = R0 @ J @ [3.0, 5.0, share * np.pi / step]
    time = step * np.arange(count)
    return time, tumble(time, R0, H), H


def still(count):
    return np.tile(J, (count, 1, 1)), np.zeros((count, 3))


def test_a_free_body_turns_as_its_equations_say_and_the_derivatives_are_those_of_the_turn():
    time, R, H = flying(0.9, count=2)
    step, JJ, h = np.diff(time), *still(1)
    to, by_R, by_H = free_turn(step, R[:1], H[None], JJ, h)
    np.testing.assert_allclose(to[0], R[1], atol=2e-6)
    for k in range(3):
        for by, nudged in (
            (by_R, (Rotation.from_rotvec(1e-6 * np.eye(3)[k]).as_matrix() @ R[:1], H[None])),
            (by_H, (R[:1], H[None] + 1e-6 * np.eye(3)[k])),
        ):
            moved = free_turn(step, *nudged, JJ, h)[0]
            theta = Rotation.from_matrix(moved @ to.swapaxes(1, 2)).as_rotvec()[0] / 1e-6
            np.testing.assert_allclose(by[0, :, k], theta, atol=5e-3 * np.abs(by[0]).max())


@pytest.mark.parametrize("width", [0.3, 0.1, 0.05])
def test_what_an_error_makes_of_the_turn_of_a_slender_body_is_known_to_a_thousandth(width):
    """A rod that tumbles by 0.2 rad in a step, whose errors swing by up to 4 rad in it."""
    inertia = np.diag([width**2, 1.0, 1.0])[None]
    step, R = np.array([0.01]), Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()[None]
    H = (R @ [0.5 * width**2, 20.0, 1.0])[0]
    by_R = free_turn(step, R, H[None], inertia, np.zeros((1, 3)))[1]
    moved = np.empty((3, 3))
    for k, nudge in enumerate(Rotation.from_rotvec(1e-7 * np.eye(3)).as_matrix()):
        turned = [free_turn(step, way @ R, H[None], inertia, np.zeros((1, 3)))[0] for way in (nudge, nudge.T)]
        moved[:, k] = Rotation.from_matrix(turned[0] @ turned[1].mT).as_rotvec()[0] / 2e-7
    assert np.abs(moved).max() > 0.5 / width  # along the rod the error grows
    np.testing.assert_allclose(by_R[0], moved, atol=2e-3 * np.abs(moved).max())


@pytest.mark.parametrize("share", [0.1, 0.7, 0.95])
def test_momentum_between_frames_is_that_of_the_body_up_to_half_a_turn(share):
    time, R, H = flying(share)
    found = momentum_between(time, R, *still(len(R)))[0]
    np.testing.assert_allclose(found, np.broadcast_to(H, found.shape), atol=1e-4 * np.linalg.norm(H))


def test_across_a_gap_the_body_turns_as_often_as_on_both_sides():
    time, R, H = flying(0.6)
    kept = np.r_[0:8, 12:20]  # 2.4 half turns in one step
    found = momentum_between(time[kept], R[kept], *still(len(kept)))[0]
    np.testing.assert_allclose(found, np.broadcast_to(H, found.shape), atol=1e-4 * np.linalg.norm(H))


def test_across_a_gap_momentum_is_found_where_noise_turns_the_body_more_than_it_turns_by_itself():
    rng, (time, R, H) = np.random.default_rng(11), flying(0.002, count=200)
    R = Rotation.from_rotvec(0.05 * rng.standard_normal((len(R), 3))).as_matrix() @ R
    kept = np.flatnonzero(np.arange(len(R)) % 5 != 3)  # one in five is gone
    H, _, _ = momentum_between(time[kept], R[kept], *still(len(kept)))
    reached = free_turn(np.diff(time[kept]), R[kept][:-1], H, *still(len(kept) - 1))[0]
    missed = Rotation.from_matrix(R[kept][1:] @ reached.swapaxes(1, 2)).magnitude()
    assert missed.max() < 1e-6


def test_the_first_moment_of_a_free_body_grows_evenly_however_far_it_turns():
    time, R, H = flying(0.9)
    C = np.tile(1e-8 * np.eye(3), (len(R), 1, 1))
    channel = angular_channel(time, R, C, *still(len(R)))
    np.testing.assert_allclose(channel.z, time[:, None] * H, atol=1e-4 * np.linalg.norm(H) * time[-1])


@pytest.mark.long
def test_the_noise_of_the_first_moment_is_what_its_covariances_say():
    rng, (time, R, H) = np.random.default_rng(3), flying(0.6, count=25)
    C, ends = np.tile(1e-6 * np.eye(3), (len(R), 1, 1)), []
    for _ in range(30):
        noisy = Rotation.from_rotvec(1e-3 * rng.standard_normal((len(R), 3))).as_matrix() @ R
        channel = angular_channel(time, noisy, C, *still(len(R)))
        ends.append(channel.z[-1] - time[-1] * H)
    claimed = np.trace(channel.drift) * time[-1] + np.trace(channel.noise_cov[-1])
    assert np.mean(np.sum(np.square(ends), 1)) == pytest.approx(claimed, rel=0.45)
