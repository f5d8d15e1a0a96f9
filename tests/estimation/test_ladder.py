"""The ladder takes the smallest level that is enough, on scenes whose level and wrench are known."""

import importlib.util
from dataclasses import replace
from functools import cache
from pathlib import Path

import closed_forms as cf
import numpy as np
import pytest

from forceid.config import load_settings
from forceid.estimation.beyond_rigid import beyond_rigid, correlation, dynamic_gain, often_seen
from forceid.estimation.classic import estimate_classic
from forceid.estimation.flight_smoother import estimate_flight
from forceid.estimation.ladder import Step, climb, explaining, levels, weigh
from forceid.estimation.run import estimate_recording
from forceid.files.hdf5 import read_motion
from forceid.kalman.engines import engine

FILE = Path(__file__).parents[2] / "benchmarks" / "ladder.py"
SPEC = importlib.util.spec_from_file_location("scenes_of_known_level", FILE)
scenes = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(scenes)
scene = cache(scenes.scene)


def climbed(recording, **settings):
    """The ladder of a recording and its solution, with the settings that were solved."""
    solved = []

    def solve(level):
        solved.append(level)
        return estimate_flight(recording.body, recording.motion, level, engine())

    asked = load_settings(**({"lines": "none"} | settings))
    return climb(recording.body, recording.motion, asked, engine(), solve), solved


def test_scene_moves_as_its_moment_says():
    time = np.arange(scenes.FRAMES) / scenes.RATE
    step = 1e-4
    mass = scenes.body().mass
    arms = [scenes.arms_at(time + k * step, "modal 3", 0)[0] for k in (-2, -1, 0, 1, 2)]
    # third-order accurate speed at both ends of a step, then the rise of the angular momentum over it
    speed = [(arms[k + 1] - arms[k - 1]) / (2 * step) for k in (1, 3)]
    H = [np.einsum("n,tna->ta", mass, np.cross(arms[k], v)) for k, v in zip((1, 3), speed, strict=True)]
    moment = scene("modal 3", 1e-4, 0).truth["moment"]
    np.testing.assert_allclose((H[1] - H[0]) / (2 * step), moment, atol=2e-3 * np.abs(moment).max())


def test_modes_of_a_scene_hold_no_rigid_motion():
    body, shapes = scenes.body(), scenes.shapes("modal 6")
    mass = body.mass[:, None]
    np.testing.assert_allclose((mass * shapes).sum(1), 0.0, atol=1e-15)
    spin = (mass * np.cross(body.position, shapes)).sum(1)
    np.testing.assert_allclose(spin, 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("level", "noise", "seed"),
    [("rigid", 1e-4, 3), ("modal 3", 1e-3, 4)],
)
def test_smallest_sufficient_level_is_taken(level, noise, seed):
    recording = scene(level, noise, seed)
    (ladder, _), _ = climbed(recording)
    assert scenes.named(ladder.level) == scenes.smallest_sufficient(recording, level)[0]


def test_level_of_most_evidence_is_that_of_the_scene():
    for level in ("rigid", "affine", "modal 1", "modal 3"):
        recording = scene(level, 3e-4, 1)
        rungs = levels(recording.body, recording.motion, load_settings())
        steps = weigh(recording.motion, rungs, True, engine())
        assert scenes.named(steps[explaining(steps)]) == level


def test_smaller_level_claims_an_error_that_allows_for_its_distance():
    recording = scene("affine", 1e-3, 0)
    (ladder, solution), solved = climbed(recording)
    plain = estimate_flight(recording.body, recording.motion, solved[0], engine())
    ratio = solution.state.wrench_cov / plain.state.wrench_cov
    force, moment = 1 + ladder.level.force_change**2, 1 + ladder.level.moment_change**2
    assert ladder.level.change > 0.05
    np.testing.assert_allclose(ratio[:, :3, :3], force)
    np.testing.assert_allclose(ratio[:, 3:, 3:], moment)
    assert ladder.level.vetoed
    assert "explains the markers better, but moves force and moment by only" in ladder.sentence


def test_flight_is_solved_once_where_the_best_level_is_taken():
    (ladder, _), solved = climbed(scene("modal 1", 1e-4, 2))
    assert ladder.level.name == "modal, 1 mode"
    assert len(solved) == 1
    assert "rigid would move force and moment by" in ladder.sentence
    assert "the next step, affine, would move force and moment by" in ladder.sentence


def test_lost_markers_do_not_move_the_level():
    recording = scene("modal 1", 1e-4, 2)
    position = recording.motion.position.copy()
    position[40:200, 3] = position[100:130, 7:9] = np.nan
    (ladder, _), _ = climbed(replace(recording, motion=replace(recording.motion, position=position)))
    assert ladder.level.name == "modal, 1 mode"


