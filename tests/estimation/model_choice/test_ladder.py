"""The ladder takes the smallest level that is enough, on scenes whose level and wrench are known."""

import html
import importlib.util
from dataclasses import replace
from functools import cache
from pathlib import Path

import closed_forms as cf
import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from evidence.calibration.record import drawn_record
from forceid.config import load_settings
from forceid.estimation.body.deformation_residual import (
    Beyond,
    beyond_rigid,
    correlation,
    dynamic_gain,
    often_seen,
)
from forceid.estimation.body.kinematics import kinematics
from forceid.estimation.methods.classic import estimate_classic
from forceid.estimation.methods.smoother import estimate_flight
from forceid.estimation.model_choice.ladder import choose_level, errors_beside
from forceid.estimation.model_choice.levels import LevelCandidate, Step, explaining, levels, weigh
from forceid.estimation.run import estimate_recording
from forceid.files.result import read_result, write_result
from forceid.files.stored.hdf5 import read_motion
from forceid.flight.color import LowPassed
from forceid.kalman.engines import engine
from forceid.report.page import render_page
from forceid.scenes.recipe import load_recipe, simulate

EVIDENCE = Path(__file__).parents[3] / "evidence"
FILE = EVIDENCE / "claims" / "ladder.py"
DATA = EVIDENCE.parent / "data" / "synthetic"
SPEC = importlib.util.spec_from_file_location("scenes_of_known_level", FILE)
scenes = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(scenes)
scene = cache(scenes.scene)


def climbed(recording, **settings):
    """What the ladder chose and its solution, with the settings that were solved."""
    solved = []

    def solve(level, kin, shown):
        solved.append(level)
        return estimate_flight(recording.body, recording.motion, level, engine(), kin, shown)

    asked = load_settings(**({"lines": "none"} | settings))
    kin = kinematics(recording.body, recording.motion, asked)
    return choose_level(kin, recording.motion, asked, engine(), solve), solved


def rungs(recording, **settings):
    """The levels of a recording, and what it shows beyond the rigid motion."""
    asked = load_settings(**settings)
    most = kinematics(recording.body, recording.motion, asked.model_copy(update={"model": "modal"}))
    beyond = beyond_rigid(recording.motion.time, recording.motion.position, most)
    return levels(most.markers, asked, most), beyond


def test_scene_moves_as_its_moment_says():
    time = np.arange(scenes.FRAMES) / scenes.RATE
    step = 1e-4
    mass = scenes.twelve_masses().mass
    arms = [scenes.arms_at(time + k * step, "modal 3", 0) for k in (-2, -1, 0, 1, 2)]
    # third-order accurate speed at both ends of a step, then the rise of the angular momentum over it
    speed = [(arms[k + 1] - arms[k - 1]) / (2 * step) for k in (1, 3)]
    H = [np.einsum("n,tna->ta", mass, np.cross(arms[k], v)) for k, v in zip((1, 3), speed, strict=True)]
    moment = scene("modal 3", 1e-4, 0).truth["moment"]
    np.testing.assert_allclose((H[1] - H[0]) / (2 * step), moment, atol=2e-3 * np.abs(moment).max())


def test_modes_of_a_scene_hold_no_rigid_motion():
    body, shapes = scenes.twelve_masses(), scenes.shapes("modal 6")
    mass = body.mass[:, None]
    np.testing.assert_allclose((mass * shapes).sum(1), 0.0, atol=1e-15)
    spin = (mass * np.cross(body.position, shapes)).sum(1)
    np.testing.assert_allclose(spin, 0.0, atol=1e-15)


@pytest.mark.long
@pytest.mark.parametrize(
    ("level", "noise", "seed"),
    [("rigid", 1e-4, 3), ("modal 3", 1e-3, 1)],
)
def test_smallest_sufficient_level_is_taken(level, noise, seed):
    recording = scene(level, noise, seed)
    (choice, _), _ = climbed(recording)
    taken = scenes.level_name(choice.level) if choice.level else choice.model
    assert taken == scenes.smallest_sufficient(recording, level)[0]


def test_level_of_most_evidence_is_that_of_the_scene():
    for level in ("rigid", "affine", "modal 1", "modal 3"):
        several, beyond = rungs(scene(level, 3e-4, 1))
        steps = weigh(beyond, several, True, True, engine())
        assert scenes.level_name(steps[explaining(steps)]) == level


