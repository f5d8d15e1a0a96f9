"""Bodies in parts on the chart: their truth is nobody's answer, and the page says who is ahead."""

import json

import numpy as np
import pytest

from evidence.chart import run as chart
from evidence.chart.figures import draw_case
from evidence.chart.front import ahead, front, points_of
from evidence.chart.page import of_case, overview, sentences
from evidence.chart.subjects import CHARTED
from evidence.subject import Answer
from evidence.subjects.flights.cases import sources
from evidence.subjects.parts import solvers as parts_solvers
from evidence.subjects.parts.cases import GRIDS, Grid, manufactured
from evidence.subjects.parts.chart import JUDGED_BY, PARTS, RESOLVES, errors
from evidence.subjects.parts.solvers import DEFAULT, entrants
from forceid.cli.app import main
from forceid.errors import ConfigError

SMALL = {
    "plate": Grid((2, 2), 3),
    "strips": Grid((3, 2), 2, "strips", 1e4),
    "checkerboard": Grid((2, 3), 2, "checkerboard", 1e4),
    "solid": Grid((2, 1, 2), 2),
}


@pytest.fixture(params=SMALL)
def case(request):
    return manufactured(request.param, SMALL[request.param])


def test_manufactured_forces_balance_every_part_and_every_node(case):
    forces = np.zeros(case.L.shape[0])
    forces[case.shared] = case.lam
    left = case.L @ (case.load / case.count) - forces
    size = np.abs(case.lam).max()
    ends = np.cumsum([0, *(K.shape[0] for K in case.stiffness)])
    for R, a, b in zip(case.modes, ends[:-1], ends[1:], strict=True):
        assert np.abs(R.T @ left[a:b]).max(initial=0.0) < 1e-12 * size
    assert np.abs(case.L.T @ forces).max() < 1e-12 * size


def test_inside_a_part_loads_and_stiffness_leave_nothing(case):
    assert np.abs(case.residual(case.u)[~case.shared]).max() < 1e-12 * np.abs(case.lam).max()
    assert np.abs(case.lam).max() > 0.1


def test_gaps_between_parts_are_errors():
    case = manufactured("plate", SMALL["plate"])
    u = case.L @ case.u
    first = case.stiffness[0].shape[0]
    u[:first] += 1e-3 * case.modes[0][:, 0] if case.modes[0].size else 1e-3
    assert errors(case, Answer((u, case.lam)))["displacement"] > 1e-5
    assert errors(case, Answer((case.L @ case.u, case.lam))) == {"displacement": 0.0, "interface force": 0.0}


@pytest.mark.parametrize("c", [c for c in entrants()[0] if "1e-04" not in c.name], ids=lambda c: c.name)
def test_every_solver_answers_the_manufactured_body(c):
    case = manufactured("plate", SMALL["plate"])
    off = errors(case, c.prepare(case)())
    tight = 1e-2 if "MINRES" in c.name else 1e-5
    assert max(off.values()) < tight


def row(name, kind, seconds, error):
    return {
        "name": name, "line": name.rsplit(" 1e", 1)[0], "kind": kind, "about": "", "iterations": 3,
        "error": dict.fromkeys(JUDGED_BY, error), "claimed": None, "verdict": {},
        "reasons": [], "rounds": 0, "told": False, "part": False, "seconds": seconds,
        "seconds_range": [seconds, seconds],
        "again": seconds / 2, "setup_share": 0.5, "times_default": 1.0, "peak_MB": None,
    }  # fmt: skip


def body_of(*rows):
    return {
        "name": "b", "title": "B", "parts": 4, "unknowns": 9, "multipliers": 8, "rows": list(rows),
        "quantities": JUDGED_BY, "units": None, "resolved": RESOLVES,
    }  # fmt: skip


def test_a_peer_that_is_faster_and_as_accurate_is_named():
    body = body_of(row("direct", "method", 1.0, 1e-14), row("scipy splu", "peer", 0.1, 1e-13))
    assert [p.name for p in ahead(points_of(body, "displacement"), 1.0)] == ["scipy splu"]
    assert "scipy splu (below 1e-10, 10 times as fast)" in sentences(PARTS, body)[0]
    assert "| direct (below 1e-10, 1000 ms) | scipy splu (below 1e-10, 100 ms) | 0.1 |" in overview(
        PARTS, [body]
    )


def test_a_coarser_peer_is_on_the_front_and_not_ahead():
    body = body_of(row("direct", "method", 1.0, 1e-12), row("scipy cg 1e-04", "peer", 0.1, 1e-5))
    points = points_of(body, "interface force")
    assert ahead(points, 1.0) == []
    assert [p.name for p in front(points)] == ["scipy cg 1e-04", "direct"]
    assert (
        "No peer is both faster and no less accurate than our best point, direct (below 1e-10, 1000 ms)"
        in sentences(PARTS, body)[1]
    )


