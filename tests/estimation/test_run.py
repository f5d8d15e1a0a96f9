"""One recording in, one estimate out: truth, invariances, bad views of the body, and what the settings do."""

from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import forceid
from forceid.config import load_settings
from forceid.errors import DataError
from forceid.files.tree import tree_from_recording

NUMBERS = ("force", "moment", "wrench_cov", "center", "velocity", "orientation", "angular_velocity",
           "angular_momentum", "deformation", "mean_shape", "nis", "innovation")  # fmt: skip
METHODS = ("smoother", "filter", "savgol", "spline", "difference")


def force_score(result, recording):
    """Error of the force over its claimed standard deviation, rms."""
    return cf.rms((result.force - recording.truth["force"]) / result.force_std)


def moment_score(result, recording):
    """Error of the moment over its claimed standard deviation, rms."""
    return cf.rms((result.moment - recording.truth["moment"]) / result.moment_std)


def scores(result, recording):
    return force_score(result, recording), moment_score(result, recording)


def same(a, b, rtol=1e-9):
    for name in NUMBERS:
        x, y = getattr(a, name), getattr(b, name)
        np.testing.assert_allclose(x, y, rtol=0, atol=rtol * max(np.nanmax(np.abs(y), initial=0.0), 1e-300))


def test_steady_force_and_spin_up_are_recovered_within_their_claims(flown):
    recording, result = flown
    assert result.verdict.level == "ok", result.verdict.reasons
    assert result.model == "rigid"
    assert cf.rms(result.force - recording.truth["force"]) < 1e-3 * np.linalg.norm(cf.FORCE)
    assert cf.rms(result.moment - recording.truth["moment"]) < 1e-2 * cf.INERTIA[2, 2] * cf.SPIN[1]
    assert max(scores(result, recording)) < 3  # a constant load is one draw of three numbers


def test_motion_is_recovered_with_the_wrench(flown):
    recording, result = flown
    t = result.time[:, None]
    velocity = np.array([2.0, 0.5, 3.0]) + t * (cf.FORCE / cf.MASS + cf.GRAVITY)
    omega = (cf.SPIN[0] + cf.SPIN[1] * t) * cf.AXIS
    assert cf.rms(result.center - recording.truth["center"]) < cf.NOISE / np.sqrt(6)
    assert cf.rms(result.velocity - velocity) < 1e-3
    assert cf.rms(result.angular_velocity - omega) < 0.01
    assert cf.rms(result.angular_momentum - cf.INERTIA[2, 2] * omega) < 0.01 * cf.INERTIA[2, 2]
    turn = Rotation.from_quat(result.orientation) * Rotation.from_quat(recording.truth["orientation"]).inv()
    assert cf.rms(turn.magnitude()) < 2e-3
    assert (result.orientation[:, 3] >= 0).all()


@pytest.mark.long
def test_claims_hold_over_many_noises(estimated):
    middle = []
    for seed in range(8):
        recording = cf.toss(cf.clock(80), seed=seed)
        result = estimated(recording)
        error = np.hstack(
            [result.force - recording.truth["force"], result.moment - recording.truth["moment"]]
        )
        C = result.wrench_cov[40]
        middle.append(error[40] @ np.linalg.solve(C, error[40]) / 6)
    # 48 numbers: 3 sigma of chi-square / 48 above; below, claims allow for loads that noise may hide beside
    assert 0.25 < np.mean(middle) < 1.6


def test_breathing_body_is_recovered_with_its_changing_inertia(breathing):
    recording, result = breathing
    assert result.model == "modal"
    assert result.verdict.level == "ok", result.verdict.reasons
    assert result.mode_amplitude.shape == (120, 1)
    assert cf.rms(result.moment - recording.truth["moment"]) < 0.15 * cf.rms(recording.truth["moment"])
    assert max(scores(result, recording)) < 1.5
    breath = (cf.size_at(result.time, 0.05) - 1)[:, None, None] * recording.body.position
    spread = result.deformation - result.deformation.mean(0)
    assert cf.rms(spread - (breath - breath.mean(0))) < cf.NOISE


def test_rigid_model_of_a_breathing_body_says_that_the_model_limits_it(estimated, breathing):
    result = estimated(breathing[0], model="rigid")
    assert result.verdict.level == "degraded"
    assert "limited by the model" in result.verdict.reasons[0]
    assert "--model auto" in result.verdict.reasons[0]


