"""Force and moment on persons, whose segments show the errors of their markers."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.drawn.records.person import Skin, person, resultants
from evidence.drawn.records.scored import low_passed
from forceid.config import load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation import fly_again
from forceid.estimation.loads.channels import swept_momentum
from forceid.estimation.run import estimate_recording

STILL = Skin(shared=0.0, own=0.0, white=2e-5)


def rms(error):
    return np.sqrt((error[20:-20] ** 2).mean(0))


def test_what_arms_sweep_is_the_integral_of_the_angular_momentum():
    recording = person(3, "run", skin=STILL)
    t, x, m = recording.motion.time, recording.motion.position, recording.body.mass
    c = np.einsum("n,tna->ta", m / m.sum(), x)
    H = np.einsum("n,tna->ta", m, np.cross(x - c[:, None], np.gradient(x, t, axis=0)))
    swept = np.diff(swept_momentum(x, m)[0], axis=0) / np.diff(t)[:, None]
    assert rms(swept - 0.5 * (H[1:] + H[:-1])).max() < 0.02 * rms(H).max()


def test_a_person_is_estimated_in_segments_with_the_place_of_its_mass_in_doubt():
    recording = person(0, "squat")
    found = estimate_recording(recording, load_settings(model="segments"))
    assert found.model == "segments"
    assert np.isfinite(found.wrench_cov).all()
    surer = estimate_recording(recording, load_settings(model="segments", body_std={"mass_center": 0.001}))
    assert rms(surer.moment_std).max() < 0.5 * rms(found.moment_std).max()


def test_a_body_without_joints_is_no_body_of_segments():
    recording = person(0, "squat", 2.0)
    bare = replace(recording, body=replace(recording.body, joint_segment=None))
    with pytest.raises(DataError, match="no markers on segments"):
        estimate_recording(bare, load_settings(model="segments"))
    with pytest.raises(ConfigError, match="method spline"):
        estimate_recording(recording, load_settings(model="segments", method="spline"))


def test_without_errors_of_the_skin_force_and_moment_are_those_of_the_mass_points():
    recording = person(2, "walk", skin=STILL)
    found = estimate_recording(recording, load_settings(model="segments"))
    truth = resultants(recording.motion.time, recording.motion.position, recording.body.mass)
    weight = np.linalg.norm(truth["force"].mean(0))
    assert rms(found.force - truth["force"]).max() < 0.03 * weight
    assert rms(found.moment - truth["moment"]).max() < 0.1 * rms(truth["moment"]).max()


def test_a_lost_marker_is_bridged_in_gaps_and_mass_points_alike():
    recording = person(1, "walk")
    tracks = recording.motion.marker_position.copy()
    tracks[200:215, 3] = np.nan
    weight = recording.body.marker_weight
    position = np.stack([np.einsum("m,tma->ta", w[w != 0], tracks[:, w != 0]) for w in weight], 1)
    motion = replace(recording.motion, position=position, marker_position=tracks)
    found = estimate_recording(replace(recording, motion=motion), load_settings(model="segments"))
    assert found.model == "segments"
    assert np.isfinite(found.force).all()


def about_the_truth(task, seed, cut):
    """Of force and moment of a drawn person, by axis: rms errors, those of a 6 Hz Butterworth and of the one
    whose cut is the best on the truth, and claims.
    """
    recording = person(seed, task, skin=Skin(cut=cut))
    found, six = estimate_recording(recording, load_settings(model="segments")), low_passed(recording, 6.0)
    rivals = [low_passed(recording, hertz) for hertz in np.arange(1.5, 25.0, 0.5)]
    for load in ("force", "moment"):
        truth = recording.truth[load]
        best = np.min([rms(rival[load] - truth) for rival in rivals], axis=0)
        yield (
            rms(getattr(found, load) - truth),
            rms(six[load] - truth),
            best,
            rms(getattr(found, f"{load}_std")),
        )


@pytest.mark.long
@pytest.mark.parametrize("task", ["walk", "run", "squat", "jump"])
def test_drawn_persons_are_estimated_nearly_as_well_as_by_the_best_cut_and_err_about_as_claimed(task):
    """Tracks raw and low-passed; by load, over eight persons and all axes."""
    rows = np.array([list(about_the_truth(task, seed, 12.0 * (seed % 2))) for seed in range(500, 508)])
    error, six, best, claim = np.moveaxis(rows, 2, 0)
    assert np.exp(np.log(error / six).mean((0, 2))).max() < 1.05
    assert np.exp(np.log(error / best).mean((0, 2))).max() < 1.2
    ratio = np.sqrt((error**2).mean((0, 2)) / (claim**2).mean((0, 2)))
    assert (ratio > 0.5).all()
    assert (ratio < 1.5).all()


@pytest.mark.long
@pytest.mark.parametrize(("cut", "least"), [(0.0, 0.67), (8.0, 0.4)])
def test_claims_of_persons_allow_for_what_a_filter_took_that_their_tracks_went_through(cut, least):
    """A walk and a run each of two persons: what is lost above the cut may be more or less than it seems."""
    found = [list(about_the_truth(task, seed, cut)) for seed in (744, 745) for task in ("walk", "run")]
    error, _, _, claim = np.moveaxis(np.array(found), 2, 0)
    ratio = np.sqrt((error**2).mean((0, 2)) / (claim**2).mean((0, 2)))
    assert (ratio > least).all()
    assert (ratio < 1.5).all()


def test_a_filter_that_tracks_of_a_person_went_through_is_undone():
    """A run at 6 Hz, which takes most of a step: nearly as well as by raw tracks, with places to 10 um."""
    errors = {}
    for cut in (0.0, 6.0):
        drawn = person(747, "run", skin=Skin(cut=cut))
        tracks = drawn.motion.marker_position.round(5)
        position = np.einsum("nm,tma->tna", drawn.body.marker_weight, tracks)
        motion = replace(drawn.motion, position=position, marker_position=tracks)
        found = estimate_recording(replace(drawn, motion=motion), load_settings(model="segments"))
        errors[cut] = np.linalg.norm(rms(found.force - drawn.truth["force"]))
    six = np.linalg.norm(rms(low_passed(drawn, 25.0)["force"] - drawn.truth["force"]))
    assert errors[6.0] < 1.25 * errors[0.0]
    assert errors[6.0] < 0.5 * six


@pytest.mark.parametrize(("task", "cut", "level"), [("run", 6.0, "degraded"), ("walk", 12.0, "ok")])
def test_tracks_of_a_person_that_went_through_a_filter_are_degraded_where_it_took_of_the_load(
    task, cut, level
):
    found = estimate_recording(person(746, task, skin=Skin(cut=cut)), load_settings(model="segments"))
    (said,) = (finding for finding in found.verdict.findings if finding.code == "smoothed-at-source")
    assert said.level == level


def test_errors_that_are_larger_than_the_gaps_say_make_no_load_rough():
    """A person whose gaps are of joints that are nearly fixed, by skin that moves neighbors together."""
    recording = person(616, "squat", skin=Skin(neighbor=0.5))
    found = estimate_recording(recording, load_settings(model="segments"))
    assert found.tuned["force_order"] > 1


def test_a_person_is_flown_again_by_its_center_alone():
    """Its mean rotation is that of a fit, which turns with arms and legs and not as a moment says."""
    found = estimate_recording(person(0, "squat", 2.0), load_settings(model="segments"))
    assert np.isnan(found.flown.orientation).all()
    again = fly_again(found)
    assert np.isnan(again.orientation).all()
    assert np.isfinite(again.center).all()
