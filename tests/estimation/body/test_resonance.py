"""Shapes that ring far below the noise of a sample, and what they would pass for."""

import numpy as np
import pytest
from scipy.signal import lfilter

from evidence.calibration.record import drawn_record
from evidence.judged import judged_part, rms
from forceid.config import load_settings
from forceid.estimation.body.deforming.resonance import ringing_gain
from forceid.estimation.run import estimate_recording
from forceid.significance import PATIENCE

FRAMES, RATE = 800, 400.0  # Hz


def test_white_noise_does_not_ring():
    """A ratio of likelihoods is one on average, where the noise is all there is."""
    time = np.arange(FRAMES) / RATE
    gain = ringing_gain(time, 3e-4 * np.random.default_rng(3).standard_normal((FRAMES, 400)), 3e-4**2)
    assert 0.3 < np.exp(gain).mean() < 3
    assert (gain < PATIENCE).mean() > 0.99


def test_ringing_of_a_third_of_the_noise_is_seen_and_of_a_fiftieth_is_not():
    """What noise drives at 23 Hz, damped by 2 % of critical."""
    time, rng = np.arange(4 * FRAMES) / RATE, np.random.default_rng(4)
    root = np.exp(2 * np.pi * 23.0 / RATE * (1j * np.sqrt(1 - 0.02**2) - 0.02))
    rung = lfilter([1.0], [1.0, -2 * root.real, abs(root) ** 2], rng.standard_normal(len(time)))
    q = np.outer(rung / rung.std(), [1 / 3, 1 / 50]) + rng.standard_normal((len(time), 2))
    found, hidden = ringing_gain(time, q, 1.0)
    assert found > PATIENCE > hidden


def test_readings_that_miss_or_are_wild_do_not_ring():
    rng = np.random.default_rng(5)
    q = rng.standard_normal((FRAMES, 50))
    q[rng.random(q.shape) < 0.1] = np.nan
    q[rng.random(q.shape) < 2e-3] = 30.0
    assert np.median(ringing_gain(np.arange(FRAMES) / RATE, q, 1.0)) < PATIENCE


@pytest.mark.parametrize("frames", range(2, 12))
def test_so_short_a_record_shows_no_ringing(frames):
    rng = np.random.default_rng(frames)
    gain = ringing_gain(np.arange(frames) / RATE, rng.standard_normal((frames, 3)), 1.0)
    assert (np.abs(gain) < PATIENCE).all()


@pytest.mark.long
def test_a_body_that_rings_unseen_by_eye_is_not_pushed_at_its_frequencies():
    """A drawn soft body, its swings a sixth of the noise: taken for rigid, it would show a force of 6 mN."""
    drawn = drawn_record(77059, 782, (100, 1500))
    settings, truth = drawn.settings, drawn.recording.truth["force"]
    found = estimate_recording(drawn.recording, load_settings(**settings))
    rigid = estimate_recording(drawn.recording, load_settings(**settings, model="rigid"))
    off, off_rigid = (rms(judged_part(one.force - truth)) for one in (found, rigid))
    assert found.model == "affine"
    assert off < 0.02 * off_rigid
