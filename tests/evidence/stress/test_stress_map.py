"""The map itself: an estimator that is broken on purpose shows red, resumed runs, files, names."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from evidence.journal import Journal
from evidence.stress.cell import judge_cell
from evidence.stress.failure import Failure
from evidence.stress.failure_table import failures_named
from evidence.stress.figures import draw_map, draw_overview
from evidence.stress.page import page_of
from evidence.stress.run import (
    StressJob,
    as_plain,
    do,
    from_plain,
    key_of,
    leaves_green,
    maps_of,
    plan,
    threshold,
    trial_of,
)
from evidence.stress.subjects import FLIGHTS
from evidence.stress.trial import attempt
from evidence.subjects.flights.bodies import Setup
from evidence.subjects.flights.failures.record import measured
from evidence.subjects.flights.trial import contestant, contestants
from forceid.cli.app import main
from forceid.cli.boundary.output import finite_or_none
from forceid.estimation.run import estimate_recording

JOBS = [StressJob("mass", level, 1, True) for level in (0, 3e-3, 0.03)]


def healthy(level, rng):
    return measured(Setup(frames=100, wobble=4.0), rng)


HEALTHY = Failure("healthy", "none", "Nothing", "", (0.0,), "nothing breaks", healthy)


def boastful(recording, settings):
    e = estimate_recording(recording, settings)
    return replace(e, wrench_cov=e.wrench_cov / 100)


def without_gyroscopic_term(recording, settings):
    e = estimate_recording(recording, settings)
    return replace(e, moment=e.moment - np.cross(e.angular_velocity, e.angular_momentum))


def singular(recording, settings):
    raise np.linalg.LinAlgError("singular")


def cell_of(estimator=estimate_recording, seeds=(1, 2)):
    who = (contestant("smoother", estimator=estimator),)
    records = [attempt(FLIGHTS, HEALTHY, 0.0, seed, who) for seed in seeds]
    plain = [finite_or_none(r["trials"]["smoother"]) for r in records]
    return judge_cell([trial_of(t) for t in plain])


def test_the_default_is_green_on_a_healthy_record():
    found = cell_of()
    assert found.color == "green"
    assert max(found.over_bound) < 1.5


@pytest.mark.parametrize("broken", [boastful, without_gyroscopic_term, singular])
def test_an_estimator_that_is_broken_on_purpose_shows_red(broken):
    assert cell_of(broken, seeds=(1,)).color == "red"


@pytest.fixture(scope="module")
def records():
    return [do(job) for job in JOBS]


def test_a_record_of_another_seed_or_for_other_methods_is_not_taken_for_it():
    others = ({"seed": 2}, {"short": False}, {"level": 1.0})
    assert len({key_of(replace(JOBS[0], **other)) for other in ({}, *others)}) == 1 + len(others)


def test_a_command_whose_records_are_all_there_writes_its_files_without_estimating(
    records, tmp_path, capsys, monkeypatch
):
    journal = Journal.opened(tmp_path / "stress.jsonl")
    for job, record in zip(JOBS, records, strict=True):
        journal.once(key_of(job), partial(finite_or_none, record))
    monkeypatch.setattr("evidence.stress.run.do", partial(pytest.fail, "estimated again"))
    assert main(["stress", "mass", "-o", str(tmp_path), "--short"]) == 0
    assert "cells    3: 3 green" in capsys.readouterr().out
    assert {p.name for p in tmp_path.iterdir()} == {
        "stress.jsonl", "stress.json", "stress.md", "mass.png", "overview.png",
    }  # fmt: skip
    page = (tmp_path / "stress.md").read_text()
    assert "![Mass wrong](mass.png)" in page
    assert "No cell." in page


def test_a_word_that_names_no_failure_is_answered_with_the_nearest(tmp_path, capsys):
    assert main(["stress", "outlier", "-o", str(tmp_path)]) == 2
    assert "unknown failure 'outlier'; did you mean 'outliers'?" in capsys.readouterr().err


def test_a_group_names_its_failures():
    assert {f.group for f in failures_named(["body"])} == {"body"}
    assert len(failures_named(["body", "impact"])) == len(failures_named(["body"])) + 1


def test_every_model_of_the_body_is_tried_where_the_failure_is_about_it():
    by_name = {f.name: [who.name for who in contestants(f)] for f in failures_named([])}
    assert "smoother, modal" in by_name["vibration"]
    assert by_name["outliers"] == ["difference", "savgol", "spline", "filter", "smoother"]


def test_a_full_plan_holds_every_level_once_a_seed_and_very_long_records_once():
    todo = plan(failures_named([]), 5, short=False)
    assert len(todo) == len(set(todo)) == 8 * (5 * len(failures_named([])) - 4)


def test_thresholds_are_the_first_levels_off_green_and_at_red(records):
    trials = [finite_or_none(r["trials"]["smoother"]) for r in records]
    good = judge_cell([trial_of(trials[0])])
    boast = judge_cell([trial_of({**trials[1], "over": [9.0, 1.0], "told": [0.0, 0.0]})])
    said = judge_cell([trial_of({**trials[0], "verdict": "degraded"})])
    cells = (good, said, boast)
    assert leaves_green((1, 2, 3), cells) == 2
    assert threshold((1, 2, 3), cells, "red") == 3
    assert threshold((1, 2, 3), (good,), "red") is None
    assert said.needless
    assert not good.needless


def test_numbers_pictures_and_page_come_from_the_same_cells(records):
    chosen = failures_named(["mass"])
    maps = maps_of([finite_or_none(r) for r in records], chosen, short=True)
    plain = as_plain(maps, 1, True)
    row = plain["failures"][0]["contestants"][0]
    assert [c["color"] for c in row["cells"]] == ["green", "green", "green"]
    assert row["leaves_green"] is None
    marks = [text.get_text() for text in draw_map(maps[0]).axes[0].texts]
    assert all(mark.startswith("✓") for mark in marks)
    shown = [text.get_text() for text in draw_overview(maps).axes[0].texts]
    assert shown == ["✓ 0", "✓ 0.003", "✓ 0.03"]
    page = page_of(maps, 1)
    assert f"| {maps[0].failure.title} | - |" in page
    assert "No cell." in page


@pytest.mark.parametrize(
    "folder", sorted((Path(__file__).parents[3] / "docs").glob("stress*")), ids=lambda path: path.name
)
def test_pages_of_the_site_are_what_their_numbers_say(folder):
    plain = json.loads((folder / "stress.json").read_text("utf-8"))
    assert (folder / "stress.md").read_text("utf-8") == page_of(from_plain(plain), plain["seeds"])
