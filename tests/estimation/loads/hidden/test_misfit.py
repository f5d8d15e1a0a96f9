"""Innovations made by hand, white or not, beside a channel of a slow load in white noise."""

import numpy as np
import pytest

from forceid.estimation.loads.channels import tune_channel
from forceid.estimation.loads.hidden.left_out import least_band
from forceid.estimation.loads.hidden.misfit import shown_misfit
from forceid.flight.channels import Channel
from forceid.kalman.engines import engine

STEP, NOISE, COUNT = 0.005, 2e-4, 800
TIME = STEP * np.arange(COUNT)


@pytest.fixture(scope="module")
def seen():
    """A channel of unit mass under waves of 0.3 to 2 Hz, and the prior that is tuned on it."""
    rng = np.random.default_rng(11)
    w, phase = 2 * np.pi * rng.uniform(0.3, 2.0, (4, 3)), rng.uniform(0, 2 * np.pi, (4, 3))
    path = -(np.sin(w * TIME[:, None, None] + phase) / w**2).sum(1)
    z = path + NOISE * rng.standard_normal(path.shape)
    channel = Channel(TIME, z, 1.0, np.tile(NOISE**2 * np.eye(3), (COUNT, 1, 1)), np.zeros((3, 3)))
    return channel, tune_channel(channel, (1.0, 1.0), (), engine=engine())


def shown(seen, innovation):
    channel, prior = seen
    return shown_misfit({"force": channel}, {"force": prior}, TIME, innovation, {})[:3]


def test_white_innovations_of_the_size_predicted_deny_no_claim(seen):
    drawn = np.random.default_rng(5).standard_normal((200, COUNT, 3))
    ratio = np.array([shown(seen, one) for one in drawn])
    assert np.mean(ratio > 1) == pytest.approx(0.01, abs=0.015)


def test_larger_innovations_say_that_the_errors_are_so_much_larger(seen):
    drawn = np.random.default_rng(6).standard_normal((50, COUNT, 3))
    ratio = np.sqrt([shown(seen, 2 * one) / shown(seen, one) for one in drawn])
    assert ratio.min() > 1.9


def test_noise_where_nothing_of_the_load_is_followed_costs_no_claim(seen):
    """Three times as large beyond four times the band, where the smoother takes all for noise."""
    drawn = np.random.default_rng(7).standard_normal((50, COUNT, 3))
    waves = np.fft.rfft(drawn, axis=1)
    waves[:, np.fft.rfftfreq(COUNT, STEP) > 4 * least_band(*seen)] *= 3
    loud = np.fft.irfft(waves, COUNT, axis=1)
    assert np.sqrt(np.median([shown(seen, one) for one in loud])) < 1.2


def test_the_load_of_a_channel_that_is_not_seen_has_no_misfit(seen):
    drawn = np.random.default_rng(8).standard_normal((COUNT, 3))
    assert np.isnan(shown_misfit({}, {}, TIME, drawn, {})).all()
