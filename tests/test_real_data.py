"""Measured motion against force that was measured by itself, or is known: where the data is at hand."""

import os
from pathlib import Path

import numpy as np
import pytest

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.files.sources import import_sources
from forceid.import_settings import load_import_settings

ROOT = Path(__file__).parents[1]
REAL = Path(os.environ.get("FORCEID_REAL", ROOT.parent / "shared" / "real"))
pytestmark = pytest.mark.skipif(
    not REAL.is_dir(), reason="measured data not found: put it into ../shared/real or set FORCEID_REAL"
)


LONG = pytest.mark.skipif("FORCEID_REAL" not in os.environ, reason="takes long: set FORCEID_REAL to run it")


def person(trial, stated=True):
    settings = load_import_settings(ROOT / "config" / "jump_squat.toml")
    if not stated:
        settings = settings.model_copy(update={"noise_std": {}})
    folder = REAL / "jump_squat_mocap_plate"
    ((_, recording),) = import_sources([folder / f"{trial}.trc", folder / f"{trial}_grf.mot"], settings)
    estimate = estimate_recording(recording, load_settings())
    truth = recording.truth
    force = np.stack([np.interp(estimate.time, truth["time"], truth["force"][:, a]) for a in range(3)], 1)
    judged = slice(0, None)
    if trial.startswith("DJ"):  # on the box before, which is no plate
        judged = slice(int(np.argmax(force[:, 1] > 20)) - 12, None)
    return estimate, estimate.force[judged] - force[judged], force[judged]


def rms(error):
    return np.sqrt((error**2).mean(0))


def test_cube_in_free_flight_feels_nothing():
    settings = load_import_settings(ROOT / "config" / "cube_toss_flight.toml")
    recordings = import_sources([REAL / "cube_toss" / "tosses.csv"], settings)
    assert len(recordings) == 40
    estimates = [estimate_recording(recording, load_settings()) for _, recording in recordings]
    # mean over a flight, weighted by what is claimed: the ends of a short flight say little
    weight = [1 / e.force_std**2 for e in estimates]
    force = np.array([(e.force * w).sum(0) / w.sum(0) for e, w in zip(estimates, weight, strict=True)])
    moment = [np.linalg.norm(e.moment.mean(0)) for e in estimates]
    assert (np.abs(force.mean(0)) <= 0.1).all()
    assert (force.std(0) <= 0.05).all()
    assert np.median(moment) <= 7e-4


@LONG
def test_squats_against_the_plates():
    estimate, error, truth = person("squats1")
    assert (rms(error) <= [13.0, 8.5, 5.0]).all()
    assert np.corrcoef(truth[:, 1] + error[:, 1], truth[:, 1])[0, 1] >= 0.995
    assert estimate.verdict.level == "degraded"  # tracks smoothed at the source, and it says so


# 1.2 times the error of the low-pass cut that is best on the truth, axis by axis
@pytest.mark.parametrize(
    ("trial", "limit"),
    [
        ("DJ1", (86.9, 113.0, 20.4)),
        pytest.param("DJ2", (95.4, 122.4, 20.4), marks=LONG),
        pytest.param("DJ3", (85.3, 119.3, 20.4), marks=LONG),
    ],
)
def test_drop_jump_is_as_good_as_the_best_cut_chosen_on_the_truth(trial, limit):
    _, error, _ = person(trial)
    assert (rms(error) <= limit).all()


@LONG
def test_drop_jump_without_stated_noise_is_never_silently_wrong():
    estimate, error, _ = person("DJ1", stated=False)
    claimed = np.sqrt((estimate.force_std**2).mean(0))
    assert estimate.verdict.level == "degraded" or (rms(error) <= 3 * claimed).all()
    assert any("noise" in reason or "white" in reason for reason in estimate.verdict.reasons)
