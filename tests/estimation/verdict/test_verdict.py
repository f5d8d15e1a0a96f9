"""What is said of an estimate, in which words, and that nothing is said where nothing is wrong."""

from dataclasses import replace

import closed_forms as cf
import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from evidence.subjects.flights.failures.body import load_directions, rigid_looking_mode, vibration
from evidence.subjects.flights.failures.noise import shared_errors
from evidence.subjects.flights.failures.sensing import clipping, spin_per_frame
from forceid.config import load_settings
from forceid.errors import DataError
from forceid.estimation.body.cleaning import cleaned
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.run import estimate_recording
from forceid.estimation.verdict.finding import (
    judge,
    judge_leakage,
    judge_recording,
    judge_rounding,
    judge_tuning,
)
from forceid.estimation.verdict.innovations import (
    judge_innovations,
    lag_one_correlation,
    strongest_line,
    wild_innovation,
)
from forceid.estimation.verdict.leakage import leakage
from forceid.estimation.verdict.loads import judge_haste, judge_loads, judge_overlap, judge_roughness
from forceid.estimation.verdict.shape import judge_reference, judge_shape, judge_size
from forceid.estimation.verdict.tracks import judge_mending
from forceid.estimation.verdict.turns import told_by_moment
from forceid.motion.free_rotation import largest_turn
from forceid.principal.loads import solve_loads
from forceid.records import Body, Finding

TIME = cf.clock(400)


def seen(recording, **settings):
    return kinematics(recording.body, recording.motion, load_settings(**settings))


def white(seed=0, channels=6):
    return np.random.default_rng(seed).standard_normal((len(TIME), channels))


def innovations_judged(v, reach=1.0):
    return [f.text for f in judge_innovations(TIME, v, (v**2).mean(1), np.full(v.shape[1], reach))]


def test_worst_finding_sets_the_level():
    small, large = Finding("one", "degraded", {}, "a"), Finding("two", "refused", {}, "b")
    assert judge([]).level == "ok"
    assert judge([Finding("none", "ok", {}, "c")]).level == "ok"
    assert judge([small, small]).level == "degraded"
    assert judge([small, large]).level == "refused"
    assert judge([small, large]).reasons == ("a", "b")


def test_good_record_gives_no_finding():
    kin = seen(cf.toss())
    assert judge_recording(kin) == []
    assert judge_shape(kin, cf.toss().body) == []
    assert judge_tuning(kin, {"position": True}) == []  # stated: a floor by right


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (cf.whole([0, 0, 0]), "one marker is a particle"),
        (cf.whole([0.1, 0, 0], [-0.1, 0, 0]), "the 2 markers lie on a line"),
        (cf.whole([0.1, 0, 0], [-0.1, 0, 0], [0.3, 0, 0]), "the 3 markers lie on a line"),
    ],
    ids=["one", "two", "line"],
)
def test_markers_that_do_not_fix_the_rotation_are_named_with_a_next_step(body, words):
    (found,) = judge_recording(seen(cf.toss(body=body)))
    assert words in found.text
    assert "; add " in found.text
    assert found.level == "degraded"


def test_unseen_mass_center_is_refused():
    recording = cf.toss(body=cf.points([0.1, 0.05, 0, 0.05], [-0.1, 0.05, 0, 0.05], [0, -0.05, 0, 0.1]))
    x = recording.motion.position.copy()
    x[:, 2] = np.nan
    (found,) = judge_recording(seen(cf.seen_as(recording, x)))
    assert found.level == "refused"
    assert "do not span" in found.text


@pytest.mark.parametrize("spin", [150.0, 210.0])  # degrees a frame; 210 one way looks like 150 the other
def test_spin_near_half_a_turn_a_frame_is_said(spin):
    turn = np.radians(spin) * 30.0
    (found,) = judge_recording(seen(cf.toss(cf.clock(60, 30.0), spin=(turn, 0.0), noise=1e-6)))
    assert "turns 150 degrees between frames" in found.text


def test_spin_well_below_half_a_turn_is_not_said():
    assert judge_recording(seen(cf.toss(cf.clock(60, 30.0), spin=(60.0, 0.0)))) == []  # 115 degrees


