"""Tracks whose errors follow each other: their noise is measured where the motion ends."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from forceid.estimation.loads.channels import tune_channel
from forceid.estimation.methods.noise import noise_beyond_motion
from forceid.flight.channels import Channel
from forceid.flight.priors.protocol import channel_model
from forceid.kalman.engines import engine


def channel(rng, noise, taken):
    """A slow path with white errors of size `noise` (m), whose channel says `taken`."""
    t = np.arange(1000) / 100
    path = 0.1 * np.sin(2 * np.pi * np.array([0.7, 1.1, 0.4]) * t[:, None] + rng.uniform(0, 6, 3))
    cov = np.broadcast_to(taken**2 * np.eye(3), (len(t), 3, 3))
    return Channel(t, path + noise * rng.standard_normal(path.shape), 1.0, cov, np.zeros((3, 3)))


@pytest.mark.parametrize("taken", [1e-6, 1e-3, 1e-2])
def test_the_noise_found_does_not_depend_on_the_noise_stated(taken):
    found = [
        taken * noise_beyond_motion(channel(np.random.default_rng(seed), 5e-4, taken)) for seed in range(5)
    ]
    assert np.abs(np.array(found) / 5e-4 - 1).max() < 0.2


@pytest.mark.parametrize("last", [150, 900])
def test_bridged_samples_with_larger_errors_do_not_count_however_many(last):
    seen = channel(np.random.default_rng(1), 5e-4, 1e-6)
    cov = seen.noise_cov.copy()
    cov[100:last] = 1e-4 * np.eye(3)
    bridged = Channel(seen.time, seen.z, seen.gain, cov, seen.drift)
    assert noise_beyond_motion(bridged) == pytest.approx(noise_beyond_motion(seen))


def force_error(told, path):
    """Root mean square error of the force of a channel (time, 3) along a path (time, 3)."""
    prior = tune_channel(told, (1.0, 1.0), (), (3,))
    x = engine("auto").smooth(channel_model(told, prior), told.moved).x
    load = x @ prior.rows.T
    truth = np.gradient(np.gradient(path, 0.01, axis=0), 0.01, axis=0)
    return float(np.sqrt(((load - truth)[50:-50] ** 2).mean()))


def test_a_stated_noise_is_a_floor_where_tracks_were_smoothed_at_the_source():
    low = butter(4, 5.0, fs=100.0, output="sos")
    for seed in range(4):
        path, white = (channel(np.random.default_rng(seed), noise, 1e-3) for noise in (0.0, 1e-3))
        smoothed = replace(white, z=sosfiltfilt(low, white.z, axis=0))
        shown, taken = noise_beyond_motion(smoothed), noise_beyond_motion(smoothed, stated=True)
        assert shown < taken == 1.0
        # within the motion errors are left as large as they were
        told = replace(smoothed, noise_cov=shown**2 * smoothed.noise_cov)
        assert force_error(smoothed, path.z) < force_error(told, path.z)