def test_errors_of_rounding_decide_nothing():
    body = body_of(row("a", "method", 1.0, 1e-13), row("b", "peer", 2.0, 1e-16))
    assert [(p.name, p.error) for p in front(points_of(body, "displacement"))] == [("a", RESOLVES)]


def test_a_line_is_named_once_and_at_its_tightest_tolerance():
    rows = [row(f"cg none {t:.0e}", "method", 1.0 - t, t) for t in (1e-4, 1e-7, 1e-10)]
    figure = draw_case(PARTS, body_of(row("direct", "method", 2.0, 1e-12), *rows))
    said = [text.get_text() for text in figure.axes[0].texts if text.get_text()]
    assert sorted(said) == ["cg none", "direct"]


def test_an_answer_that_is_worth_nothing_is_in_the_table_and_not_in_the_picture():
    body = body_of(row("direct", "method", 1.0, 1e-12), row("lost", "peer", 0.1, 3e3))
    figure = draw_case(PARTS, body)
    said = [text.get_text() for text in figure.axes[0].texts]
    assert "lost" not in said
    assert "error above 1: lost" in said
    assert "| lost | 3.0e+03 |" in "\n".join(of_case(PARTS, body))


@pytest.fixture
def few(monkeypatch, charting):
    """One small body and three solvers without PyAMG; the solvers that were asked."""
    monkeypatch.setitem(GRIDS, "plate_16", SMALL["plate"])
    found = [c for c in entrants()[0] if c.name in ("direct", DEFAULT, "scipy splu")]
    return charting("parts", found, ["PyAMG"])


def test_a_body_is_charted_without_recordings(few, tmp_path, capsys):
    assert main(["chart", "plate_16", "-o", str(tmp_path), "--short"]) == 0
    found = json.loads((tmp_path / "chart.json").read_text())
    (body,) = found["cases"]
    rows = {r["name"]: r for r in body["rows"]}
    assert rows[DEFAULT]["times_default"] == 1.0
    assert rows["direct"]["error"]["interface force"] < 1e-10
    assert rows["direct"]["claimed"] is not None
    assert rows["scipy splu"]["claimed"] is None
    text = (tmp_path / "chart.md").read_text()
    assert "## Bodies in parts" in text
    assert "left out: PyAMG" in text
    assert [p.name for p in tmp_path.glob("*.png")] == ["chart_plate_16.png"]
    assert "fastest peer" in capsys.readouterr().out


def test_a_chart_of_a_body_goes_on_where_it_was_interrupted(few, tmp_path, monkeypatch):
    command = ["chart", "plate_16", "-o", str(tmp_path), "--short"]
    done = chart.scored_answer

    def interrupted(subject, c, *rest):
        if c.name == "scipy splu":
            raise KeyboardInterrupt
        return done(subject, c, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(chart, "scored_answer", interrupted)
        assert main(command) == 130
    assert few == ["direct", DEFAULT]
    assert main(command) == 0
    assert few == ["direct", DEFAULT, "scipy splu"]


def test_rounds_of_timing_are_paired_with_the_default(few, tmp_path):
    extent = chart.Extent("quick", seeds=1, rounds=2, budget=1.0, full=False)
    result = chart.run([(CHARTED["parts"], "plate_16")], tmp_path, extent, "c", lambda what, part: None)
    rows = {r["name"]: r for r in result["cases"][0]["rows"]}
    assert rows[DEFAULT]["times_default"] == 1.0
    assert rows["scipy splu"]["rounds"] == 2
    assert rows["scipy splu"]["seconds_range"][0] <= rows["scipy splu"]["seconds"]


def test_without_multigrid_the_others_still_take_part(monkeypatch):
    monkeypatch.setattr(parts_solvers, "find_spec", lambda name: None)
    found, missing = entrants()
    assert missing == ["PyAMG"]
    assert {"direct", DEFAULT, "scipy spsolve"} <= {c.name for c in found}


def test_a_misspelled_body_names_the_nearest(tmp_path, capsys):
    assert main(["chart", "chekerboard", "-o", str(tmp_path)]) == 2
    assert "unknown scene 'chekerboard'; did you mean 'checkerboard'?" in capsys.readouterr().err


def test_bodies_are_named_beside_recordings():
    assert [p.name for p in sources(["plate_16", "top", "a/b.h5"], GRIDS)] == ["top.toml", "b.h5"]
    assert sources(["plate_16"], GRIDS) == []
    with pytest.raises(ConfigError, match="two scenes are called 'plate_16'"):
        sources(["plate_16", "a/plate_16.h5"], GRIDS)
