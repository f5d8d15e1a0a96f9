"""A moment that acts late, or along an axis that its channel hardly shows: the flight tells it."""

import numpy as np
import pytest

from evidence.calibration.record import drawn_record
from evidence.judged import judged_part
from evidence.strangers.attempt import attempt


def errors(number):
    """Rms errors of the moment found and of the plain route, and the rms claim, of a drawn record."""
    case = drawn_record(77036, number, (100, 1500))
    found, truth = attempt(case.recording, **case.settings).found, case.recording.truth["moment"]
    off = found.moment - truth, found.witness.moment - truth, found.moment_std
    return [float(np.sqrt(np.nanmean(judged_part(a) ** 2))) for a in off]


@pytest.mark.long
@pytest.mark.parametrize("number", [521, 673, 1173], ids=["one axis", "steps", "an end"])
def test_a_moment_that_its_channel_hardly_shows_is_found_as_the_flight_shows_it(number):
    """Tuned on the middle of the record, or along the axis seen best, it was over three times as far off."""
    own, plain, claim = errors(number)
    assert own < plain
    assert own < 1.5 * claim
