"""Bipolar factors over time: through crossings, past near ones, and where there is no continuous answer."""

import numpy as np
import pytest
from crossing_motions import crossing, near_crossings, smooth_without_limit

from forceid.errors import DataError
from forceid.motion.pose import exp
from forceid.pseudorigid.factors.bipolar_path import bipolar_path, turn_of_bases
from forceid.pseudorigid.factors.decomposition import bipolar
from forceid.pseudorigid.factors.matching import nearest_signed

E3 = np.array([0.0, 0.0, 1.0])


def slope_of_crossing(t):
    """F' of the test path, from its factors."""
    hat = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]])
    F, turn, back = crossing(t), exp(t[:, None] * E3), exp(-2 * t[:, None] * E3)
    return hat @ F - 2 * F @ hat + turn @ np.diag([0.5, -0.5, 0]) @ back


@pytest.mark.parametrize("frames", [40, 41, 200, 401])
def test_three_values_cross_and_their_factors_go_on(frames):
    t = np.linspace(-0.2, 0.2, frames)
    path = bipolar_path(crossing(t), slope_of_crossing(t))
    assert path.continuous.all()
    falling, rising = path.D[0].argsort()[[2, 0]]
    np.testing.assert_allclose(path.D[:, rising], 1 + t / 2, rtol=0, atol=1e-14)
    np.testing.assert_allclose(path.D[:, falling], 1 - t / 2, rtol=0, atol=1e-14)
    # the bases are those of the closed form, but for one signed permutation
    Q = exp(-t[:, None] * E3) @ path.L
    np.testing.assert_allclose(Q, np.broadcast_to(Q[0].round(), Q.shape), rtol=0, atol=1e-7)
    np.testing.assert_allclose(path.L * path.D[:, None] @ path.R, crossing(t), rtol=0, atol=1e-14)
    known = path.defined.all(1)
    assert 1 <= (~known).sum() <= 2
    omega = np.einsum("tij,tj->ti", path.L, path.omega)
    lam = np.einsum("tji,tj->ti", path.R, path.lam)
    np.testing.assert_allclose(omega[known], np.tile(E3, (known.sum(), 1)), rtol=0, atol=1e-10)
    np.testing.assert_allclose(lam[known], np.tile(-2 * E3, (known.sum(), 1)), rtol=0, atol=1e-10)
    assert np.isnan(path.omega[~path.defined]).all()
    assert np.isfinite(path.dD).all()


def test_ordered_factors_of_the_same_frames_jump():
    F = crossing(np.linspace(-0.2, 0.2, 40))
    L, _, R = bipolar(F)
    assert np.linalg.norm(turn_of_bases(L, R), axis=1).max() > 0.7
    path = bipolar_path(F)
    assert np.linalg.norm(turn_of_bases(path.L, path.R), axis=1).max() < 1.6 * 0.4 / 39


@pytest.mark.parametrize("frames", [51, 401, 4001])
def test_a_smooth_motion_without_a_continuous_answer_is_flagged_where_it_has_none(frames):
    t = np.linspace(-0.5, 0.5, frames)
    path = bipolar_path(smooth_without_limit(t))
    flagged = ~path.continuous
    assert flagged[np.abs(t) < 0.2].all()
    assert not flagged[np.abs(t) > 0.4].any()
    assert not path.defined[np.abs(t) < 0.1].all(1).any()
    # the values themselves are smooth, and shown to be
    gap = 0.5 * np.exp(-1 / np.maximum(t**2, 1e-3))
    np.testing.assert_allclose(
        np.ptp(path.D[:, :3], axis=1), gap, rtol=0, atol=0.3 * gap.max() if frames < 100 else 1e-11
    )


