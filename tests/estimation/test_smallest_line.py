"""The amplitude that a line needs to be found, against what the search finds in records with a known line."""

import numpy as np

from forceid.config import load_settings
from forceid.estimation.load_channels import tune_channel
from forceid.estimation.load_lines import smallest_found
from forceid.estimation.run import estimate_recording
from forceid.kalman.channels import Channel
from forceid.kalman.engines import engine
from forceid.kalman.lines import Candidate, find_line
from forceid.kalman.prior import channel_model
from forceid.scenes.recipe import SceneRecipe, simulate

MASS, SPIN, NOISE = 0.13, 10.0, 1e-3  # kg, Hz, m
TIME = np.arange(500) / 500.0


def channel_with(amplitude: float, seed: int) -> Channel:
    """A mass under a slow force and a line along x, written down as its exact path, with noise."""
    slow = -np.stack([np.sin(3 * TIME) / 9, np.cos(2 * TIME) / 4, 0.5 * np.sin(2 * TIME + 1) / 4], 1)
    w = 2 * np.pi * SPIN
    line = -amplitude * np.cos(w * TIME + seed)[:, None] / w**2 * [1.0, 0.0, 0.0]
    z = (slow + line) / MASS + NOISE * np.random.default_rng(seed).standard_normal((500, 3))
    return Channel(TIME, z, 1 / MASS, np.tile(NOISE**2 * np.eye(3), (500, 1, 1)), np.zeros((3, 3)))


def found(share: float, seed: int) -> bool:
    """Whether the search finds a line of a share of the smallest amplitude that it is said to find."""
    passes = engine()
    quiet = channel_with(0.0, seed)
    least = smallest_found(quiet, tune_channel(quiet, (1.0, 1.0), ()), SPIN).max()
    channel = channel_with(share * least, seed)
    prior = tune_channel(channel, (1.0, 1.0), ())
    model = channel_model(channel, prior)
    filtered = passes.filter(model, channel.moved)
    return bool(find_line(model, filtered, TIME, prior.axes, Candidate(SPIN, named=True)))


def test_a_line_well_above_the_smallest_amplitude_is_found_and_one_well_below_is_not() -> None:
    assert [found(1.7, seed) for seed in range(4)] == [True] * 4
    assert [found(0.5, seed) for seed in range(4)] == [False] * 4


def test_the_smallest_amplitude_grows_with_the_square_of_the_frequency_and_falls_with_the_noise() -> None:
    channel = channel_with(0.0, 1)
    prior = tune_channel(channel, (1.0, 1.0), ())
    low, high = (smallest_found(channel, prior, f) for f in (50.0, 100.0))
    np.testing.assert_allclose(high / low, 4.0, rtol=1e-3)


def test_a_load_at_twice_the_spin_that_a_record_cannot_show_is_bounded_in_the_result() -> None:
    ring = SceneRecipe(
        scene="spinner", duration=1.0, sample_rate=250.0, noise_std=1e-3, seed=1,
        parameters={"harmonic_load": [0.2, 0.0, 0.0], "harmonic": 2.0},
    )  # fmt: skip
    found = estimate_recording(simulate(ring), load_settings())
    assert not any("line" in name for name in found.tuned)
    assert 0.2 < found.tuned["force_unshown_at_twice_spin"] < 0.4
    (said,) = [r for r in found.verdict.reasons if "would hide in the noise" in r]
    assert "at twice the spin" in said
    quiet = estimate_recording(simulate(ring.model_copy(update={"noise_std": 1e-4})), load_settings())
    assert not [r for r in quiet.verdict.reasons if "would hide in the noise" in r]