def test_number_of_modes_asked_for_is_the_only_one_tried():
    recording = scene("modal 3", 1e-4, 0)
    rungs = levels(recording.body, recording.motion, load_settings(modes=2))
    assert [(r.settings.model, len(r.kinematics.shapes)) for r in rungs] == [
        ("rigid", 0), ("modal", 2), ("affine", 6)
    ]  # fmt: skip


def test_mean_motion_has_nothing_to_climb():
    assert climbed(cf.mean_motion())[0] is None


@pytest.mark.parametrize(
    ("recording", "settings"),
    [
        (cf.toss(time=cf.clock(15)), {}),
        (cf.toss(body=cf.points([0, 0, 0, 0.2])), {}),
        (cf.toss(breath=0.05), {"modes": 0}),
    ],
    ids=["too few frames", "a particle", "no modes wanted"],
)
def test_where_nothing_is_to_choose_there_is_no_ladder(recording, settings):
    assert climbed(recording, **settings)[0] is None


@pytest.mark.parametrize("method", ["filter", "savgol"])
def test_level_does_not_hang_on_the_method(method):
    recording = cf.toss(breath=0.05)
    solve = estimate_flight if method == "filter" else estimate_classic
    settings = load_settings(method=method)

    def solved(level):
        return solve(recording.body, recording.motion, level, engine())

    ladder, _ = climb(recording.body, recording.motion, settings, engine(), solved)
    assert ladder.level.name == "modal, 1 mode"


def test_deformation_that_moves_no_resultant_is_left_out():
    whole = cf.star(total_mass=cf.MASS, mass_center=np.zeros(3), inertia=cf.INERTIA)
    (ladder, _), _ = climbed(cf.toss(body=whole, breath=0.05))
    assert ladder.level.name == "rigid"
    assert ladder.level.chi_square > 10


def test_levels_go_up_by_degrees_of_freedom_and_affine_before_as_many_modes():
    recording = scene("affine", 1e-4, 0)
    found = [
        (r.settings.model, len(r.kinematics.shapes))
        for r in levels(recording.body, recording.motion, load_settings())
    ]
    assert [count for _, count in found] == sorted(count for _, count in found)
    assert found.index(("affine", 6)) < found.index(("modal", 6))


def test_dynamic_prior_sees_a_vibration_that_a_frame_alone_does_not():
    time = np.arange(400) / 500
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((400, 1))
    q = np.sqrt(2) * np.sin(2 * np.pi * 5 * time)[:, None] + noise
    # an amplitude free in every frame explains all of q, at the price of a number a frame (Schwarz 1978)
    free = 0.5 * float((q**2).sum()) - 0.5 * len(q) * np.log(len(q))
    gain, nis = dynamic_gain(time, q, 1.0, engine())
    assert free < 0
    assert gain > 20
    assert nis == pytest.approx(1.0, abs=0.15)
    assert dynamic_gain(time, noise, 1.0, engine())[0] < 5


def test_deformation_beyond_the_rigid_motion_is_linear_in_its_shapes_however_fast_the_spin():
    recording = scene("modal 3", 1e-12, 0)
    position = recording.motion.position
    kin = levels(recording.body, recording.motion, load_settings())[0].kinematics
    exact = replace(kin, shape=recording.body.position)
    y, U = beyond_rigid(position, exact, kin.seen)
    inside = np.linalg.qr((scenes.shapes("modal 3").reshape(3, -1) @ U).T)[0]
    assert np.abs(y).max() > 1e-3
    assert np.abs(y - y @ inside @ inside.T).max() < 1e-8


def test_markers_seen_least_are_left_out():
    position = np.zeros((10, 5, 3))
    position[:6, 1] = position[:2, 2] = np.nan
    assert often_seen(position, np.ones(5, bool)).tolist() == [True, False, True, True, True]


def test_color_of_what_is_left_is_called_by_chance_as_often_as_stated():
    rng = np.random.default_rng(5)
    called = [correlation(rng.standard_normal((200, 12)), 12)[1] for _ in range(400)]
    assert 0 <= np.mean(called) < 0.025  # 0.01 stated: three standard errors are 0.015
    slow = np.cumsum(rng.standard_normal((200, 12)), axis=0)
    assert correlation(slow, 12)[1]


def test_vetoed_level_gives_way_to_the_next_that_is_not():
    def step(evidence, vetoed):
        return Step("modal", 1, 1.0, 1.0, 0.0, vetoed, evidence)

    assert explaining([step(0, True), step(9, True), step(8, False)]) == 2
    assert explaining([step(0, False), step(9, True), step(8, True)]) == 1


def test_a_result_of_the_ladder_names_its_steps_and_the_one_taken():
    recording = read_motion(Path(__file__).parents[2] / "data" / "synthetic" / "planar_boomerang.h5")
    e = estimate_recording(recording, load_settings(model="ladder"))
    taken = [name for name, value in e.tuned.items() if name.endswith("_taken") and value == 1]
    assert len(taken) == 1
    assert taken[0].split("_")[2] == e.model
    assert sum(name.endswith("_evidence") for name in e.tuned) >= 2
