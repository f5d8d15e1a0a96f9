"""`forceid chart` end to end on a few contestants, interrupted and taken up again."""

import json
from dataclasses import replace

import pytest
from spinning_body import spinning

from evidence.chart.subjects import CHARTED
from evidence.subjects.flights.methods import ours
from evidence.subjects.flights.peers.entrants import peers
from forceid.cli.app import main
from forceid.files.stored.hdf5 import write_motion


@pytest.fixture
def few(charting):
    """Three contestants; the answers that were worked out."""
    chosen = [c for c in [*ours(), *peers()[0]] if c.name in ("smoother", "savgol", "scipy savgol")]
    return charting("flights", chosen, ["statsmodels"])


@pytest.fixture
def recording(tmp_path):
    """A motion file with a truth."""
    path = tmp_path / "spin.h5"
    write_motion(path, spinning(5, 120))
    return path


@pytest.mark.long
def test_a_chart_leaves_page_numbers_and_pictures(few, recording, tmp_path, capsys):
    out = tmp_path / "charts"
    assert main(["chart", str(recording), "-o", str(out), "--short"]) == 0
    found = json.loads((out / "chart.json").read_text())
    rows = {row["name"]: row for row in found["cases"][0]["rows"]}
    assert rows["smoother"]["error"]["force"] < rows["scipy savgol"]["error"]["force"]
    assert rows["scipy savgol"]["coverage"]["force"] is None
    assert found["cases"][0]["bound"]["force"] > 0
    assert {p.name for p in out.glob("*.png")} == {"chart_spin.png"}
    assert "| smoother |" in (out / "chart.md").read_text()
    assert "default over best point" in capsys.readouterr().out


@pytest.mark.long
def test_a_chart_goes_on_where_it_was_interrupted(few, recording, tmp_path, monkeypatch):
    out = ["-o", str(tmp_path / "charts"), "--short"]

    def interrupted(*a):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setitem(CHARTED, "flights", replace(CHARTED["flights"], bound=interrupted))
        assert main(["chart", str(recording), *out]) == 130
    assert few == ["smoother", "savgol", "scipy savgol"]
    assert main(["chart", str(recording), *out]) == 0
    assert len(few) == 3


def test_a_misspelled_scene_names_the_nearest(tmp_path, capsys):
    assert main(["chart", "frisby", "-o", str(tmp_path)]) == 2
    assert "did you mean 'frisbee'?" in capsys.readouterr().err


@pytest.mark.long
def test_a_recording_without_truth_is_charted_and_stressed_on_its_twins(few, tmp_path, capsys):
    path, out = tmp_path / "mine.h5", tmp_path / "out"
    write_motion(path, replace(spinning(5, 160), truth={}))
    assert main(["chart", str(path), "-o", str(out), "--short"]) == 0
    assert "twin of" in (out / "chart.md").read_text()
    assert main(["stress", str(path), "-o", str(out), "--short"]) == 0
    assert "wrong masses (share of each)" in capsys.readouterr().out
    assert (out / "stress_mine.png").stat().st_size > 0
    assert "Without a fault: right" in (out / "stress_mine.md").read_text()