def test_affine_model_gives_the_stretch(estimated, breathing):
    recording, _ = breathing
    result = estimated(recording, model="affine")
    size = cf.size_at(result.time, 0.05)
    expected = (size / np.mean(size))[:, None, None] * np.eye(3)
    assert result.stretch.shape == (120, 3, 3)
    assert cf.rms(result.stretch - expected) < 2e-3
    assert result.mode_amplitude is None
    assert moment_score(result, recording) < 1.5


def test_stretch_has_the_direction_in_which_the_body_grows(estimated):
    recording = cf.toss()
    size = cf.size_at(recording.motion.time, 0.05)
    along = Rotation.from_quat(recording.truth["orientation"]).as_matrix()[..., 1]
    longer = np.einsum("t,n,ta->tna", size - 1, recording.body.position[:, 1], along)
    result = estimated(cf.seen_as(recording, recording.motion.position + longer), model="affine")
    expected = np.tile(np.eye(3), (120, 1, 1))
    expected[:, 1, 1] = size / np.mean(size)
    assert cf.rms(result.stretch - expected) < 2e-3


@pytest.mark.parametrize("method", METHODS)
def test_one_marker_gives_the_force_and_says_what_is_not_seen(estimated, method):
    recording = cf.toss(body=cf.whole([0, 0, 0]))
    result = estimated(recording, method=method)
    assert np.isfinite(result.force).all()
    assert force_score(result, recording) < 3
    for name in ("moment", "orientation", "angular_velocity", "angular_momentum"):
        assert np.isnan(getattr(result, name)).all()
    assert np.isnan(result.moment_std).all()
    assert np.isfinite(result.force_std).all()
    assert result.verdict.level == "degraded"
    assert "particle" in result.verdict.reasons[0]


@pytest.mark.parametrize(
    "body",
    [
        cf.whole([0.1, 0, 0], [-0.1, 0, 0]),
        cf.whole([0.1, 0.2, 0], [-0.1, -0.2, 0], [0.2, 0.4, 0]),
    ],
    ids=["two markers", "three on a line"],
)
@pytest.mark.parametrize("method", ["smoother", "savgol"])
def test_markers_on_a_line_give_the_force_only(estimated, body, method):
    recording = cf.toss(body=body)
    result = estimated(recording, method=method)
    assert force_score(result, recording) < 3
    assert np.isnan(result.moment).all()
    assert np.isnan(result.orientation).all()
    assert result.verdict.level == "degraded"
    assert "lie on a line" in result.verdict.reasons[0]


def test_consistent_mass_matrix_gives_what_the_equal_lumped_one_gives(estimated, flown):
    recording, lumped = flown
    body = cf.star(mass_matrix=np.kron(np.diag(np.full(6, cf.MASS / 6)), np.eye(3)))
    same(estimated(replace(recording, body=body)), lumped, rtol=1e-6)


def test_body_known_as_a_whole_needs_no_mass_at_its_markers(estimated, flown):
    recording, lumped = flown
    body = cf.star(total_mass=cf.MASS, mass_center=np.zeros(3), inertia=cf.INERTIA)
    # in which something might turn, or be told wrong, as it cannot where all mass carries a marker
    exact = {"internal_momentum": (0, 0, 0), "body_std": {"mass_center": 1e-12, "inertia": 1e-12}}
    same(estimated(replace(recording, body=body), **exact), lumped, rtol=1e-6)


def test_body_known_as_a_whole_may_have_its_mass_center_off_the_markers(estimated):
    offset = np.array([0.02, -0.03, 0.01])
    known = cf.star(total_mass=cf.MASS, mass_center=offset, inertia=cf.INERTIA)
    shifted = replace(known, position=known.position + offset)
    recording = replace(cf.toss(), body=shifted)
    result = estimated(recording)
    assert cf.rms(result.center - recording.truth["center"]) < cf.NOISE / np.sqrt(6)
    assert max(scores(result, recording)) < 3


@pytest.mark.long
def test_gauges_agree_on_the_wrench_and_not_on_the_orientation(estimated):
    mass = np.array([0.06, 0.02, 0.04, 0.01, 0.03, 0.04])
    recording = cf.waved(cf.toss(body=cf.star(mass=mass)))
    x = recording.motion.position.copy()
    x[:, 3] = np.nan  # a node without a marker: sensor and Euclidean gauge then differ
    found = {g: estimated(cf.seen_as(recording, x), gauge=g) for g in ("mass", "euclidean", "sensor")}
    turned = {}
    for gauge, result in found.items():
        np.testing.assert_array_equal(result.force, found["mass"].force)
        np.testing.assert_array_equal(result.moment, found["mass"].moment)
        R = Rotation.from_quat(result.orientation)
        turned[gauge] = R
        world = result.center[:, None] + np.einsum(
            "tab,tnb->tna", R.as_matrix(), result.mean_shape + result.deformation
        )
        assert cf.rms(world[:, :3] - recording.motion.position[:, :3]) < 1.5 * cf.NOISE
    for a, b in (("mass", "euclidean"), ("mass", "sensor"), ("euclidean", "sensor")):
        assert (turned[a] * turned[b].inv()).magnitude().max() > 1e-4