def test_largest_turn_skips_gaps_and_takes_rare_frames_as_they_come():
    turns = np.repeat([0.1, 0.6, 0.2], 5)
    R = Rotation.from_rotvec(np.outer(np.cumsum([0.0, *turns]), [0, 0, 1])).as_matrix()
    time = np.arange(16.0)
    assert largest_turn(time, R) == pytest.approx(0.6)
    gap = R.copy()
    gap[6:10] = np.nan
    assert largest_turn(time, gap) == pytest.approx(0.2)
    R[1::2] = np.nan
    assert largest_turn(time, R) == pytest.approx(0.7)  # of steps of 0.2, 0.2, 0.7, 1.2, 0.9, 0.4 and 0.4
    R[1:] = np.nan
    assert largest_turn(time, R) == 0.0


def test_one_pose_that_is_off_is_no_fast_turn():
    R = Rotation.from_rotvec(np.outer(0.1 * np.arange(20), [0, 0, 1])).as_matrix()
    R[7] = R[7] @ Rotation.from_rotvec([3.0, 0, 0]).as_matrix()
    assert largest_turn(np.arange(20.0), R) == pytest.approx(0.1)


def test_lost_frames_are_counted_with_their_longest_run():
    recording = cf.toss()
    x = recording.motion.position.copy()
    x[[10, *range(50, 58)]] = np.nan
    (found,) = judge_recording(seen(cf.seen_as(recording, x)))
    assert "9 of 120 frames show no pose, the longest run 8 frames" in found.text


def test_few_lost_frames_are_bridged_and_the_claim_holds_there():
    recording = cf.toss()
    x = recording.motion.position.copy()
    lost = [10, 30, 50, 51, 52, 53, 80]
    x[lost] = np.nan
    assert judge_recording(seen(cf.seen_as(recording, x))) == []
    estimate = estimate_recording(cf.seen_as(recording, x), load_settings())
    for name in ("force", "moment"):
        error = getattr(estimate, name) - recording.truth[name]
        assert (np.abs(error) < 4 * getattr(estimate, f"{name}_std"))[lost].all()


def test_markers_that_stand_elsewhere_than_on_the_body_are_said():
    recording = cf.toss()
    assert judge_reference(recording.body, seen(recording)) == []
    place = recording.body.position.copy()
    place[2] += [0.0, 0.02, 0.0]
    body = replace(recording.body, position=place)
    (found,) = judge_reference(body, seen(replace(recording, body=body)))
    assert "leaves the reference shape" in found.text
    assert "/body/position" in found.text


def test_an_affine_body_that_is_stretched_all_the_time_about_another_point_stands_where_it_should():
    rng = np.random.default_rng(5)
    X = rng.uniform(-0.1, 0.1, (8, 3))
    body = Body(tuple("abcdefgh"), X, np.ones(8))
    recording = cf.toss(body=body)
    stretch = np.eye(3) + 0.2 * rng.standard_normal((3, 3))
    shape = (X - X.mean(0)) @ stretch + [0.0, 0.01, 0.02]
    kin = replace(seen(recording), model="affine", shape=shape)
    assert judge_reference(body, kin) == []
    shape[3] += [0.0, 0.05, 0.0]
    assert len(judge_reference(body, replace(kin, shape=shape))) == 1


@pytest.mark.parametrize("reference", [True, False], ids=["too", "not"])
def test_millimeters_read_as_meters_are_said_whether_the_reference_is_in_them_or(reference):
    recording = cf.toss()
    assert judge_size(seen(recording)) == []
    motion = replace(recording.motion, position=1e3 * recording.motion.position, noise_std={})
    body = recording.body
    if reference:
        body = replace(body, position=1e3 * body.position)
        (found,) = judge_size(seen(replace(recording, body=body, motion=motion)))
        assert "is lighter than any" in found.text
        assert "set the attribute units" in found.text
        estimate = estimate_recording(replace(recording, body=body, motion=motion), load_settings())
        assert estimate.verdict.level == "degraded"
        assert found.text in estimate.verdict.reasons
    else:
        with pytest.raises(DataError, match="units"):
            seen(replace(recording, body=body, motion=motion))


def test_a_force_of_hundreds_of_weights_all_the_time_is_said():
    recording = cf.toss()
    kin, force = seen(recording), np.zeros((len(recording.motion.time), 3))
    force[::3] = 1e5  # blows
    assert judge_haste(kin, force) == []
    force[:, 2] = kin.inertia.mass * 9810.0
    (found,) = judge_haste(kin, force)
    assert "over 1000 times the weight" in found.text


