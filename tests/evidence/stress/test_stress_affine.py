"""Affine bodies in the stress map: the truth is one, functions that are broken on purpose show red."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.stress import run as stress
from evidence.stress.cell import judge_cell
from evidence.stress.failure import Failure
from evidence.stress.failure_table import failures_named
from evidence.stress.figures import draw_map, draw_overview
from evidence.stress.page import page_of
from evidence.stress.run import StressJob, key_of, maps_of, trial_of
from evidence.stress.subjects import AFFINE, AFFINE_LOADS, default_of, subject_of
from evidence.stress.trial import UNKNOWN, attempt, tried
from evidence.subject import Answer, at_once
from evidence.subjects.affine import failures as fa
from evidence.subjects.affine import failures_loads as fl
from evidence.subjects.affine import trial as affine_trial
from evidence.subjects.affine.bodies import Throw, followed, natural_constants, sprung
from evidence.subjects.affine.contestants import path_signs, polar_factor
from evidence.subjects.affine.exact_polar import exact_polar
from evidence.subjects.affine.problem import AffineProblem
from evidence.subjects.affine.trial import takers
from evidence.vectors import EYE, hat
from forceid.cli.app import main
from forceid.cli.boundary.output import finite_or_none
from forceid.pseudorigid import polar

BY_NAME = {f.name: f for f in failures_named(["affine", "affine_loads"])}
QUICK = ("flattened", "needle", "close_values", "values_meet", "collapse", "alike_moments")


def rng():
    return np.random.default_rng(1)


def cell_of(name, level, answer=None, seeds=(1, 2)):
    failure = BY_NAME[name]
    who = takers(failure, True)[0] if answer is None else at_once("broken", answer)
    records = [attempt(subject_of(failure), failure, level, seed, (who,)) for seed in seeds]
    trials = [trial_of(finite_or_none(r["trials"][who.name])) for r in records]
    return judge_cell(trials, subject_of(failure).quantities)


@pytest.mark.parametrize("name", QUICK)
def test_what_forceid_is_asked_for_first_is_green_on_a_healthy_body(name):
    assert cell_of(name, BY_NAME[name].levels[0]).color == "green"


@pytest.mark.parametrize("name", ["collapse", "axes_meet", "off_volume", "close_values", "values_meet"])
def test_at_the_hopeless_end_it_is_said(name):
    assert cell_of(name, BY_NAME[name].levels[-1], seeds=(1,)).color in ("grey", "amber")


def blurred(problem):
    found = polar_factor(problem)
    turn = Rotation.from_rotvec([0, 0, 1e-12]).as_matrix()
    return replace(found, found=(found.found[0] @ turn, found.found[1]))


def crashing(problem):
    raise ZeroDivisionError


@pytest.mark.parametrize(("broken", "cause"), [(blurred, "motion error"), (crashing, "crashed")])
def test_factors_that_are_broken_on_purpose_show_red(broken, cause):
    found = cell_of("flattened", 1e2, broken)
    assert found.color == "red"
    assert cause in found.cause


def test_a_path_that_jumps_where_values_cross_shows_red():
    assert cell_of("values_meet", 0.0, path_signs).color == "red"
    assert cell_of("values_meet", 20.0, path_signs).color == "green"


def test_who_goes_on_after_a_collapse_is_wrong_and_who_stops_is_not():
    problem = fa.collapse(-0.3, rng())
    ended = np.isnan(problem.motion).any((1, 2))
    assert ended.any()
    assert not ended.all()
    past = np.where(np.isnan(problem.motion), 0.1, problem.motion)
    goes_on = tried(AFFINE, problem, UNKNOWN, at_once("", lambda p: Answer((past, past))))
    stops = tried(AFFINE, problem, UNKNOWN, at_once("", lambda p: Answer((p.motion, p.rate))))
    assert goes_on.error == (1.0, 1.0)
    assert stops.error == (0.0, 0.0)


def test_motion_on_springs_is_what_the_integrated_equation_gives():
    throw = Throw(1.7 * EYE, (1.7,), np.diag([1.1, 1.0, 0.9]), 0.3 * hat(EYE[2]), np.linspace(0, 1, 5))
    for closed, found in zip(sprung(throw), followed(throw), strict=True):
        np.testing.assert_allclose(found, closed, atol=1e-11)


def test_forces_written_down_for_the_truth_are_the_slope_of_the_energy():
    a, b, c, d = natural_constants(0.6, 0.25, 0.4)
    throw = Throw(EYE, (a, b, c, d), EYE, EYE, np.array([0.0]))
    F = EYE + 0.2 * rng().standard_normal((3, 3))

    def energy(F):
        C, J = F.T @ F, np.linalg.det(F)
        second = 0.5 * (np.trace(C) ** 2 - np.trace(C @ C))
        return a * np.trace(C) + b * second + c * J**2 - d * np.log(J)

    for i, j in np.ndindex(3, 3):
        step = 1e-6 * np.outer(EYE[i], EYE[j])
        assert throw.push(F)[i, j] == pytest.approx((energy(F + step) - energy(F - step)) / 2e-6, rel=1e-7)
    assert np.abs(throw.push(EYE)).max() < 1e-15


def test_polar_factors_in_decimals_are_a_rotation_and_a_symmetric_stretch():
    F = np.array([[1.2, 0.3, -0.1], [0.2, 0.9, 0.4], [-0.3, 0.1, 0.7]])
    L, omega = exact_polar(F[None], (F @ hat(EYE[0]))[None])
    # theory note, section 12.7
    assert L[0, 0, 0] == pytest.approx(0.99665392707453, abs=1e-14)
    U = L[0].T @ F
    np.testing.assert_allclose(U, U.T, atol=1e-15)
    np.testing.assert_allclose(L[0], polar(F)[0], atol=1e-15)
    A = U @ hat(EYE[0])
    vee = np.array([(A - A.T)[2, 1], (A - A.T)[0, 2], (A - A.T)[1, 0]])
    np.testing.assert_allclose((np.trace(U) * EYE - U) @ omega[0], vee, atol=1e-14)


@pytest.mark.parametrize("level", [20.0, 1.0, 0.0])
def test_rates_of_a_path_that_nearly_meets_are_those_of_its_frames(level):
    problem = fa.values_meet(level, rng())
    F, step = problem.given.F, problem.given.step
    middle = np.diff(F, axis=0) / step
    ends = 0.5 * (problem.given.dF[1:] + problem.given.dF[:-1])
    assert np.abs(middle - ends).max() < 1e-3
    stretch = np.linalg.svd(F, compute_uv=False)
    np.testing.assert_allclose(stretch, problem.motion, atol=1e-14)


@pytest.mark.parametrize("bent", [0.0, 0.05])
def test_loads_of_a_flight_are_the_second_differences_of_its_markers(bent):
    problem = fl.filmed(rng(), fl.SPREAD[:6], noise=0.0, bent=bent)
    x, mass = problem.given.motion.position, problem.given.body.mass[0]
    pull = mass * (x[2:] - 2 * x[1:-1] + x[:-2]) * fl.RATE**2
    arm = x[1:-1] - x[1:-1].mean(1, keepdims=True)
    np.testing.assert_allclose(pull.sum(1) - fl.MASS * fl.GRAVITY, problem.motion[1:-1], atol=5e-3)
    first = np.einsum("tna,tnb->tab", pull, arm).reshape(-1, 9)
    np.testing.assert_allclose(first, problem.rate[1:-1], atol=2e-3)


def test_an_estimate_is_green_on_a_healthy_affine_body():
    assert cell_of("loud_markers", 3e-4, seeds=(1,)).color == "green"


def test_affine_code_counts_for_affine_bodies_and_not_for_flights(monkeypatch):
    jobs = [
        StressJob("mass", 0.0, 1, True),
        StressJob("needle", 1.0, 1, True),
        StressJob("few_affine_markers", 8, 1, True),
    ]
    before = [key_of(job) for job in jobs]
    code = stress.code_hash

    def changed(sources):
        sources = list(sources)
        return code(sources) + "changed" * any("pseudorigid" in path.parts for path in sources)

    monkeypatch.setattr(stress, "code_hash", changed)
    after = [key_of(job) for job in jobs]
    assert [a == b for a, b in zip(after, before, strict=True)] == [True, False, False]


def test_every_affine_failure_runs_from_healthy_to_hopeless_and_knows_who_meets_it():
    assert {f.name for f in failures_named(["affine", "affine_loads"])} == set(BY_NAME)
    for failure in BY_NAME.values():
        names = [who.name for who in takers(failure)]
        assert len(failure.levels) == len(set(failure.levels)) == 8
        assert len(names) == len(set(names)) > 1
        assert default_of(failure) == names[0]
        assert subject_of(failure) is (AFFINE if failure.group == "affine" else AFFINE_LOADS)
    every = [f.name for f in failures_named([])]
    assert len(every) == len(set(every))
    assert set(affine_trial.MEETS) == {f.name for f in failures_named(["affine"])}


def test_pictures_and_page_of_affine_bodies_name_what_each_is_judged_by():
    chosen = failures_named(["needle", "collapse"])
    records = [stress.do(StressJob(f.name, f.levels[k], 1, True)) for f in chosen for k in (0, 2, 4)]
    maps = maps_of([finite_or_none(r) for r in records], chosen, short=True)
    title = draw_map(maps[0]).axes[0].get_title(loc="left")
    assert title.endswith("error over claim, the worse of motion and rate")
    assert (
        draw_overview(maps).axes[0].get_title(loc="left").startswith("Where functions of affine bodies break")
    )
    page = page_of(maps, 1)
    assert "## Thresholds of the functions of affine bodies" in page
    assert "polar factors of eighty digits" in page


@pytest.mark.long
def test_the_command_maps_affine_bodies(tmp_path, capsys):
    assert main(["stress", "collapse", "-o", str(tmp_path), "--short", "-j", "1"]) == 0
    assert "cells    3:" in capsys.readouterr().out
    assert (tmp_path / "collapse.png").stat().st_size > 10_000


def test_a_problem_of_its_own_kind_is_met_by_a_contestant_of_its_own(monkeypatch):
    own = Failure(
        "own", "affine", "Own", "", (1.0,), "", lambda level, rng: AffineProblem(0, EYE, EYE, (1e-9, 1e-9))
    )
    monkeypatch.setitem(affine_trial.MEETS, "own", (at_once("same", lambda p: Answer((p.motion, p.rate))),))
    found = attempt(AFFINE, own, 1.0, 1, takers(own))["trials"]["same"]
    assert found["error"] == (0.0, 0.0)
    assert found["verdict"] == "ok"
