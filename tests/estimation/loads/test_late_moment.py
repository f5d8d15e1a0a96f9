"""A moment that acts late, or along an axis that its channel hardly shows: the flight tells it."""

from types import SimpleNamespace

import numpy as np
import pytest

from evidence.calibration.record import drawn_record
from evidence.judged import judged_part
from evidence.strangers.attempt import attempt
from forceid.estimation.loads.late_moment import contradicted


def errors(seed, number):
    """Rms errors of the moment found and of the plain route, and the rms claim, of a drawn record."""
    case = drawn_record(seed, number, (100, 1500))
    found, truth = attempt(case.recording, **case.settings).found, case.recording.truth["moment"]
    off = found.moment - truth, found.witness.moment - truth, found.moment_std
    return [float(np.sqrt(np.nanmean(judged_part(a) ** 2))) for a in off]


@pytest.mark.long
@pytest.mark.parametrize("number", [521, 673, 1173], ids=["one axis", "steps", "an end"])
def test_a_moment_that_its_channel_hardly_shows_is_found_as_the_flight_shows_it(number):
    """Tuned on the middle of the record, or along the axis seen best, it was over three times as far off."""
    own, plain, claim = errors(77036, number)
    assert own < plain
    assert own < 1.5 * claim


@pytest.mark.long
@pytest.mark.parametrize("number", [1493, 1409, 1109])
def test_a_moment_that_its_channel_took_for_none_is_no_moment_that_turns_with_the_body(number):
    """It left slow innovations, which axes of the body explained at e^26 to e^84."""
    own, plain, claim = errors(77054, number)
    assert own < 1.5 * plain
    assert own < 1.5 * claim


def state_of(innovation):
    """As much of a state as tells its innovations (time, 6)."""
    return SimpleNamespace(innovation=innovation)


def test_white_innovations_seldom_contradict_a_prior_and_faint_slow_ones_do():
    rng, t = np.random.default_rng(5), np.arange(500)
    white = rng.standard_normal((400, 500, 6))
    assert np.mean([contradicted(state_of(one)) for one in white]) < 0.06
    slow = 0.34 * np.sin(2 * np.pi * 1.3 * t / 500)[:, None] * [0, 0, 0, 1, 1, 0]
    assert np.mean([contradicted(state_of(one + slow)) for one in white]) > 0.9
    assert ((white + slow)[..., 3:6] ** 2).mean() < 1.05  # a mean square that chance makes 1.07 of