def test_records_too_short_to_show_how_a_load_varies_are_said():
    kin = seen(cf.toss(cf.clock()[:49]))
    assert any("49 frames are too few" in f.text for f in judge_tuning(kin, {}))
    assert judge_tuning(seen(cf.toss(cf.clock()[:50])), {}) == []


def test_mass_without_marker_on_a_deforming_body_is_said():
    recording = cf.waved(cf.toss())
    x = recording.motion.position.copy()
    x[:, 5] = np.nan
    assert "1 nodes carry mass but no marker" in judge_recording(seen(cf.seen_as(recording, x)))[0].text
    assert judge_recording(seen(cf.seen_as(cf.toss(), x), model="rigid")) == []


def test_rigid_model_of_a_deforming_body_is_limited_by_the_model():
    recording = cf.toss(breath=0.05)
    (found,) = judge_shape(seen(recording, model="rigid"), recording.body)
    assert "limited by the model" in found.text
    size = 0.05 * np.sqrt(0.5 * np.mean(cf.star().position ** 2)) * 1e3
    assert float(found.text.split(" mm rms")[0].split()[-1]) == pytest.approx(size, rel=0.1)
    assert judge_shape(seen(recording), recording.body) == []


def test_an_affine_model_of_a_body_that_bends_is_limited_by_the_model():
    recording = vibration(5e-3, np.random.default_rng(1)).recording
    (found,) = judge_shape(seen(recording, model="affine"), recording.body)
    assert "leave the affine shape" in found.text
    assert judge_shape(seen(recording), recording.body) == []


def test_an_affine_model_of_unmarked_mass_is_limited_where_the_file_knows_modes():
    recording = rigid_looking_mode(0.5, np.random.default_rng(1)).recording
    (found,) = judge_shape(seen(recording, model="affine"), recording.body)
    assert "3 nodes carry mass but no marker" in found.text


def test_a_load_that_kinks_is_said():
    (found,) = judge_roughness({"force": cf.load_prior(1), "moment": cf.load_prior(2)})
    assert found.text.startswith("the force found kinks")
    assert judge_roughness({"force": cf.load_prior(2)}) == []


@pytest.mark.parametrize(("size", "said"), [(0.1, False), (1.0, True), (3.0, True)])
def test_slow_errors_that_all_markers_share_are_said_and_counted(size, said):
    case = shared_errors(size, np.random.default_rng([2, 2026]))
    found = estimate_recording(case.recording, load_settings())
    assert ("errors-of-all" in found.verdict.codes) == said
    assert found.verdict.level == "ok"
    error = found.force - case.recording.truth["force"]
    assert 0.5 < np.sqrt(np.mean(error**2) / np.mean(found.force_std**2)) < 1.5


def test_noise_at_its_floor_is_said_unless_it_was_stated():
    kin = seen(cf.toss(stated=False))
    (found,) = judge_tuning(kin, {"position": True})
    assert "state noise_std.position" in found.text
    assert judge_tuning(kin, {"position": False}) == []


def test_white_innovations_of_unit_size_are_not_remarked_on():
    for seed in range(20):
        assert innovations_judged(white(seed)) == []


@pytest.mark.parametrize(
    ("size", "word"), [(0.5, "smoother than the noise"), (1.5, "noise stated is too small")]
)
def test_innovations_of_another_size_than_predicted_are_said_in_numbers(size, word):
    (text,) = innovations_judged(size * white())
    assert f"{size:.2f}"[:3] in text
    assert word in text


def test_color_is_found_in_its_channel():
    v = white()
    v[:, 4] = lfilter([np.sqrt(1 - 0.6**2)], [1, -0.6], v[:, 4])
    r, channel = lag_one_correlation(v)
    assert channel == "rotation y"
    assert r == pytest.approx(0.6, abs=0.1)
    v[::2, 4] = np.nan
    assert lag_one_correlation(v) == (0.0, "")  # no two neighbors left


def test_line_is_found_where_it_hides_a_load():
    v = white()
    v[:, 1] += 1.5 * np.sin(2 * np.pi * 20.0 * TIME)
    hertz, channel = strongest_line(TIME, v, np.ones(6))
    assert hertz == pytest.approx(20.0, abs=0.5)
    assert channel == "center y"
    assert strongest_line(TIME, v, np.full(6, 1e-6)) == (0.0, "")  # too small a load to matter
    assert strongest_line(TIME, white(), np.full(6, 1e6)) == (0.0, "")


def test_method_without_innovations_is_not_judged_by_them():
    assert judge_innovations(TIME, np.zeros((400, 0)), np.full(400, np.nan), np.zeros(0)) == []


