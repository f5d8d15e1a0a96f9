"""Times with few digits: said where they would pass for force, and nowhere else."""

from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest

from forceid.config import load_settings
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.run import estimate_recording
from forceid.estimation.verdict.sampling import judge_times, rounded_clock


def timed(digits, rate=240.0, recording=None):
    """A toss whose file holds times with so many digits after the point."""
    recording = cf.toss(cf.clock(200, rate)) if recording is None else recording
    time = np.round(recording.motion.time, digits)
    return replace(recording, motion=replace(recording.motion, time=time))


def judged(recording):
    return judge_times(kinematics(recording.body, recording.motion, load_settings()))


def score(estimate, truth):
    """Error of the force over its claim, without the ends."""
    return float(np.sqrt(np.mean(((estimate.force - truth["force"]) / estimate.force_std)[20:-20] ** 2)))


def test_rounded_times_that_pass_for_force_are_said_and_the_advice_mends_them():
    """Four digits at 240 Hz: the force is four times its claim off, and nothing else shows it."""
    recording = timed(4)
    estimate = estimate_recording(recording, load_settings())
    assert score(estimate, recording.truth) > 3
    assert [finding.code for finding in estimate.verdict.findings] == ["rounded-times"]
    assert estimate.verdict.level == "degraded"
    rate = estimate.verdict.findings[0].values["rate_hz"]
    assert rate == pytest.approx(240.0, rel=1e-5)
    even = replace(recording, motion=replace(recording.motion, time=np.arange(200) / rate))
    mended = estimate_recording(even, load_settings())
    assert score(mended, recording.truth) < 1.5
    assert mended.verdict.level == "ok"


@pytest.mark.parametrize("rate", [120.0, 150.0, 240.0, 300.0])
def test_milliseconds_are_too_coarse_for_a_thrown_body_and_microseconds_are_not(rate):
    (found,) = judged(timed(3, rate))
    assert found.values["step_ms"] == pytest.approx(1.0)
    assert judged(timed(6, rate)) == []


def test_a_shift_by_rounding_is_the_speed_times_the_error_of_the_times():
    recording = timed(3, 120.0)
    (found,) = judged(recording)
    speed = np.linalg.norm(np.gradient(recording.truth["center"], 1 / 120.0, axis=0), axis=1)
    off = recording.motion.time - np.arange(200) / 120.0
    assert found.values["shift_mm"] == pytest.approx(1e3 * np.sqrt(np.mean((speed * off) ** 2)), rel=0.03)


def test_a_body_at_rest_does_not_mind_the_time():
    for frames in (200, 4000):
        still = np.tile(cf.star().position, (frames, 1, 1))
        noise = cf.NOISE * np.random.default_rng(1).standard_normal(still.shape)
        recording = cf.seen_as(cf.toss(cf.clock(frames, 120.0)), still + noise)
        assert judged(timed(3, recording=recording)) == []


def test_even_clocks_and_clocks_uneven_by_themselves_are_not_rounded():
    rng = np.random.default_rng(0)
    for time in (
        np.arange(500) / 120,  # even to the last bit
        np.round(np.arange(500) / 200, 3),  # even, and whole milliseconds
        np.cumsum(rng.uniform(0.004, 0.012, 500)),  # a sensor that reads when it can
        np.cumsum(np.repeat([0.008, 0.009], 250)),  # two rates, one after the other
        np.arange(2.0),
    ):
        assert rounded_clock(time) is None
