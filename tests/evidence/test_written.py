"""What studies are asked, and the pages that they leave."""

import sys

import pytest

from evidence.written import asked, table, tabled, written

TAKEN = {"seeds": 3, "lines": "auto", "markers": (3, 4), "quick": False, "jobs": 2}


def given(monkeypatch, line):
    monkeypatch.setattr(sys, "argv", ["study", *line.split()])
    return asked("evidence.study", "What it is.\n\nMore.", **TAKEN)


def test_the_command_on_a_page_asks_for_the_same_again(monkeypatch):
    first = given(monkeypatch, "-o docs --seeds 5 --markers 7 8 9 --quick -j 1")
    assert first.command == "python -m evidence.study -o docs --seeds 5 --markers 7 8 9 --quick"
    again = given(monkeypatch, first.command.removeprefix("python -m evidence.study "))
    assert vars(again) == vars(first) | {"jobs": 2}  # how many processes changes nothing


def test_what_is_not_asked_is_as_by_default_and_not_in_the_command(monkeypatch):
    found = given(monkeypatch, "-o docs")
    assert (found.seeds, found.lines, tuple(found.markers), found.quick) == (3, "auto", (3, 4), False)
    assert found.command == "python -m evidence.study -o docs"


def test_a_page_needs_a_folder(monkeypatch):
    with pytest.raises(SystemExit, match="2"):
        given(monkeypatch, "--seeds 5")


def test_a_table_has_as_many_cells_in_every_row_as_heads():
    rows = tabled(("a", "b", ""), [["1"], ["1", "2", "3"]]).splitlines()
    assert {row.count("|") for row in rows} == {4}
    assert table([{"x": 1 / 3, "y": "z"}]).splitlines()[-1] == "| 0.333 | z |"


def test_a_page_replaces_the_one_before_and_leaves_nothing_beside(tmp_path):
    for text in ("one", "two"):
        path = written(tmp_path / "new", "page.md", text)
    assert path.read_text() == "two"
    assert [p.name for p in path.parent.iterdir()] == ["page.md"]
