"""Spikes of single markers: found whatever the body does, and nothing else is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from forceid.config import load_settings
from forceid.estimation.body.cleaning import cleaned
from forceid.estimation.body.deformation_residual import beyond_rigid
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.body.tracks.spikes import off_the_shape, spikes
from forceid.records import Body, Motion

NOISE = 3e-4


def tumbling(markers=6, frames=200, turn=0.3, seed=0):
    """A rigid body that turns by `turn` rad a frame and flies, with noise."""
    rng = np.random.default_rng(seed)
    X = rng.uniform(-0.1, 0.1, (markers, 3))
    R = Rotation.from_rotvec(np.arange(frames)[:, None] * turn * np.array([0.6, 0.0, 0.8])).as_matrix()
    x = np.einsum("tab,nb->tna", R, X) + np.arange(frames)[:, None, None] * [0.02, 0.0, 0.01]
    return x + NOISE * rng.standard_normal(x.shape), rng


@settings(max_examples=25, deadline=None)
@given(st.integers(4, 12), st.floats(0.0, 3.0), st.integers(0, 1000))
def test_a_body_that_flies_and_turns_has_none(markers, turn, seed):
    assert not spikes(tumbling(markers, turn=turn, seed=seed)[0]).any()


@pytest.mark.parametrize("size", [100, 300, 3000])
def test_spikes_are_named_and_nothing_beside_them(size):
    x, rng = tumbling()
    expected = np.zeros(x.shape[:2], bool)
    for frame in range(8, 195, 17):
        expected[frame, rng.integers(6)] = True
    step = rng.standard_normal((expected.sum(), 3))
    x[expected] += size * NOISE * step / np.linalg.norm(step, axis=1, keepdims=True)
    np.testing.assert_array_equal(spikes(x), expected)


def test_two_frames_in_a_row_and_two_markers_at_once_are_spikes_too():
    x, _ = tumbling(markers=8)
    x[50:52, 3] += 0.05
    x[90, [1, 6]] += [[0.05, 0.0, 0.0], [0.0, -0.04, 0.03]]
    assert np.argwhere(spikes(x)).tolist() == [[50, 3], [51, 3], [90, 1], [90, 6]]


def test_a_vibration_is_none_but_where_it_sets_in():
    x, rng = tumbling(turn=0.0)
    shape = rng.standard_normal(x.shape[1:])
    ring = np.where(np.arange(200) < 60, 0.0, np.sin(0.6 * np.arange(200)) * np.exp(-0.02 * np.arange(200)))
    found = spikes(x + 0.01 * ring[:, None, None] * shape)
    assert found.sum() <= 4
    assert not found[:58].any()
    assert not found[66:].any()


def test_a_marker_that_slips_and_stays_is_none():
    x, _ = tumbling()
    x[100:, 2] += 0.03
    assert not spikes(x).any()


def test_lost_readings_are_no_spikes_and_hide_none():
    x, rng = tumbling(markers=8)
    x[rng.random(x.shape[:2]) < 0.1] = np.nan
    x[70, 4] = x[69, 4] + 0.05
    found = spikes(x)
    assert not found[np.isnan(x[..., 0])].any()
    assert found[70, 4] or np.isnan(x[70, 4]).any()


@pytest.mark.parametrize("markers", [0, 1, 3])
def test_too_few_markers_tell_nothing(markers):
    x, _ = tumbling(markers=8)
    x = x[:, :markers]
    x[40:41] += 0.1
    assert not spikes(x).any()


def beside_shape(x, X):
    """Readings of markers (time, marker, 3) that leave a shape X (marker, 3) told with them."""
    time = np.arange(len(x)) / 200.0
    body = Body(tuple(f"m{k}" for k in range(len(X))), X, np.ones(len(X)))
    kin = kinematics(body, Motion(time, x, noise_std={"position": NOISE}), load_settings(model="rigid"))
    shown = beyond_rigid(time, x, kin)
    return off_the_shape(shown.y, shown.basis)


@settings(max_examples=25, deadline=None)
@given(st.integers(3, 12), st.floats(0.0, 1.0), st.integers(0, 1000))
def test_a_body_that_keeps_its_shape_leaves_it_nowhere(markers, turn, seed):
    X = np.random.default_rng(seed).uniform(-0.1, 0.1, (markers, 3))  # as `tumbling` draws it
    assert not beside_shape(tumbling(markers, turn=turn, seed=seed)[0], X).any()


def test_spikes_that_distances_do_not_show_leave_the_shape():
    shown, named, count = 0, 0, 0
    for seed in range(12):
        x, rng = tumbling(8, seed=seed)
        expected = np.zeros(x.shape[:2], bool)
        expected[np.arange(8, 195, 11), rng.integers(8, size=17)] = True
        step = rng.standard_normal((expected.sum(), 3))
        x[expected] += 16 * NOISE * step / np.linalg.norm(step, axis=1, keepdims=True)
        found = beside_shape(x, np.random.default_rng(seed).uniform(-0.1, 0.1, (8, 3)))
        assert not (found & ~expected).any()
        shown, named, count = shown + found.sum(), named + spikes(x).sum(), count + expected.sum()
    assert shown > 0.9 * count > named


def test_spikes_of_a_body_that_strains_faster_than_they_show_in_its_shape_are_found():
    (x, rng), X = tumbling(markers=10, turn=0.05), np.random.default_rng(0).uniform(-0.1, 0.1, (10, 3))
    R = Rotation.from_rotvec(np.arange(200)[:, None] * 0.05 * np.array([0.6, 0.0, 0.8])).as_matrix()
    strain = 0.2 * np.diag([1.0, -0.5, -0.3]) + 0.1 * np.eye(3)[[1, 0, 2]]
    x += np.einsum("t,tab,nb->tna", np.sin(0.9 * np.arange(200)), R, X @ strain)
    off = np.zeros(x.shape[:2], bool)
    off[np.arange(8, 195, 11), rng.integers(0, 10, 17)] = True
    step = rng.standard_normal((off.sum(), 3))
    x[off] += 25 * NOISE * step / np.linalg.norm(step, axis=1, keepdims=True)
    body = Body(tuple(f"n{k}" for k in range(10)), X, np.ones(10))
    motion = Motion(np.arange(200) / 100, x)
    assert spikes(x)[off].mean() < 0.2
    left = cleaned(body, motion, kinematics(body, motion, load_settings(model="rigid")))[0].position
    np.testing.assert_array_equal(np.isnan(left).all(2), off)
