"""A low-pass at the source shows in what no rigid motion makes, and is undone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from evidence.subjects.flights.failures.noise import smoothed_before
from forceid.config import load_settings
from forceid.estimation.body.cleaning import before_filter
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.body.tracks.source_filter import BUTTERWORTH, RESTORED, undoing, undone
from forceid.estimation.run import estimate_recording
from forceid.flight.color import LowPassed
from forceid.records import Array, Body, Motion, Recording

RATE, SAMPLES, SPIN, SWING = 200.0, 500, 15.0, 8.0  # Hz, frames, rad/s, Hz
NOISE = 2e-4  # m


def swinging(rng: np.random.Generator) -> tuple[Recording, Array]:
    """A body that turns about a principal axis under a moment that swings, exact tracks, and that moment."""
    X = rng.uniform(-0.3, 0.3, (8, 3))
    X -= X.mean(0)
    size, axes = np.linalg.eigh(X.T @ X)
    time, w = np.arange(SAMPLES) / RATE, 2 * np.pi * SWING
    angle, turning = SPIN * time + 0.2 * np.sin(w * time), -0.2 * w**2 * np.sin(w * time)
    R = Rotation.from_rotvec(angle[:, None] * axes[:, 2]).as_matrix()
    moment = 0.1 * (size[0] + size[1]) * turning[:, None] * axes[:, 2]
    body = Body(tuple("abcdefgh"), X, np.full(8, 0.1))
    return Recording(body, Motion(time, np.einsum("tij,nj->tni", R, X), gravity=np.zeros(3))), moment


def seen(recording: Recording, rng: np.random.Generator, order: int = 2, cut: float = 0.0) -> Recording:
    """The recording with noise, through a filter both ways (cut in Hz, 0 for none)."""
    assert recording.motion.position is not None
    x = recording.motion.position + NOISE * rng.standard_normal(recording.motion.position.shape)
    if cut:
        x = sosfiltfilt(butter(order, 2 * cut / RATE, output="sos"), x, axis=0)
    return Recording(recording.body, Motion(recording.motion.time, x, gravity=np.zeros(3)))


@given(order=st.sampled_from(BUTTERWORTH), cut=st.floats(0.02, RESTORED), at=st.floats(0.0, RESTORED))
@settings(max_examples=60, deadline=None)
def test_a_filter_both_ways_and_its_undoing_leave_a_wave_as_it_was(order, cut, at):
    weights, (b, a) = undoing(order, cut), butter(order, 2 * cut)
    lags = np.arange(len(weights)) - len(weights) // 2
    z = np.exp(-2j * np.pi * at)
    passed = abs(np.polyval(b[::-1], z) / np.polyval(a[::-1], z)) ** 2
    assert abs(passed * weights @ np.cos(2 * np.pi * at * lags) - 1) < 0.02


@pytest.mark.parametrize("order", BUTTERWORTH)
def test_the_filter_is_found_under_which_a_turning_body_is_rigid(order):
    rng = np.random.default_rng(order)
    for cut in (10.0, 16.0, 24.0):
        recording = seen(swinging(rng)[0], rng, order, cut)
        kin = kinematics(recording.body, recording.motion, load_settings())
        _, source, left = before_filter(recording.motion, kin)
        assert source is not None
        assert left is not None
        assert source.order == order
        assert abs(source.cut / cut - 1) < 0.02
        assert left.cut > 1.5 * cut


@pytest.mark.parametrize("cut", [7.0, 8.0, 9.0])
def test_a_slower_filter_whose_undoing_leaves_only_noise_is_not_taken_for_the_true_one(cut):
    recording = smoothed_before(cut, np.random.default_rng(int(cut))).recording
    kin = kinematics(recording.body, recording.motion, load_settings())
    _, source, _ = before_filter(recording.motion, kin)
    assert source is not None
    assert source.order == 4
    assert abs(source.cut / cut - 1) < 0.1  # eight waves of the cut in the record; the slower one is at 0.35


def test_no_filter_is_found_in_raw_tracks_and_in_those_whose_errors_remember():
    rng = np.random.default_rng(1)
    for _ in range(4):
        recording = seen(swinging(rng)[0], rng)
        walk = np.cumsum(rng.standard_normal(recording.motion.position.shape), 0)
        for more in (0.0, NOISE * walk / walk.std(), NOISE * np.round(walk)):
            motion = Motion(recording.motion.time, recording.motion.position + more, gravity=np.zeros(3))
            kin = kinematics(recording.body, motion, load_settings())
            assert before_filter(motion, kin)[1] is None


@pytest.mark.parametrize("order", BUTTERWORTH)
def test_tracks_are_as_before_the_filter_nearly_up_to_their_ends(order):
    recording = swinging(np.random.default_rng(5))[0]
    filtered = sosfiltfilt(butter(order, 2 * 20.0 / RATE, output="sos"), recording.motion.position, axis=0)
    source, left = LowPassed(order, 20.0, 1 / RATE), LowPassed(4, 40.0, 1 / RATE)
    off = np.abs(undone(filtered, source, left) - recording.motion.position).max((1, 2))
    lost = order + 4
    assert np.isnan(off[:lost]).all()
    assert off[lost:-lost].max() < 2 * NOISE
    assert off[16:-16].max() < 0.3 * NOISE
    assert np.abs(filtered - recording.motion.position)[16:-16].max() > 3 * NOISE


@pytest.mark.long
def test_a_moment_that_swings_is_as_large_as_before_the_filter():
    rng = np.random.default_rng(2)
    recording, moment = swinging(rng)
    found = estimate_recording(seen(recording, rng, cut=12.0), load_settings())
    inner = slice(SAMPLES // 8, -SAMPLES // 8)
    share = (found.moment[inner] * moment[inner]).sum() / (moment[inner] ** 2).sum()
    passed = 1 / (1 + (SWING / 12.0) ** 4)
    assert abs(share - 1) < 0.02 < 0.1 < 1 - passed
    error, claim = (found.moment - moment)[inner], found.moment_std[inner]
    assert np.sqrt((error**2).mean() / (claim**2).mean()) < 1.5
    assert "filter-undone" in {f.code for f in found.verdict.findings}
