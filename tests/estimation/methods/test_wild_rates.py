"""Gyros without markers: a spike is no turn of the body, a step is one; lost turns are refused at once."""

from dataclasses import replace

import numpy as np
import pytest

import forceid
from evidence.attack.bodies import write
from forceid.estimation.body.cleaning import cleaned
from forceid.estimation.body.tracks.spikes import wild_rates
from forceid.files import read_motion

RNG = np.random.default_rng(5)


@pytest.fixture
def recording(tmp_path):
    return read_motion(write(tmp_path / "alone.h5", "alone"))


@pytest.mark.parametrize("size", [30.0, 1000.0, 1e6])
@pytest.mark.parametrize("at", [0, 30, 59])
def test_a_spike_is_taken_out_wherever_it_is_and_nothing_else(recording, size, at):
    rate = recording.motion.angular_velocity.copy()
    rate[at, 0, 1] += size
    motion, mended = cleaned(recording.body, replace(recording.motion, angular_velocity=rate))
    assert (mended.rates, mended.rates_s) == (1, recording.motion.time[at])
    assert np.isnan(motion.angular_velocity).all(2).sum() == 1
    assert np.isnan(motion.angular_velocity[at]).all()


@pytest.mark.parametrize(
    "rate",
    [
        np.where(np.arange(90) < 40, 0.0, 300.0),  # a blow
        RNG.standard_normal(90),  # noise
        RNG.standard_t(2, 90),  # noise with rare large readings
        30 * np.sin(np.arange(90)),  # six samples a turn
        np.zeros(90),
        np.full(90, np.nan),
    ],
    ids=["a blow", "noise", "heavy tails", "a fast wobble", "rest", "nothing"],
)
def test_what_bodies_do_is_no_spike(rate):
    assert not wild_rates(rate[:, None, None] * [1.0, 0.2, 0.1]).any()


@pytest.mark.long
def test_a_spike_changes_no_result_and_is_said(tmp_path):
    def spike(file):
        file["motion/angular_velocity"][30, 0, 1] = 1000.0

    found = [
        forceid.estimate(forceid.open_motion(write(tmp_path / "a.h5", "alone", e))) for e in (None, spike)
    ]
    plain, spiked = (result["estimate"] for result in found)
    assert "gyro-spikes" in spiked.attrs["reason_codes"]
    off = np.abs(plain["force"] - spiked["force"]) / plain["force_std"]
    assert float(off.max()) < 0.1


def test_more_than_a_whole_turn_between_samples_is_refused_before_any_search(tmp_path):
    def fast(file):
        file["motion/angular_velocity"][..., 0] = 1000.0

    result = forceid.estimate(forceid.open_motion(write(tmp_path / "a.h5", "alone", fast)))["estimate"]
    assert result.attrs["verdict"] == "refused"
    assert "turns-lost" in result.attrs["reason_codes"]