@pytest.mark.long
def test_smaller_level_claims_an_error_that_allows_for_its_distance():
    recording = scene("modal 6", 3e-4, 0)
    (choice, solution), solved = climbed(recording)
    own_level = next(level for level in solved if level.modes == choice.level.modes)
    plain = estimate_flight(recording.body, recording.motion, own_level, engine())
    wide, own = (np.diagonal(s.state.wrench_cov, axis1=1, axis2=2) for s in (solution, plain))
    ratio = wide / own
    force, moment = 1 + choice.level.force_change**2, 1 + choice.level.moment_change**2
    assert choice.level.change > 0.05
    np.testing.assert_allclose(ratio[:, :3], force)
    np.testing.assert_allclose(ratio[:, 3:], moment)
    assert choice.level.vetoed
    assert "modal, 6 modes explains more of the markers" in choice.sentence
    assert "but would move force and moment by only" in choice.sentence


@pytest.mark.long
def test_strains_that_explain_a_body_are_not_traded_for_shapes_found_in_its_record():
    (choice, _), solved = climbed(scene("affine", 1e-3, 0))
    assert choice.model == "affine"
    assert {str(level.model) for level in solved} <= {"rigid", "affine"}


@pytest.mark.long
def test_smaller_level_that_pays_with_a_wider_claim_is_not_enough():
    """Five markers at 2 kHz and 1 mm: rigid, the moment follows the vibration, and claims for it."""
    recipe = load_recipe(DATA / "flexible_boomerang_5_markers.toml")
    asked = {"sample_rate": 2000.0, "noise_std": 1e-3, "duration": 0.3, "seed": 1}
    recording = simulate(recipe.model_copy(update=asked))
    taken, rigid = (estimate_recording(recording, load_settings(model=m)) for m in ("auto", "rigid"))
    assert taken.model == "modal"
    assert cf.rms(rigid.moment_std) > 1.25 * cf.rms(taken.moment_std)
    error = [cf.rms((e.moment - recording.truth["moment"])[75:-75]) for e in (taken, rigid)]
    assert error[0] < 0.5 * error[1]


def test_flight_is_solved_once_where_the_best_level_is_taken():
    (choice, _), solved = climbed(scene("modal 1", 1e-4, 2))
    assert choice.level.name == "modal, 1 mode"
    assert len(solved) == 1
    assert "with rigid force and moment would be off by" in choice.sentence
    assert "the next step, affine, costs 5 more amplitudes a frame" in choice.sentence


def test_lost_markers_do_not_move_the_level():
    recording = scene("modal 1", 1e-4, 2)
    position = recording.motion.position.copy()
    position[40:200, 3] = position[100:130, 7:9] = np.nan
    (choice, _), _ = climbed(replace(recording, motion=replace(recording.motion, position=position)))
    assert choice.level.name == "modal, 1 mode"


def test_number_of_modes_asked_for_is_the_only_one_tried():
    recording = scene("modal 3", 1e-4, 0)
    assert [(r.settings.model, len(r.shapes)) for r in rungs(recording, modes=2)[0]] == [
        ("rigid", 0), ("modal", 2), ("affine", 6)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("recording", "settings", "why"),
    [
        (cf.mean_motion(), {}, "a mean motion shows no deformation"),
        (cf.toss(time=cf.clock(15)), {}, "the markers that each frame shows keep their shape"),
        (cf.toss(time=cf.clock(15), breath=0.05), {}, "15 frames that show every marker are too few"),
        (cf.toss(body=cf.whole([0, 0, 0])), {}, "so few markers show no deformation"),
        (cf.toss(body=cf.points([0, 0, 0, 0.2])), {}, "all mass lies on a line or a point"),
        (cf.toss(breath=0.05), {"modes": 0}, "no modes are asked for"),
        (cf.toss(), {}, "no deformation stands out of the noise"),
    ],
    ids=[
        "mean motion",
        "few frames, rigid",
        "too few frames",
        "one marker",
        "a particle",
        "no modes wanted",
        "rigid",
    ],
)
def test_where_nothing_is_to_choose_one_flight_is_solved_and_it_is_said_why(recording, settings, why):
    (choice, _), solved = climbed(recording, **settings)
    assert choice.level is None
    assert len(solved) == 1
    assert choice.sentence.startswith(f"the model is {choice.model}: {why}")


@pytest.mark.parametrize("method", ["filter", "savgol"])
def test_level_does_not_hang_on_the_method(method):
    recording = cf.toss(breath=0.05)
    solve = estimate_flight if method == "filter" else estimate_classic
    settings = load_settings(method=method)

    def solved(level, kin, _):
        return solve(recording.body, recording.motion, level, engine(), kin)

    kin = kinematics(recording.body, recording.motion, settings)
    choice, _ = choose_level(kin, recording.motion, settings, engine(), solved)
    assert choice.level.name == "modal, 1 mode"