@pytest.mark.parametrize("gauge", ["mass", "euclidean", "sensor"])
def test_each_gauge_keeps_its_condition(estimated, gauge):
    mass = np.array([0.06, 0.02, 0.04, 0.01, 0.03, 0.04])
    result = estimated(cf.waved(cf.toss(body=cf.star(mass=mass))), gauge=gauge, method="savgol")
    weight = mass if gauge == "mass" else np.ones(6)
    about = result.mean_shape - np.average(result.mean_shape, axis=0, weights=weight)
    shape = result.mean_shape + result.deformation
    torque = np.einsum("n,tna->ta", weight, np.cross(about, shape))
    size = np.einsum("n,tna->ta", weight, np.abs(result.deformation)).max() * np.abs(about).max()
    np.testing.assert_allclose(torque, 0.0, atol=1e-9 * size)


def test_frames_without_markers_degrade_and_spoil_nothing_else(estimated):
    recording = cf.toss()
    x = recording.motion.position.copy()
    x[40] = x[60:66] = np.nan
    x[80, :4] = np.nan
    gappy = cf.seen_as(recording, x)
    result = estimated(gappy)
    assert result.verdict.level == "degraded"
    assert "8 of 120 frames show no pose, the longest run 6 frames" in result.verdict.reasons[0]
    for name in ("force", "moment", "wrench_cov", "orientation"):
        assert np.isfinite(getattr(result, name)).all()
    assert max(scores(result, recording)) < 3
    assert np.isnan(result.nis[40])
    assert np.isfinite(result.nis[41])


@pytest.mark.parametrize("method", ["savgol", "spline", "difference"])
def test_classic_routes_lose_the_gap_alone(estimated, method):
    recording = cf.toss()
    x = recording.motion.position.copy()
    x[60:66] = np.nan
    result = estimated(cf.seen_as(recording, x), method=method)
    outside = np.r_[0:60, 66:120]
    for name in ("force", "moment", "orientation"):
        assert np.isfinite(getattr(result, name)[outside]).all()
    for name in ("force", "moment"):  # what is given has a claim, bridged or not
        given, claimed = getattr(result, name), getattr(result, f"{name}_std")
        np.testing.assert_array_equal(np.isfinite(claimed), np.isfinite(given))
    assert max(scores(result, recording)) < 3


@pytest.mark.parametrize("method", ["smoother", "savgol", "spline", "difference"])
def test_irregular_clock_changes_nothing_but_the_sampling(estimated, method):
    time = cf.clock(60) + np.random.default_rng(1).uniform(-2e-3, 2e-3, 60)
    recording = cf.toss(time)
    result = estimated(recording, method=method)
    np.testing.assert_array_equal(result.time, time)
    assert max(scores(result, recording)) < 3


@pytest.mark.long
def test_spin_near_half_a_turn_a_frame_is_followed_and_said(estimated):
    recording = cf.toss(cf.clock(80, 30.0), spin=(80.0, 0.0))  # 153 degrees a frame
    result = estimated(recording)
    assert result.verdict.level == "degraded"
    assert "the sense and number of turns are lost" in result.verdict.reasons[0]
    assert cf.rms(result.angular_velocity - 80.0 * cf.AXIS) < 0.1


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("method", ["smoother", "savgol"])
def test_measured_mean_motion_is_enough(estimated, stated, method):
    recording = cf.mean_motion(stated=stated)
    result = estimated(recording, method=method)
    assert max(scores(result, recording)) < 3
    assert result.deformation.shape == (120, 0, 3)
    assert cf.rms(result.force - recording.truth["force"]) < 0.01 * np.linalg.norm(cf.FORCE)


def test_gravity_of_the_settings_goes_before_that_of_the_file(estimated, flown):
    recording, on_earth = flown
    on_moon = estimated(recording, gravity=(0.0, 0.0, -1.62))
    weight = np.array([0, 0, cf.MASS * (9.81 - 1.62)])
    np.testing.assert_allclose(on_moon.force.mean(0), on_earth.force.mean(0) - weight, atol=2e-3)
    np.testing.assert_array_equal(on_moon.gravity, [0, 0, -1.62])


