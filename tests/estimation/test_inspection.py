"""What is said of a recording before anything is estimated."""

import json
from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest

from forceid.config import load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.inspection import inspect_recording


def inspect(recording, **settings):
    return inspect_recording(recording, load_settings(**settings))


def test_contents_are_counted():
    recording = cf.toss()
    x = recording.motion.position.copy()
    x[:12, 2] = np.nan
    found = inspect(cf.seen_as(recording, x))
    assert (found.frames, found.nodes, found.seen_nodes, found.rank, found.shapes) == (120, 6, 6, 6, 0)
    assert found.rate_hz == pytest.approx(200.0)
    assert found.duration_s == pytest.approx(119 / 200)
    assert found.missing_percent == pytest.approx(100 * 12 / (120 * 6))
    assert found.mass_kg == pytest.approx(cf.MASS)
    assert found.noise_std == {"position": cf.NOISE}
    assert found.regular
    assert found.force
    assert found.moment
    assert found.has_truth
    assert found.warnings == ()
    fastest = np.degrees(cf.SPIN[0] + cf.SPIN[1] * 119 / 200) / 200
    assert found.turn_deg_per_frame == pytest.approx(fastest, rel=0.15)


def test_breathing_body_shows_one_shape():
    assert inspect(cf.toss(breath=0.05)).shapes == 1


@pytest.mark.parametrize(
    ("body", "rank"),
    [
        (cf.whole([0, 0, 0]), 3),
        (cf.whole([0.1, 0, 0], [-0.1, 0, 0]), 5),
        (cf.whole([0.1, 0, 0], [-0.1, 0, 0], [0.3, 0, 0]), 5),
    ],
    ids=["one", "two", "line"],
)
def test_rank_says_which_motions_the_markers_see(body, rank):
    found = inspect(cf.toss(body=body))
    assert found.rank == rank
    assert found.force
    assert not found.moment
    assert found.moment_bandwidth_hz is None
    assert "moment   cannot be identified" in found.summary


def test_warnings_are_those_of_the_verdict(estimated):
    line = cf.toss(body=cf.points([0.1, 0, 0, 0.1], [-0.1, 0, 0, 0.1]))
    stiff = cf.toss(breath=0.05)
    assert inspect(line).warnings == estimated(line, method="savgol").verdict.reasons
    assert set(inspect(stiff, model="rigid").warnings) <= set(
        estimated(stiff, method="savgol", model="rigid").verdict.reasons
    )
    assert "limited by the model" in inspect(stiff, model="rigid").warnings[0]


def test_nothing_is_promised_where_the_estimate_will_be_refused():
    recording = cf.toss(body=cf.points([0.1, 0.05, 0, 0.05], [-0.1, 0.05, 0, 0.05], [0, -0.05, 0, 0.1]))
    x = recording.motion.position.copy()
    x[:, 2] = np.nan
    found = inspect(cf.seen_as(recording, x))
    assert not found.force
    assert found.force_bandwidth_hz is None
    assert "force    cannot be identified" in found.summary


def test_bandwidth_follows_the_fifth_root_law():
    # a tenth of the load against white noise: f^5 goes with 1 / sigma^2
    loud, quiet = inspect(cf.toss()), inspect(cf.toss(noise=cf.NOISE / 10))
    ratio = quiet.force_bandwidth_hz / loud.force_bandwidth_hz
    assert ratio == pytest.approx(10 ** (2 / 5), rel=0.02)
    size = np.linalg.norm(cf.FORCE) / np.sqrt(3) / cf.MASS
    law = (5 * (0.1 * size) ** 2 * 200 / (2 * cf.NOISE**2 / 6 * (2 * np.pi) ** 4)) ** 0.2
    assert loud.force_bandwidth_hz == pytest.approx(law, rel=0.02)


def test_force_that_does_not_stand_out_has_no_bandwidth():
    recording = cf.toss(noise=0.05, spin=(0.0, 0.0))
    weightless = replace(recording.motion, gravity=cf.GRAVITY + cf.FORCE / cf.MASS)
    found = inspect(replace(recording, motion=weightless))
    assert found.force
    assert found.force_bandwidth_hz is None
    assert "none stands out of the noise" in found.summary[5]


def test_gravity_of_the_settings_goes_before_that_of_the_file():
    assert inspect(cf.toss(), gravity=(0.0, 0.0, -1.62)).gravity == (0.0, 0.0, -1.62)


def test_mean_motion_is_seen_whole():
    found = inspect(cf.mean_motion())
    assert (found.rank, found.nodes, found.moment) == (6, 0, True)
    assert any("rad (from the data)" in line for line in found.summary)


def test_irregular_clock_is_said():
    time = cf.clock() + np.random.default_rng(0).uniform(-1e-3, 1e-3, 120)
    found = inspect(cf.toss(time))
    assert not found.regular
    assert "irregular clock" in found.summary[0]


def test_same_for_machines_is_plain_json():
    assert json.loads(json.dumps(inspect(cf.toss()).as_dict()))["rank"] == 6


def test_what_would_stop_the_estimate_stops_the_inspection():
    with pytest.raises(ConfigError, match="names the point 'tip'"):
        inspect(cf.toss(), moment_about="tip")
    mechanism = cf.star(mass=np.full(6, cf.MASS / 6), stiffness=np.zeros((18, 18)))
    with pytest.raises(DataError, match="/body/stiffness"):
        inspect(cf.toss(body=mechanism))


def test_leakage_and_sensitivity_are_in_the_text_and_in_the_numbers():
    found = inspect(cf.toss(breath=0.05))
    text = "\n".join(found.summary)
    assert "leakage  shape 1: " in text
    assert "0 % of a rigid motion is taken for deformation" in text
    assert "degrees about x, y, z in one frame" in text
    assert "N m per mm of mass center" in text
    plain = json.loads(json.dumps(found.as_dict()))
    assert plain["leakage"]["name"] == ["shape 1"]
    assert plain["leakage"]["worst"]["rigid_to_shape_percent"] == 0.0
    spin = cf.SPIN[0] + cf.SPIN[1] * 0.3
    law = 1e-3 * cf.MASS * spin**2  # newtons that a center off by a millimeter costs at that spin
    assert plain["sensitivity"]["center_force_per_mm"] == pytest.approx(law, rel=0.15)


def test_mean_motion_has_no_leakage_but_a_budget():
    found = inspect(cf.mean_motion())
    assert found.leakage is None
    assert found.sensitivity is not None
    assert "mass_force_per_percent" in found.as_dict()["sensitivity"]
    assert not any(line.startswith("leakage") for line in found.summary)


def test_line_of_markers_is_said_to_leave_a_turn_open():
    found = inspect(cf.toss(body=cf.points([0.1, 0, 0, 0.1], [-0.1, 0, 0, 0.1])))
    assert "markers  lie on a line: a turn about it leaves no trace" in found.summary
