"""Markers near a line beside the mass center: the turn about it is known badly, and told to second order."""

import numpy as np
import pytest
from closed_forms import clock, rms, toss, whole

from evidence.calibration.record import drawn_record
from evidence.judged import judged_part
from evidence.strangers.attempt import attempt

LEVER = 0.12  # m: from the mass center to the line
ALONG = np.linspace(-0.1, 0.1, 6)  # m


def near_a_line(width):
    """Markers along a line beside the mass center, off it by about a width (m)."""
    off = width * np.random.default_rng(5).standard_normal((6, 2))
    return whole(*np.stack([LEVER + off[:, 0], ALONG, off[:, 1]], 1))


@pytest.mark.long
@pytest.mark.parametrize("width", [1e-3, 2e-3])  # m, where a coordinate is read to 0.3 mm
@pytest.mark.parametrize("seed", [0, 1])
def test_loads_are_found_though_a_frame_hardly_tells_the_turn_about_the_line(width, seed, estimated):
    recording = toss(clock(200, 200.0), near_a_line(width), seed)
    found = estimated(recording)
    assert found.verdict.level == "ok"
    for load in ("force", "moment"):
        error = getattr(found, load) - recording.truth[load]
        assert rms(error) < 5e-4  # N and N m, of a force of 1 N: a frame alone is off by as much as it
        assert np.mean(np.abs(error) < 2 * getattr(found, f"{load}_std")) > 0.95


def test_a_moment_is_found_that_its_channel_does_not_show_but_the_flight_does():
    record = drawn_record(75500, 39)  # a fast spin, whose momentum is turned by what rotations err
    found = attempt(record.recording, **record.settings).found
    truth = judged_part(record.recording.truth["moment"])
    error = judged_part(found.moment) - truth
    assert found.verdict.level == "ok"
    assert rms(error) < 0.1 * rms(truth)
    assert rms(error / judged_part(found.moment_std)) < 1.5