def loads_of(G, wrench, noise=0.01):
    rng = np.random.default_rng(0)
    g = wrench + noise * rng.standard_normal((50, 6))
    return solve_loads(g, noise**2 * np.eye(6), G, length=0.1, name=("a", "b"))


def test_loads_that_explain_the_wrench_are_not_remarked_on():
    G = np.eye(6)[:, :2]
    assert judge_loads(loads_of(G, np.array([1.0, 2, 0, 0, 0, 0]))) == []
    assert judge_loads(None) == []


def test_wrench_that_the_loads_do_not_explain_is_said():
    (found,) = judge_loads(loads_of(np.eye(6)[:, :2], np.array([1.0, 2, 3, 0, 0, 0])))
    assert "unexplained" in found.text


def test_loads_on_one_line_are_said_to_be_known_in_combination_only():
    G = np.repeat(np.eye(6)[:, :1], 2, axis=1)
    (found,) = judge_loads(loads_of(G, np.array([1.0, 0, 0, 0, 0, 0])))
    assert "the loads a, b are determined in combination only" in found.text


def test_loads_without_a_number_are_left_to_what_made_them_so():
    found = loads_of(np.eye(6)[:, :2], np.full(6, np.nan))
    assert judge_loads(replace(found)) == []


def test_mode_that_looks_rigid_from_the_markers_is_named():
    # heavy tips that no marker shows bend against the middle, which moves almost as one
    mass = np.array([0.02] * 6 + [0.05, 0.05])
    places = np.concatenate([cf.star().position, [[1.0, 0, 0], [-1.0, 0, 0]]])
    bend = np.zeros((1, 8, 3))
    bend[0, 6:, 2], bend[0, :6, 2] = 1.0, -0.1 / 0.12
    bend[0, 0, 2] -= 0.01
    body = replace(cf.star(), node=tuple("abcdefgh"), position=places, mass=mass, mode_shape=bend)
    body = replace(body, mode_frequency=np.array([8.0]))
    recording = cf.toss(body=body)
    x = recording.motion.position.copy()
    x[:, 6:] = np.nan
    kin = seen(cf.seen_as(recording, x), model="rigid")
    found = leakage(body, kin)
    (text,) = [f.text for f in judge_leakage(found)]
    assert text.startswith("mode 1 (8 Hz) moves the markers almost as a rigid motion does")
    assert "strain gauges" in text
    assert found.to_rigid[0] > 50


def test_good_markers_and_no_markers_are_not_remarked_on():
    recording = cf.toss()
    kin = seen(recording)
    assert judge_leakage(leakage(recording.body, kin)) == []
    assert judge_leakage(None) == []


def overlapping(claimed, rate=30.0, std=1.0):
    """Findings on one node that waves at `rate` rad/s, in the gauge of masses that leave it out."""
    recording = cf.waved(cf.toss(body=cf.star(mass=np.array([1, 0, 1, 1, 1, 1.0]) * cf.MASS / 5)), rate=rate)
    kin = seen(recording)
    priors = {"force": cf.load_prior(1, std, std)}
    return judge_overlap(kin, np.nan_to_num(kin.amplitude), priors, np.full((120, 3), claimed))


def test_vibration_inside_the_band_of_the_force_is_named_where_it_costs_more_than_is_claimed():
    (found,) = overlapping(claimed=1e-7)
    assert "shape 1 of the deformation vibrates at 5 Hz, inside the band of the force" in found.text
    assert overlapping(claimed=10.0) == []  # too little to matter
    assert overlapping(claimed=1e-7, std=1e-4) == []  # the force is not followed that fast
    kin = seen(cf.toss())
    assert judge_overlap(kin, np.zeros((120, 0)), {}, np.ones((120, 3))) == []


@pytest.mark.parametrize(("degrees", "said"), [(45.0, False), (8.0, False), (3.0, True), (0.1, True)])
def test_loads_along_nearly_one_direction_are_said_to_be_split_badly(degrees, said):
    case = load_directions(degrees, np.random.default_rng(0))
    estimate = estimate_recording(case.recording, load_settings(**case.settings))
    told = [f.values["names"] for f in estimate.verdict.findings if f.code == "loads-alike"]
    assert bool(told) is said
    assert all("first, second" in names and "third" not in names for names in told)