def test_what_the_mass_of_a_body_known_as_a_whole_may_do_as_its_markers_deform_is_claimed():
    whole = cf.star(total_mass=cf.MASS, mass_center=np.zeros(3), inertia=cf.INERTIA)
    (choice, solution), _ = climbed(cf.toss(body=whole, breath=0.05))
    still = climbed(cf.toss(body=whole))[0][1]
    claims = [
        np.sqrt(np.diagonal(s.state.wrench_cov, axis1=1, axis2=2)[20:-20, :3].mean())
        for s in (solution, still)
    ]
    assert choice.level.name == "modal, 1 mode"
    assert claims[0] > 3 * claims[1]


def test_levels_go_up_by_degrees_of_freedom_and_affine_before_as_many_modes():
    recording = scene("affine", 1e-4, 0)
    found = [(r.settings.model, len(r.shapes)) for r in rungs(recording)[0]]
    assert [count for _, count in found] == sorted(count for _, count in found)
    assert found.index(("affine", 6)) < found.index(("modal", 6))


def test_dynamic_prior_sees_a_vibration_that_a_frame_alone_does_not():
    time = np.arange(400) / 500
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((400, 1))
    q = np.sqrt(2) * np.sin(2 * np.pi * 5 * time)[:, None] + noise
    # an amplitude free in every frame explains all of q, at the price of a number a frame (Schwarz 1978)
    free = 0.5 * float((q**2).sum()) - 0.5 * len(q) * np.log(len(q))
    (gain,), (nis,) = dynamic_gain(time, q, 1.0, engine())
    assert free < 0
    assert gain > 20
    assert nis == pytest.approx(1.0, abs=0.15)
    assert dynamic_gain(time, noise, 1.0, engine())[0][0] < 5


def test_deformation_beyond_the_rigid_motion_is_linear_in_its_shapes_however_fast_the_spin():
    recording = scene("modal 3", 1e-12, 0)
    kin = kinematics(recording.body, recording.motion, load_settings())
    exact = replace(kin, shape=recording.body.position)
    beyond = beyond_rigid(recording.motion.time, recording.motion.position, exact)
    y, inside = beyond.y, np.linalg.qr(beyond.of(scenes.shapes("modal 3")).T)[0]
    assert np.abs(y).max() > 1e-3
    assert np.abs(y - y @ inside @ inside.T).max() < 1e-8


def test_markers_seen_least_are_left_out():
    position = np.zeros((10, 5, 3))
    position[:6, 1] = position[:2, 2] = np.nan
    assert often_seen(position, np.ones(5, bool)).tolist() == [True, False, True, True, True]


def test_color_of_what_is_left_is_called_by_chance_as_often_as_stated():
    rng = np.random.default_rng(5)
    white, none = [rng.standard_normal((200, 12)) for _ in range(400)], np.zeros(10)
    assert np.mean([correlation(y, 12, none)[1] for y in white]) < 0.025  # 0.01 stated, 0.015 by chance
    slow = np.cumsum(rng.standard_normal((200, 12)), axis=0)
    assert correlation(slow, 12, none)[1]


def test_noise_whose_memory_is_known_is_not_called_colored():
    color = LowPassed(2, 0.2, 1.0)
    rng, sos = np.random.default_rng(6), butter(2, 0.4, output="sos")
    called = []
    for _ in range(100):
        y = sosfiltfilt(sos, rng.standard_normal((700, 12)), axis=0)[50:-50]
        beyond = Beyond(np.arange(600.0), y, np.eye(12), np.ones(4, bool), 1.0).told_anew(color, y.std())
        assert np.mean(beyond.y**2) * color.counted == pytest.approx(beyond.var, rel=0.1)
        called.append(correlation(beyond.y, 12, beyond.memory)[1])
    assert np.mean(called) < 0.05


@pytest.mark.long
@pytest.mark.parametrize("cut", [None, 0.25])
def test_strains_are_not_taken_for_noise_that_nobody_stated_raw_or_low_passed(cut):
    """Beside the strains the errors of the markers are alike; beside fewer shapes they are not."""
    recording = scene("affine", 1e-3, 2)
    tracks = recording.motion.position
    if cut is not None:
        tracks = sosfiltfilt(butter(2, 2 * cut, output="sos"), tracks, axis=0)
    motion = replace(recording.motion, position=tracks, noise_std={})
    found = estimate_recording(replace(recording, motion=motion), load_settings())
    assert found.model == "affine"
    edge = len(tracks) // 8
    for name in ("force", "moment"):
        off, std = getattr(found, name) - recording.truth[name], getattr(found, f"{name}_std")
        assert cf.rms(off[edge:-edge]) < 1.5 * cf.rms(std[edge:-edge])


