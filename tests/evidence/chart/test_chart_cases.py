"""Cases of the chart: where they come from, and that no method sees their truth."""

from dataclasses import replace

import numpy as np
import pytest
from spinning_body import spinning

from evidence.subjects.flights.cases import case_of, sources
from forceid.errors import ConfigError, DataError


def test_a_method_does_not_see_the_truth():
    case = case_of("spinning", spinning(6, 60), False)
    assert case.blind.truth == {}
    assert np.isfinite(case.wrench).all()


def test_a_recording_without_truth_says_what_is_missing():
    with pytest.raises(DataError, match=r"holds no /truth/force.*import the plates"):
        case_of("spinning", replace(spinning(6, 60), truth={}), True, "squats1.h5")


def test_truth_on_a_clock_of_its_own_is_read_at_the_frames():
    recording = spinning(6, 60)
    time = recording.motion.time
    fine = np.linspace(time[0], time[-1], 1000)
    truth = {"time": fine, "force": np.outer(fine, [1.0, 2.0, 3.0])}
    case = case_of("spinning", replace(recording, truth=truth), True)
    np.testing.assert_allclose(case.wrench[:, :3], np.outer(time, [1.0, 2.0, 3.0]), atol=1e-12)
    assert np.isnan(case.wrench[:, 3:]).all()


def test_noise_of_another_seed_is_another_case():
    one, other = (case_of("s", spinning(n, 60), False) for n in (6, 7))
    assert one.key == case_of("s", spinning(6, 60), False).key != other.key


def test_two_scenes_of_one_name_are_refused():
    with pytest.raises(ConfigError, match="two scenes are called 'top'"):
        sources(["top", "elsewhere/top.h5"])
