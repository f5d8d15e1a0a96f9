"""What the plain route claims where it stands in for a smoother."""

import numpy as np

from forceid.estimation.loads.plain_cut import Cut
from forceid.estimation.witness.plain_route import PlainChannel
from forceid.estimation.witness.stand_in import missed

RATE, SAMPLES, NOISE = 100.0, 4000, 1e-3  # Hz, frames, N s2


def channel_of(z):
    time = np.arange(len(z)) / RATE
    z = z[:, None] * np.array([1.0, 0.0, 0.0]) + NOISE * np.random.default_rng(4).standard_normal((len(z), 3))
    whole = np.ones(len(z), bool)
    return time, PlainChannel(time, z, np.arange(len(z)), whole, np.zeros((len(z), 0)))


def test_a_load_beyond_the_cut_is_claimed_where_it_acts():
    """A wave of 1.5 Hz in the last quarter of a record that is cut at 1 Hz."""
    t, w, size = np.arange(SAMPLES) / RATE, 2 * np.pi * 1.5, 2.0
    acts = t > 30.0
    wave = np.where(acts, size / w**2 * np.cos(w * (t - 30.0)), size / w**2)
    time, channel = channel_of(wave)
    found = missed(time, channel, [Cut(1.0, NOISE**2, 100.0)] * 3)
    load = size**2 / 2
    assert 0.4 * load < found[(t > 34) & (t < 38), 0].mean() < 1.5 * load
    assert found[t < 20, 0].max() < 0.01 * load
    assert found[:, 1:].max() == 0.0


def test_noise_alone_is_no_load_beyond_the_cut():
    time, channel = channel_of(np.zeros(SAMPLES))
    found = missed(time, channel, [Cut(1.0, NOISE**2, 100.0)] * 3)
    assert np.mean(found > 0) < 0.05