def test_near_crossings_are_continuous_or_flagged():
    F, miss = near_crossings(600, np.random.default_rng(1))
    path = bipolar_path(F)
    L, D, R = path
    flagged, exact = ~path.continuous.all(1), path.defined.all(-1)
    turn = np.where(path.continuous, np.linalg.norm(turn_of_bases(L, R), axis=-1), 0.0).max(1)
    change = np.linalg.norm(np.diff(F, axis=1), axis=(-2, -1))
    jump = np.linalg.norm(np.diff(D, axis=1), axis=-1) / change
    left = np.linalg.norm(F - L * D[..., None, :] @ R, axis=(-2, -1))
    gap = -np.diff(np.linalg.svd(F, compute_uv=False), axis=-1).min(-1)
    # what is missed by far less than the change between frames is a crossing, by far more is none
    assert not flagged[(miss < 0.1) | (miss > 2.5)].any()
    assert flagged[(miss > 0.4) & (miss < 0.8)].mean() > 0.95
    assert turn.max() <= 0.3
    assert turn[miss < 1e-3].max() < 0.15
    assert jump.max() < 1.5
    assert (left / np.linalg.norm(F, axis=(-2, -1)))[exact].max() < 1e-14
    assert (left / np.maximum(gap, 1e-300))[~exact].max() < 0.05


def test_no_path_takes_another_turn_than_eight_times_as_many_frames_do_and_says_nothing():
    F, _ = near_crossings(500, np.random.default_rng(29), 8 * 47 + 1)
    few, many = bipolar_path(F[:, ::8]), bipolar_path(F)
    sure = few.defined.all(-1) & many.defined.all(-1)[:, ::8]
    G = many.L[:, ::8].swapaxes(-1, -2) @ few.L + many.R[:, ::8] @ few.R.swapaxes(-1, -2)
    number = nearest_signed(G.reshape(-1, 3, 3)).reshape(G.shape[:2])
    first = number[np.arange(len(F)), sure.argmax(1)][:, None]
    changed = (sure & (number != first)).any(1) & many.continuous.all(1) & few.continuous.all(1)
    assert changed.any()  # a pass too near for the frames is read as a crossing, beside a frame without rates
    assert not (changed & few.defined.all((1, 2))).any()


def test_a_path_sampled_finer_goes_through_the_same_bases():
    t = np.linspace(-0.5, 0.5, 33)
    fine = np.linspace(-0.5, 0.5, 32 * 8 + 1)

    def motion(t, miss):
        S = np.tile(np.diag([0.0, 0.0, 0.5]), (len(t), 1, 1))
        S[:, 0, 0], S[:, 1, 1] = 1 + 0.4 * t, 1 - 0.4 * t
        S[:, 0, 1] = S[:, 1, 0] = miss
        return exp(t[:, None] * [0.3, -0.2, 0.5]) @ S @ exp(t[:, None] * [-0.1, 0.6, 0.2])

    for miss in (0.0, 1e-6, 0.06, 0.3):
        coarse, finer = bipolar_path(motion(t, miss)), bipolar_path(motion(fine, miss))
        assert coarse.continuous.all()
        assert finer.continuous.all()
        Q = coarse.L[0].T @ finer.L[0]
        np.testing.assert_allclose(coarse.L @ Q, finer.L[::8], rtol=0, atol=0.02)
        np.testing.assert_allclose(np.abs(coarse.D @ np.abs(Q) - finer.D[::8]).max(), 0, atol=1e-3)


def test_turns_of_a_near_crossing_peak_like_one_over_the_miss():
    rate = []
    for miss in (0.1, 0.03, 0.01):
        t = np.linspace(-0.5, 0.5, 4001)
        F = np.tile(np.diag([0.0, 0.0, 2.0]), (len(t), 1, 1))
        F[:, 0, 0], F[:, 1, 1], F[:, 0, 1], F[:, 1, 0] = 1 + 0.3 * t, 1 - 0.3 * t, miss, miss
        dF = np.broadcast_to(np.diag([0.3, -0.3, 0.0]), F.shape)
        path = bipolar_path(F, dF)
        rate.append(np.abs(path.omega - path.lam).max())
    np.testing.assert_allclose(rate, 0.3 / np.array([0.1, 0.03, 0.01]), rtol=1e-3)


