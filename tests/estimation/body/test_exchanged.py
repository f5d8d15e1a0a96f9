"""Markers that were taken for each other are put back, however near they are; others stay where they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.drawn.records.walker import walker
from forceid.estimation.body.tracks.exchanged import put_back

NOISE = 3e-4  # m
NEAR = (
    12.0,
    40.0,
)  # distances of the pair over the noise: less than accelerations and noise move a marker by


def tumbling(rng, shape, frames=240):
    """Tracks (time, node, 3) of markers on a body that turns and flies along a parabola."""
    t = np.arange(frames) / 200.0
    turn = Rotation.from_rotvec(np.outer(t, rng.uniform(-20, 20, 3)) + np.sin(5 * t)[:, None]).as_matrix()
    path = np.outer(t, rng.uniform(-3, 3, 3)) - 4.9 * np.outer(t**2, [0, 0, 1])
    x = path[:, None] + np.einsum("tab,nb->tna", turn, shape)
    return x + NOISE * rng.standard_normal(x.shape)


def shape_with_a_near_pair(rng):
    """Six to twelve markers in a box, the first two as near to each other as NEAR says."""
    shape = rng.uniform(-0.1, 0.1, (rng.integers(6, 13), 3))
    way = rng.standard_normal(3)
    shape[1] = shape[0] + way / np.linalg.norm(way) * rng.uniform(*NEAR) * NOISE
    return shape


def traded(x, frames, pair):
    """Tracks of which a pair is exchanged in some frames."""
    out = x.copy()
    out[np.ix_(frames, pair)] = x[np.ix_(frames, pair[::-1])]
    return out


def test_near_markers_are_put_back_in_nearly_all_frames_of_drawn_bodies():
    wrong, before, unchanged = 0, 0, 0
    for seed in range(60):
        rng = np.random.default_rng([1807, seed])
        x = tumbling(rng, shape_with_a_near_pair(rng))
        first, length = rng.integers(0, 150), rng.integers(1, 80)
        y = traded(x, np.arange(first, first + length), [0, 1])
        wrong += int((put_back(y)[0] != x).any((1, 2)).sum())
        before += int(length)
        unchanged += not put_back(x)[1]
    assert unchanged == 60
    assert wrong < 0.02 * before


def test_where_markers_traded_and_traded_back_is_named():
    rng = np.random.default_rng(1)
    y = traded(tumbling(rng, shape_with_a_near_pair(rng)), np.arange(60, 75), [0, 1])
    assert {(one.sample, one.channel) for one in put_back(y)[1]} == {(60, 0), (60, 1), (75, 0), (75, 1)}


def test_markers_that_lie_alike_to_all_others_are_put_back_by_how_they_move():
    rng = np.random.default_rng(2)
    square = 0.1 * np.array([[1.0, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0]])
    x = tumbling(rng, square) * 1.0
    np.testing.assert_array_equal(put_back(traded(x, np.arange(100, 130), [0, 2]))[0], x)


def test_a_pair_traded_for_most_of_a_record_goes_where_the_body_says():
    rng = np.random.default_rng(3)
    shape = rng.uniform(-0.1, 0.1, (6, 3))
    x = tumbling(rng, shape)
    y = traded(x, np.arange(80, 240), [1, 4])
    np.testing.assert_array_equal(put_back(y, shape)[0], x)
    assert not np.array_equal(put_back(y)[0], x)  # where nobody says, most of the record does


@pytest.mark.parametrize("off", [0.004, 0.05, 1.0])
def test_a_wild_marker_is_no_trade(off):
    rng = np.random.default_rng(4)
    x = tumbling(rng, shape_with_a_near_pair(rng))
    x[100:104, 0] += off
    x[30:50, 3] = np.nan
    assert not put_back(x)[1]


@pytest.mark.parametrize("task", ["walk", "squat"])
def test_a_person_who_moves_trades_no_markers(task):
    assert not put_back(walker(1180, task, seconds=2.0).motion.position)[1]


def test_a_body_that_stands_and_then_bends_trades_no_markers():
    rng = np.random.default_rng(5)
    x = tumbling(rng, rng.uniform(-0.1, 0.1, (10, 3)), 300)
    bend = np.clip(np.arange(300) - 200, 0, 60)[:, None, None] / 60 * np.array([0.0, 0.15, 0.1])
    x[:, 5:] += bend
    assert not put_back(x)[1]
