"""The site made anew: every page has commands that there are, and what is done stays done."""

import json
import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest

from evidence import remake

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/results.md").read_text("utf-8")


def test_every_page_of_results_has_a_command():
    listed = re.search(r"```{toctree}\n:hidden:\n\n(.*?)```", TEXT, re.S)[1].split()
    assert {Path(name).name for name in listed if Path(name).name != "chart"} <= {
        *remake.pages(TEXT),
        *(Path(name).parent.name for name in listed),
    }
    assert all(commands for commands in remake.pages(TEXT).values())


@pytest.mark.parametrize("page", remake.pages(TEXT))
def test_the_commands_of_a_page_can_be_run(page):
    for command in remake.pages(TEXT)[page]:
        program, *words = shlex.split(command.replace("$(", "").replace(")", ""))
        assert program in ("python", "forceid", "pytest", "make")
        if program == "python":
            assert words[0] == "-m"
            assert find_spec(words[1]) is not None
        if program == "make":
            targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.M)
            assert set(words) <= set(targets)
        for word in words:
            assert not word.startswith("tests/") or (ROOT / word).exists()


def test_a_page_is_made_once_for_one_code(tmp_path, monkeypatch):
    (tmp_path / "docs").mkdir()
    count = "import pathlib, sys; p = pathlib.Path(sys.argv[2]); p.mkdir(exist_ok=True); "
    count += "f = p / 'a.md'; f.write_text(f.read_text() + 'x' if f.exists() else 'x')"
    rows = f'| [one](one.md) | counts | `python -c "{count}" -o docs/sub --seeds 3 4` |\n'
    rows += '| [two](two.md) | fails | `python -c "import sys; print(7); sys.exit(5)"` |\n'
    (tmp_path / "docs/results.md").write_text(rows)
    monkeypatch.setattr(remake, "ROOT", tmp_path)
    for _ in range(2):
        monkeypatch.setattr("sys.argv", ["remake", "-o", str(tmp_path / "out"), "--only", "one", "two"])
        assert remake.main() == 1
    assert (tmp_path / "out/sub/a.md").read_text() == "x"
    assert (tmp_path / "out/two.txt").read_text() == "7\n"
    found = json.loads((tmp_path / "out/manifest.json").read_text())
    one, two = (found["pages"][name] for name in ("one", "two"))
    assert (one["exit"], two["exit"], one["seeds"]) == ([0], [5], ["3 4"])
    assert list(one["files"]) == ["one.txt", "sub/a.md"]
    assert found["packages"]["numpy"]


def test_a_page_that_is_none_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["remake", "-o", str(tmp_path / "out"), "--only", "nothing"])
    assert remake.main() == 2
    assert capsys.readouterr().err.startswith("nothing: no page of measured, chart")