@pytest.mark.long
def test_turns_past_half_a_revolution_show_as_a_moment_that_turns_the_body_over():
    """A body that turns 240 degrees a frame about a wobbling axis reads as one of 120 the other way."""
    for degrees, said in ((60.0, False), (240.0, True)):
        case = spin_per_frame(degrees, np.random.default_rng(0))
        estimate = estimate_recording(case.recording, load_settings(method="savgol"))
        assert ("turn-by-moment" in estimate.verdict.codes) is said


@pytest.mark.long
@pytest.mark.parametrize(("degrees", "told"), [(150.0, True), (185.0, False), (240.0, False)])
def test_a_turn_is_told_where_all_others_would_take_far_more_moment(degrees, told):
    kin = seen(spin_per_frame(degrees, np.random.default_rng(0)).recording)
    assert told_by_moment(kin) is told
    levels = {f.code: f.level for f in judge_recording(kin)}
    assert levels.get("fast-turn", "ok") == ("ok" if told or degrees > 200 else "degraded")


def test_a_spin_about_an_axis_that_keeps_is_told_by_no_moment():
    """Either sense takes none, but for the noise."""
    recording = cf.toss()
    kin = seen(recording)
    axis = kin.inertia.tensor[2] / np.linalg.norm(kin.inertia.tensor[2])
    turn = np.radians(160) * np.arange(len(kin.time))[:, None] * axis
    wobble = Rotation.from_rotvec(1e-4 * np.random.default_rng(1).standard_normal(turn.shape))
    steady = (wobble * Rotation.from_rotvec(turn)).as_matrix()
    assert not told_by_moment(replace(kin, pose=replace(kin.pose, rotation=steady)))


def test_an_innovation_that_chance_does_not_make_is_said_once():
    v = white()
    assert innovations_judged(v) == []
    v[200, 1] = 6.2
    (text,) = innovations_judged(v)
    assert "6.2 sigma" in text
    again = judge_innovations(TIME, v, (v**2).mean(1), np.ones(6), wild_said=True)
    assert again == []


def test_as_few_records_are_called_wild_by_chance_as_stated():
    rng = np.random.default_rng(1)
    drawn, right = rng.standard_normal((2000, 400, 6)), np.ones(400)
    called = [wild_innovation(TIME, v, right) is not None for v in drawn]
    assert sum(called) <= 3  # of 2000, one in ten thousand
    called = [wild_innovation(TIME, 1.25 * v, right) is not None for v in drawn]
    assert sum(called) >= 20  # of normal samples of unit variance a quarter too large


@pytest.mark.parametrize(("step", "said"), [(1e-6, False), (5e-5, False), (3e-3, True)])
def test_coordinates_rounded_to_more_than_their_noise_are_said(step, said):
    recording = cf.toss()
    x = np.round(recording.motion.position / step) * step
    kin = kinematics(recording.body, recording.motion, load_settings(noise_std={"position": cf.NOISE}))
    assert bool(judge_rounding(replace(kin, markers=replace(kin.markers, tracks=x)))) is said
    assert judge_rounding(kin) == []


def test_markers_that_stick_to_the_edge_of_the_volume_are_left_out_and_said():
    recording = clipping(0.4, np.random.default_rng(1)).recording
    motion, mended = cleaned(recording.body, recording.motion)
    stuck = recording.motion.position[..., 0] == mended.edge
    assert stuck.any()
    assert not np.isfinite(motion.position[stuck]).any()
    (found,) = judge_mending(mended)
    assert "markers stick at x" in found.text
    assert found.level == "degraded"
    assert judge_mending(replace(mended, stuck=mended.frames // 30))[0].level == "ok"
    at_rest = np.repeat(recording.motion.position[:1], 50, 0)
    for still in (cf.toss().motion, replace(recording.motion, time=np.arange(50.0), position=at_rest)):
        assert not cleaned(recording.body, still)[1].stuck


@pytest.mark.long
@pytest.mark.parametrize("share", [0.01, 0.03])
def test_frames_at_an_edge_leave_force_and_moment_as_claimed(share):
    for seed in range(3):
        record = clipping(share, np.random.default_rng([seed, 5])).recording
        found, inner = estimate_recording(record, load_settings()), slice(30, -30)
        assert found.verdict.level == "ok"
        assert "markers-stuck" in found.verdict.codes
        for name in ("force", "moment"):
            off, std = getattr(found, name) - record.truth[name], getattr(found, f"{name}_std")
            assert np.mean(off[inner] ** 2) < 4 * np.mean(std[inner] ** 2)