@pytest.mark.parametrize("method", METHODS)
def test_unseen_mass_center_is_refused_with_nothing_claimed(estimated, method):
    recording = cf.toss(body=cf.points([0.1, 0.05, 0, 0.05], [-0.1, 0.05, 0, 0.05], [0, -0.05, 0, 0.1]))
    x = recording.motion.position.copy()
    x[:, 2] = np.nan
    result = estimated(cf.seen_as(recording, x), method=method)
    assert result.verdict.level == "refused"
    assert "mark every node with mass" in result.verdict.reasons[0]
    for name in ("force", "moment", "wrench_cov", "orientation"):
        assert np.isnan(getattr(result, name)).all()


TURN = Rotation.from_rotvec([0.3, -1.1, 0.7])


def moved(recording, turn=TURN, shift=(5.0, -7.0, 2.0)):
    """The recording as it looks from another frame of the world."""
    motion = recording.motion
    x = turn.apply(motion.position.reshape(-1, 3)).reshape(motion.position.shape) + shift
    return replace(recording, motion=replace(motion, position=x, gravity=turn.apply(motion.gravity)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("flight", ["rigid", "breathing"])
def test_estimate_turns_and_shifts_with_the_world(estimated, method, flight):
    recording = cf.toss(cf.clock(80), breath=0.05 if flight == "breathing" else 0.0)
    here, there = estimated(recording, method=method), estimated(moved(recording), method=method)
    both = np.kron(np.eye(2), TURN.as_matrix())

    def close(name, a, b):
        assert bool(np.nanmax(np.abs(a - b)) < 1e-6 * np.nanmax(np.abs(b))), name

    for name in ("force", "moment", "velocity", "angular_velocity", "angular_momentum"):
        close(name, getattr(there, name), TURN.apply(getattr(here, name)))
    close("center", there.center - [5.0, -7.0, 2.0], TURN.apply(here.center))
    close("wrench_cov", there.wrench_cov, both @ here.wrench_cov @ both.T)
    turn = Rotation.from_quat(there.orientation) * (TURN * Rotation.from_quat(here.orientation)).inv()
    assert turn.magnitude().max() < 1e-6
    close("deformation", there.deformation + 1.0, here.deformation + 1.0)


@pytest.mark.parametrize("method", ["smoother", "savgol"])
def test_same_input_gives_the_same_bits(estimated, method):
    recording = cf.toss(cf.clock(80), breath=0.05, stated=False)
    first, second = estimated(recording, method=method), estimated(recording, method=method)
    for name in NUMBERS:
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name), strict=True)
    assert first.tuned == second.tuned


def test_estimate_leaves_its_input_alone(estimated):
    recording = cf.toss(cf.clock(60), breath=0.05)
    before = recording.motion.position.copy()
    estimated(recording, method="savgol", gravity=(0.0, 0.0, -1.6))
    np.testing.assert_array_equal(recording.motion.position, before)
    np.testing.assert_array_equal(recording.motion.gravity, cf.GRAVITY)


@pytest.mark.parametrize(
    ("stiffness", "words"),
    [
        (np.zeros((18, 18)), "/body/stiffness is all zero"),
        (cf.spring("front", "left"), "/body/stiffness lets .*a mechanism"),
        (np.eye(18), "/body/stiffness resists rigid motion"),
    ],
    ids=["zero", "mechanism", "held"],
)
def test_stiffness_that_a_free_body_cannot_have_is_a_data_error(estimated, stiffness, words):
    body = cf.star(mass=np.full(6, cf.MASS / 6), stiffness=stiffness)
    with pytest.raises(DataError, match=words):
        estimated(cf.toss(body=body))


def test_tree_in_tree_out_with_settings_and_hash_on_it():
    recording = cf.toss(cf.clock(60))
    result = forceid.estimate(tree_from_recording(recording), method="savgol", moment_about="left")
    found = result["estimate"]
    assert found["force"].shape == (60, 3)
    assert found.attrs["method"] == "savgol"
    assert found.attrs["moment_about"] == "left"
    assert 'moment_about = "left"' in result.attrs["config"]
    assert len(result.attrs["input_sha256"]) == 64
    assert "truth" in result.children


def test_settings_in_the_result_reproduce_it(estimated, tmp_path):
    recording = cf.toss(cf.clock(60))
    first = estimated(recording, method="spline", gauge="euclidean", noise_std={"position": 5e-4})
    (tmp_path / "again.toml").write_text(first.settings)
    again = load_settings(tmp_path / "again.toml")
    same(estimated(recording, **again.model_dump(exclude_none=True)), first, rtol=1e-15)
