"""Measured motion against force that was measured by itself, or is known: where the data is at hand."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from evidence.judged import WRONG, over_claim
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.files.formats.sources import import_sources
from forceid.import_settings import load_import_settings

ROOT = Path(__file__).parents[1]
RATE = 100.0  # Hz, of the markers
REAL = Path(os.environ.get("FORCEID_REAL", ROOT.parent / "shared" / "real"))
pytestmark = pytest.mark.skipif(
    not REAL.is_dir(), reason="measured data not found: put it into ../shared/real or set FORCEID_REAL"
)


LONG = pytest.mark.skipif("FORCEID_REAL" not in os.environ, reason="takes long: set FORCEID_REAL to run it")


def recorded(trial, stated=True):
    settings = load_import_settings(ROOT / "config" / "jump_squat.toml")
    if not stated:
        settings = settings.model_copy(update={"noise_std": {}})
    folder = REAL / "jump_squat_mocap_plate"
    ((_, recording),) = import_sources([folder / f"{trial}.trc", folder / f"{trial}_grf.mot"], settings)
    return recording


def forces_of_plates(recording):
    """Force of the plates (time, 3) N at the frames."""
    truth = recording.truth
    at = recording.motion.time
    return np.stack([np.interp(at, truth["time"], truth["force"][:, a]) for a in range(3)], 1)


def rms(error):
    return np.sqrt((error**2).mean(0))


@pytest.mark.long
def test_cube_in_free_flight_feels_nothing():
    settings = load_import_settings(ROOT / "config" / "cube_toss_flight.toml")
    recordings = import_sources([REAL / "cube_toss" / "tosses.csv"], settings)
    assert len(recordings) == 40
    estimates = [estimate_recording(recording, load_settings()) for _, recording in recordings]

    # mean over a flight, weighted by what is claimed: the ends of a short flight say little
    def mean(load, std):
        return (load / std**2).sum(0) / (1 / std**2).sum(0)

    force = np.array([mean(e.force, e.force_std) for e in estimates])
    moment = [np.linalg.norm(mean(e.moment, e.moment_std)) for e in estimates]
    assert (np.abs(force.mean(0)) <= 0.1).all()
    assert (force.std(0) <= 0.05).all()
    assert np.median(moment) <= 6.7e-4  # of a straight line through the spin: the README of the data


@LONG
def test_squats_against_the_plates():
    recording = recorded("squats1")
    estimate, truth = estimate_recording(recording, load_settings()), forces_of_plates(recording)
    error = estimate.force - truth
    assert (rms(error) <= [13.0, 8.5, 5.0]).all()
    assert np.corrcoef(truth[:, 1] + error[:, 1], truth[:, 1])[0, 1] >= 0.995
    assert estimate.verdict.level == "degraded"  # tracks smoothed at the source, and it says so


@pytest.mark.long
@LONG
@pytest.mark.parametrize("trial", ["squats1", "DJ1", "DJ2", "DJ3"])
def test_mass_and_height_alone_find_the_vertical_force_as_well_as_a_table_by_hand(trial):
    """Within 1.1 of the segments of config/jump_squat.toml."""
    by_hand, folder = (
        load_import_settings(ROOT / "config" / "jump_squat.toml"),
        REAL / "jump_squat_mocap_plate",
    )
    keys = {key: getattr(by_hand, key) for key in ("gravity", "static", "noise_std", "plates")}
    body = {"table": "winter", "mass": 60.03, "height": 1.69}
    person = load_import_settings(None, body=body, **keys)
    ((_, recording),) = import_sources([folder / f"{trial}.trc", folder / f"{trial}_grf.mot"], person)
    truth = forces_of_plates(recording)
    air = slice(int(np.argmax(truth[:, 1] > 20)) - 12, -10) if trial != "squats1" else slice(None)
    found, reference = (
        rms((estimate_recording(one, load_settings()).force - truth)[air])[1]
        for one in (recording, recorded(trial))
    )
    assert found <= 1.1 * reference


@pytest.mark.long
@LONG
@pytest.mark.parametrize(("known", "other"), [("1", "2"), ("2", "1")])
def test_beside_one_foot_on_a_known_plate_the_other_foot_is_found(known, other):
    settings = load_import_settings(ROOT / "config" / "jump_squat.toml")
    plates = settings.plates.model_copy(update={"known": (known,), "plate": (known, other)})
    settings = settings.model_copy(update={"plates": plates})
    folder = REAL / "jump_squat_mocap_plate"
    ((_, recording),) = import_sources([folder / "squats1.trc", folder / "squats1_grf.mot"], settings)
    estimate = estimate_recording(recording, load_settings())
    cut = slice(len(estimate.time) // 8, -len(estimate.time) // 8)
    error = (estimate.force - forces_of_plates(recording))[cut]
    assert (rms(error) <= [6.0, 8.0, 4.0]).all()
    # who stays on the spot gains no momentum: the mean of the error is an offset of the plates
    assert (error.std(0) <= 1.2 * rms(estimate.force_std[cut])).all()


def low_passed(recording, cut):
    """Force by a zero-phase Butterworth filter and second differences, gaps filled by straight lines."""
    t, x, m = recording.motion.time, recording.motion.position.copy(), recording.body.mass
    for track in x.reshape(len(t), -1).T:
        seen = np.isfinite(track)
        track[~seen] = np.interp(t[~seen], t[seen], track[seen])
    step = np.median(np.diff(t))
    center = np.einsum("n,tna->ta", m / m.sum(), x)
    center = sosfiltfilt(butter(2, cut / 0.802, fs=1 / step, output="sos"), center, axis=0)
    bent = np.gradient(np.gradient(center, step, axis=0), step, axis=0)
    bent[1:-1] = (center[2:] - 2 * center[1:-1] + center[:-2]) / step**2
    return m.sum() * (bent - recording.motion.gravity)


def with_gaps(recording, seed):
    """The recording with 3 % of its readings taken out, in runs of 3 to 24 samples."""
    rng, x = np.random.default_rng(seed), recording.motion.position.copy()
    while np.isnan(x[..., 0]).mean() < 0.03:
        k, first, length = rng.integers(x.shape[1]), rng.integers(len(x)), rng.integers(3, 25)
        x[first : first + length, k] = np.nan
    return replace(recording, motion=replace(recording.motion, position=x))


@pytest.mark.long
@pytest.mark.parametrize(
    ("trial", "stated", "gaps"),
    [
        ("DJ1", True, False),
        ("DJ3", False, True),
        pytest.param("DJ1", False, True, marks=LONG),
        pytest.param("DJ2", True, True, marks=LONG),
        pytest.param("DJ2", False, False, marks=LONG),
        pytest.param("DJ3", True, True, marks=LONG),
    ],
)
def test_drop_jump_is_as_good_as_the_best_cut_chosen_on_the_truth(trial, stated, gaps):
    """By axis, readings missing or not; within its band no claim is more than twice too small."""
    recording = recorded(trial, stated)
    recording = with_gaps(recording, 1) if gaps else recording
    found, truth = estimate_recording(recording, load_settings()), forces_of_plates(recording)
    air = slice(int(np.argmax(truth[:, 1] > 20)) - 12, -10)  # on the box before, which is no plate
    error = rms((found.force - truth)[air])
    best = np.min([rms((low_passed(recording, cut) - truth)[air]) for cut in np.arange(1.5, 25, 0.5)], axis=0)
    assert (error <= (1.2 if stated else 1.3) * best).all()
    for axis, band in enumerate(found.hidden.band[:3]):
        off, std = ((a[air, axis, None]) for a in (found.force - truth, found.force_std))
        assert over_claim(off, std, band[None], RATE) <= WRONG
    assert found.model == "segments"
