"""Affine bodies on the chart: their truth is nobody's answer, and the page says who is ahead."""

import json

import numpy as np
import pytest

from evidence.chart import run as chart
from evidence.chart.figures import draw_case
from evidence.chart.front import points_of
from evidence.chart.page import of_case, overview, quickest, sentences
from evidence.chart.run import chart_row
from evidence.chart.subjects import CHARTED
from evidence.subject import Answer
from evidence.subjects.affine import cases as affine_cases
from evidence.subjects.affine.cases import case_called
from evidence.subjects.affine.chart import AFFINE, errors, facts
from evidence.subjects.affine.ways import ways
from forceid.cli.app import main
from forceid.errors import EstimationError


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(affine_cases, "FRAMES", 50)
    monkeypatch.setattr(affine_cases, "KNOWN", 10)


def by_name(case, name):
    return next(way for way in ways(case.kind) if way.name == name)


def error(case, way):
    """Errors of what a way answers."""
    return errors(case, way.prepare(case)())


@pytest.mark.long
def test_polar_keeps_its_digits_where_an_svd_loses_them():
    case = case_called("polar_1e6")
    off = {
        name: error(case, by_name(case, name))["rotation"]
        for name in ("polar", "numpy svd", "scipy.linalg.polar", "numpy Newton")
    }
    assert off["polar"] < 1e-15
    assert min(off["numpy svd"], off["scipy.linalg.polar"]) > 1e-13


@pytest.mark.parametrize(
    ("name", "way", "below"),
    [
        ("ball", "verlet 0.1", 2e-2), ("ball", "blanes_moan_6 0.1", 1e-9), ("ball", "reference", 1e-12),
        ("ball", "scipy DOP853 1e-06", 1e-5), ("held_block", "kahan_li_8 0.4", 1e-6),
        ("held_block", "scipy DOP853 1e-09", 1e-8),
    ],
)  # fmt: skip
def test_ours_and_peers_arrive_at_the_same_motion(name, way, below):
    case = case_called(name)
    found = error(case, by_name(case, way))
    assert found["F"] < below
    assert found["F'"] < 4 * below


def test_time_of_who_follows_a_part_of_the_bodies_is_that_of_all():
    case = case_called("ball")
    way = next(w for w in ways("bodies") if w.kind == "peer")
    assert way.whole == 50
    one = {"error": dict.fromkeys(case.quantities, 1e-3), "seconds": 0.1, "peak_MB": None, "again": None}
    one |= {"verdict": "", "reasons": [], "chosen": "", "iterations": None}
    found = chart_row(AFFINE, facts([case], []), way, [one], [0.2], [])
    assert found["seconds"] == pytest.approx(10.0)
    assert found["part"]


def test_what_ends_early_is_no_answer():
    case = case_called("ball")
    with pytest.raises(EstimationError, match="does not get to the end"):
        errors(case, Answer(tuple(x[:-1] for x in case.truth)))
    assert errors(case, Answer(case.truth)) == {"F": 0.0, "F'": 0.0}


def case_of(*rows):
    return {
        "name": "b", "title": "B", "kind": "body", "quantities": ["F", "F'"], "resolved": 1e-11,
        "units": None, "rows": list(rows),
    }  # fmt: skip


def point(name, kind, seconds, error):
    return {
        "name": name, "line": name.split()[0], "kind": kind, "about": "", "part": False, "peak_MB": None,
        "told": False, "times_default": None, "verdict": {},
        "error": {"F": error, "F'": error}, "seconds": seconds, "seconds_range": [seconds, seconds],
    }  # fmt: skip


def test_the_fastest_to_an_error_are_compared():
    case = case_of(point("verlet 0.1", "method", 0.01, 1e-4), point("scipy 1e-3", "peer", 0.5, 1e-5))
    assert "verlet 0.1 (1.0e-04, 10 ms) | scipy 1e-3 (1.0e-05, 500 ms) | 50 |" in overview(AFFINE, [case])
    assert quickest(points_of(case, "F"), 1e-9) is None
    assert "No peer is faster" not in sentences(AFFINE, case)[0] or "verlet" in sentences(AFFINE, case)[0]


def test_a_peer_that_is_faster_and_as_accurate_is_named_and_one_without_answer_told():
    case = case_of(
        point("verlet 0.1", "method", 1.0, 1e-4), point("scipy 1e-3", "peer", 0.1, 1e-5),
        {"name": "lost", "line": "lost", "kind": "peer", "about": "", "told": False, "failed": "no way"},
    )  # fmt: skip
    assert "scipy 1e-3 (1.0e-05, 10 times as fast)" in sentences(AFFINE, case)[0]
    text = "\n".join(of_case(AFFINE, case))
    assert "| lost | no answer: no way |" in text
    said = [t.get_text() for t in draw_case(AFFINE, case).axes[0].texts]
    assert "no answer: lost" in said


@pytest.mark.long
def test_a_case_is_charted_and_found_again(tmp_path, charting):
    asked = charting("affine", ways("factors"))
    for _ in range(2):
        result = chart.run(
            [(CHARTED["affine"], "polar_1e2")], tmp_path, chart.SHORT, "x", lambda what, part: None
        )
    assert asked == [way.name for way in ways("factors")]
    (case,) = result["cases"]
    assert case["rows"][0]["error"]["rotation"] < 1e-15


@pytest.mark.long
def test_the_command_charts_affine_bodies(tmp_path, capsys):
    assert main(["chart", "polar_1e2", "-o", str(tmp_path), "--short"]) == 0
    (case,) = json.loads((tmp_path / "chart.json").read_text())["cases"]
    assert np.isfinite([r["seconds"] for r in case["rows"]]).all()
    assert "## Affine bodies" in (tmp_path / "chart.md").read_text()
    assert (tmp_path / "chart_polar_1e2.png").stat().st_size > 10_000
    assert "fastest peer" in capsys.readouterr().out
