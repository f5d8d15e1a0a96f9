"""The front of the chart, the sentences on it, and what is kept of finished work."""

import json

import numpy as np
import pytest
from spinning_body import spinning

from evidence.chart.front import Point, ahead, front, over_best
from evidence.chart.labels import free_place, overlap
from evidence.chart.page import overview, page, sentences
from evidence.chart.subjects import CHARTED
from evidence.journal import Journal, code_hash, key, sources_in
from evidence.subject import Answer
from evidence.subjects.flights.cases import case_of
from evidence.subjects.flights.chart import ALIKE, FLIGHTS, scored_by_axis
from evidence.subjects.flights.methods import halves

OURS = Point("smoother", 1e-3, 1.0, True, False)
SLOW_PEER = Point("slow peer", 1e-2, 0.5, False, False)
FAST_PEER = Point("fast peer", 1e-5, 0.5, False, False)
COARSE_PEER = Point("coarse peer", 1e-5, 3.0, False, False)
TOLD_PEER = Point("told peer", 1e-5, 0.5, False, True)


def row(point, load=1.0):
    one = {"force": point.error, "moment": float("nan")}
    return {
        "name": point.name, "kind": "method" if point.ours else "peer", "told": point.told, "error": one,
        "seconds": point.seconds, "seconds_range": [point.seconds] * 2, "over_bound": one, "coverage": one,
        "times_default": 1.0, "peak_MB": None, "verdict": {}, "chosen": "", "reasons": [], "about": "",
        "part": False,
    }  # fmt: skip


def chart_of(*points):
    return {
        "subject": "flights", "quantities": ["force", "moment"], "units": ["N", "N m"], "resolved": 0.0,
        "name": "case", "title": "case", "seeds": 1, "measured": False, "samples": 100, "rate_Hz": 100.0,
        "markers": 3,
        "noise_std": {}, "load": {"force": 1.0, "moment": float("nan")},
        "bound": {"force": 0.5, "moment": float("nan")}, "rows": [row(p) for p in points],
    }  # fmt: skip


def test_a_peer_that_beats_us_in_both_is_named():
    (said,) = sentences(FLIGHTS, chart_of(OURS, FAST_PEER))
    assert (
        "Faster and more accurate than our best point, smoother (1 N, 1000 us): fast peer (0.5 N, 100 times"
        in said
    )
    assert "2.00 times the error of the best point (fast peer)" in said
    assert "In 0 of 1 charts no peer" in overview(FLIGHTS, [chart_of(OURS, FAST_PEER)])


@pytest.mark.parametrize("peer", [SLOW_PEER, COARSE_PEER])
def test_a_peer_that_is_slower_or_coarser_is_not(peer):
    (said,) = sentences(FLIGHTS, chart_of(OURS, peer))
    assert "No peer is both faster and more accurate than our best point, smoother (1 N, 1000 us)." in said
    assert peer in front([OURS, peer])


def test_who_was_told_the_truth_is_set_apart():
    points = [OURS, TOLD_PEER]
    assert front(points) == [OURS]
    (said,) = sentences(FLIGHTS, chart_of(*points))
    assert "No peer is both faster" in said
    assert "Only with the truth told: told peer 0.5 N." in said
    assert over_best(points, "smoother") == (1.0, "smoother")


def test_peers_within_the_margin_are_not_ahead_and_beyond_it_are():
    like, better = (Point("peer", 1e-5, error, False, False) for error in (0.99, 0.97))
    assert ahead([OURS, like], ALIKE) == []
    assert ahead([OURS, like], 1.0) == [like]
    assert ahead([OURS, better], ALIKE) == [better]


def test_a_contestant_without_answer_is_named_with_its_reason():
    case = chart_of(OURS, COARSE_PEER)
    case["rows"].append({"name": "lost", "kind": "peer", "told": False, "failed": "no masses", "chosen": ""})
    result = {
        "extent": {"seeds": 1, "rounds": 0}, "versions": {}, "command": "c", "date": "d", "forceid": "0",
        "engine": "e", "python": "3", "processor": "p", "missing": ["PyNumDiff"], "cases": [case],
    }  # fmt: skip
    text = page(result, CHARTED.values())
    assert "| lost | no answer: no masses |" in text
    assert "left out: PyNumDiff" in text