@pytest.mark.long
@pytest.mark.parametrize("color", ["white", "low-passed", "remembers"])
def test_fewest_shapes_that_leave_errors_alike_are_found_whatever_their_color(color):
    """Five numbers swing beside errors that are alike in all twelve, of 12 draws."""
    rng = np.random.default_rng(8)
    shapes = np.zeros((12, 6, 3))
    shapes.reshape(12, 18)[:, :12] = np.eye(12)
    several = [LevelCandidate(load_settings(), shapes[:k], None) for k in range(13)]
    found = []
    for _ in range(12):
        errors = rng.standard_normal((1000, 12))
        if color == "low-passed":
            errors = sosfiltfilt(butter(2, 0.3, output="sos"), errors, axis=0)
        elif color == "remembers":
            errors = lfilter([1.0], [1.0, -0.8], errors, axis=0)
        y, time = errors[300:-100], np.arange(600)
        y[:, :5] += 5 * np.cos(rng.uniform(0.02, 0.4, 5) * time[:, None] + rng.uniform(0, 6, 5))
        beyond = Beyond(0.01 * time, y, np.eye(18)[:, :12], np.ones(6, bool), 1.0)
        found.append(len(errors_beside(beyond, several)[1].shapes))
    assert np.median(found) == 5
    assert found.count(5) >= 10


def test_vetoed_level_gives_way_to_the_next_that_is_not():
    def step(evidence, vetoed):
        return Step("modal", 1, 1.0, 1.0, 0.0, vetoed, evidence)

    assert explaining([step(0, True), step(9, True), step(8, False)]) == 2
    assert explaining([step(0, False), step(9, True), step(8, True)]) == 1


def test_amplitudes_that_their_prior_does_not_predict_veto_a_level():
    rng = np.random.default_rng(3)
    y = rng.standard_normal((400, 6))
    y[:, 0] += 5 * np.sign(
        rng.standard_normal(400)
    )  # as large as it is erratic: white leaves nothing to predict
    shape = np.zeros((1, 4, 3))
    shape[0, 0, 0] = 1.0
    beyond = Beyond(np.arange(400) / 500, y, np.eye(12)[:, :6], np.ones(4, bool), 1.0)
    several = [
        LevelCandidate(load_settings(model=m), s, None) for m, s in (("rigid", shape[:0]), ("modal", shape))
    ]
    _, erratic = weigh(beyond, several, False, True, engine())
    assert erratic.chi_square == pytest.approx(1.0, abs=0.1)
    assert erratic.nis > 1.2
    assert erratic.vetoed
    y[:, 0] = rng.standard_normal(400) + 5 * np.sin(2 * np.pi * 5 * beyond.time)
    _, smooth = weigh(beyond, several, False, True, engine())
    assert not smooth.vetoed


@pytest.mark.long
def test_levels_that_agree_on_mass_that_neither_follows_prove_nothing():
    folder = Path(__file__).parents[3] / "data" / "synthetic"
    recipe = load_recipe(folder / "flexible_boomerang_5_markers.toml")
    recording = simulate(recipe.model_copy(update={"noise_std": 1e-4, "sample_rate": 250.0}))
    bare = replace(recording, body=replace(recording.body, stiffness=None))
    e = estimate_recording(bare, load_settings(lines="none"))
    error = (e.moment - recording.truth["moment"])[19:-19]
    assert e.model == "modal"
    assert np.sqrt(np.mean((error / e.moment_std[19:-19]) ** 2)) < 1.3


@pytest.mark.long
def test_a_result_names_its_steps_and_the_one_taken_and_says_why(tmp_path):
    recording = read_motion(Path(__file__).parents[3] / "data" / "synthetic" / "planar_boomerang.h5")
    e = estimate_recording(recording, load_settings())
    taken = [name for name, value in e.ladder.items() if name.endswith("_taken") and value == 1]
    assert len(taken) == 1
    assert taken[0].split("_")[0] == e.model
    assert sum(name.endswith("_evidence") for name in e.ladder) >= 2
    assert e.model_choice.startswith(f"the model is {e.model}")
    write_result(tmp_path / "result.h5", e, recording)
    again = read_result(tmp_path / "result.h5")
    assert (again.model_choice, again.ladder) == (e.model_choice, e.ladder)
    assert e.model_choice[1:] in html.unescape(render_page(again))


@pytest.mark.long
def test_strains_that_say_where_mass_goes_are_taken_over_found_shapes_that_leave_it_open():
    """A body that rings, known as a whole: two shapes found in it explain its markers by a hair better."""
    recording = drawn_record(76700, 367).recording
    found = estimate_recording(recording, load_settings())
    assert found.model == "affine"
    inner = slice(len(found.time) // 8, -len(found.time) // 8)
    off = np.sqrt(np.mean((found.force - recording.truth["force"])[inner] ** 2))
    assert off < 1.0  # N; 740 under the found shapes
    assert found.verdict.level == "ok"