def test_a_rigid_body_keeps_factors_that_turn_no_more_than_it_does():
    t = np.linspace(0, 1, 50)
    F = exp(np.stack([np.sin(t), t**2, -t], 1))
    path = bipolar_path(F)
    assert path.continuous.all()
    assert not path.defined.any()
    step = np.linalg.norm(np.diff(F, axis=0), axis=(1, 2)).max()
    for basis in (path.L, path.R):
        assert np.linalg.norm(np.diff(basis, axis=0), axis=(1, 2)).max() < 1.01 * step
    np.testing.assert_allclose(path.L @ path.R, F, rtol=0, atol=1e-14)


def test_a_spinning_body_is_followed_at_half_a_radian_a_frame():
    t = np.linspace(0, 20, 41)
    F = exp(t[:, None] * E3) @ np.diag([1.1, 1.0, 0.9])
    path = bipolar_path(F, np.cross(E3, F.swapaxes(1, 2)).swapaxes(1, 2))
    assert path.continuous.all()
    assert path.defined.all()
    np.testing.assert_allclose(path.R, np.broadcast_to(path.R[0], F.shape), rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.einsum("tij,tj->ti", path.L, path.omega), np.tile(E3, (41, 1)), atol=1e-12)


def test_a_round_body_that_begins_to_stretch_takes_the_bases_of_its_stretch_from_the_start():
    t = np.linspace(0, 1, 60)
    grown = np.maximum(t - 0.5, 0) ** 2
    Q = exp(np.array([[0.3, 0.7, -0.4]]))[0]
    F = Q @ (np.eye(3) + grown[:, None, None] * np.diag([0.5, 0.2, -0.3])) @ Q.T
    path = bipolar_path(F)
    assert path.continuous.all()
    assert np.linalg.norm(turn_of_bases(path.L, path.R), axis=1).max() < 1e-6
    np.testing.assert_allclose(path.L * path.D[:, None] @ path.R, F, rtol=0, atol=1e-10)


def test_values_that_change_places_are_told_whether_a_frame_falls_on_them_or_not():
    for frames in (40, 41):
        t = np.linspace(-0.2, 0.2, frames)
        path = bipolar_path(crossing(t))
        assert path.crossed.any()
        assert np.abs(t[path.crossed]).max() < 1.1 * (t[1] - t[0])
    F, _ = near_crossings(200, np.random.default_rng(4))
    path = bipolar_path(F)
    order = path.D[:, [0, -1]].argsort(-1)
    swapped = (order[:, 0] != order[:, 1]).any(-1)  # though none of these cross
    assert swapped.sum() > 100
    assert path.crossed[swapped].any(1).all()
    assert not path.crossed[:, 0].any()


def test_paths_side_by_side_are_those_one_by_one():
    F, _ = near_crossings(12, np.random.default_rng(3), frames=20)
    together = bipolar_path(F.reshape(3, 4, 20, 3, 3))
    for k in (0, 5, 11):
        alone = bipolar_path(F[k])
        at = np.unravel_index(k, (3, 4))
        np.testing.assert_allclose(alone.L, together.L[at], rtol=0, atol=1e-12)
        np.testing.assert_array_equal(alone.continuous, together.continuous[at])
        np.testing.assert_array_equal(alone.defined, together.defined[at])


def test_one_frame_is_a_path_and_a_bare_matrix_is_not():
    L, D, R = bipolar_path(np.diag([3.0, 2.0, 1.0])[None])
    np.testing.assert_allclose(L[0] * D[0] @ R[0], np.diag([3.0, 2.0, 1.0]), atol=1e-15)
    with pytest.raises(DataError, match="use bipolar for one frame"):
        bipolar_path(np.eye(3))
    F = np.tile(np.eye(3), (5, 1, 1))
    F[3, 0, 0] = -1
    with pytest.raises(DataError, match=r"F\[3\] has determinant -1"):
        bipolar_path(F)