def test_finished_work_is_not_done_again(tmp_path):
    path, calls = tmp_path / "chart.jsonl", []
    for _ in range(2):
        assert Journal.opened(path).once("a", lambda: calls.append(1) or 7) == 7
    assert len(calls) == 1
    assert Journal.opened(path).once(key("b"), lambda: 8) == 8


def test_a_line_cut_short_is_done_again_and_harms_no_other(tmp_path):
    path = tmp_path / "chart.jsonl"
    Journal.opened(path).once("a", lambda: 1)
    with path.open("a") as file:
        file.write('{"key": "b", "fou')
    journal = Journal.opened(path)
    assert journal.once("a", lambda: 2) == 1
    assert journal.once("b", lambda: 3) == 3
    assert Journal.opened(path).lines == {"a": 1, "b": 3}
    assert [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")]


def test_what_was_found_is_found_again_until_code_changes_in_any_subfolder_and_not_its_words(tmp_path):
    deep = tmp_path / "kalman" / "engines" / "fast.py"
    deep.parent.mkdir(parents=True)

    def found(text):
        deep.write_text(text)
        return code_hash(sources_in(["kalman"], tmp_path))

    before = found('"""Fast."""\n\n\ndef run(x):\n    """Twice x."""\n    return 2 * x\n')
    assert found('"""Faster."""\n\ndef run(x):  # twice\n    """x and x."""\n    return 2 * x\n') == before
    moved = deep.rename(tmp_path / "kalman" / "fast.py")
    assert code_hash(sources_in(["kalman"], tmp_path)) == before
    assert found("def run(x):\n    return 2 * x\n") != before  # twice in the tree now
    moved.unlink()
    assert found("def run(x):\n    return 2 * x\n") == before
    assert found("from forceid.motion import pose\n\ndef run(x):\n    return 2 * x\n") == before
    (tmp_path / "kalman" / "__init__.py").write_text('"""Engines."""\n')
    assert code_hash(sources_in(["kalman"], tmp_path)) == before
    assert found("def run(x):\n    return 3 * x\n") != before


def test_every_source_of_the_package_counts_and_nothing_built_from_it_does():
    sources = sources_in(("compiled", "kalman", "estimation"))
    assert {path.suffix for path in sources} == {".py", ".cpp", ".hpp", ".toml"}
    assert {path.parent.name for path in sources} >= {"compiled", "kalman", "estimation"}


def test_an_honest_claim_covers_and_a_bold_one_does_not():
    case = case_of("s", spinning(6, 800), False)
    error = np.random.default_rng(0).standard_normal((800, 6))
    honest, bold = (
        scored_by_axis(case, Answer(halves(case.wrench + error), halves(np.full((800, 6), s))))
        for s in (1.0, 0.1)
    )
    assert np.abs(np.array(honest["inside"]) - 0.95).max() < 0.04
    assert max(bold["inside"]) < 0.15
    assert np.abs(np.array(honest["error"]) - 1).max() < 0.2


def test_only_the_central_three_quarters_are_judged():
    case = case_of("s", spinning(6, 80), False)
    wrench = case.wrench.copy()
    wrench[:10] += 1e3
    wrench[-10:] += 1e3
    assert max(scored_by_axis(case, Answer(halves(wrench)))["error"]) == 0.0
    assert np.isnan(scored_by_axis(case, Answer(halves(wrench)))["inside"]).all()


def test_a_label_goes_where_nothing_is():
    at, inside = np.array([50.0, 50.0]), np.array([0.0, 0.0, 100.0, 100.0])
    mark = np.array([46.0, 46.0, 54.0, 54.0])
    right = np.array([54.0, 40.0, 100.0, 60.0])
    box, _ = free_place(at, 20.0, 8.0, [mark, right], inside, 1.0)
    assert overlap(box, np.array([mark, right])) == 0.0
    assert box[0] >= 0
    assert box[3] <= 100
