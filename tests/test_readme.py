"""The README keeps its word: its Python runs, and so do its commands, in the order in which they stand."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import forceid
from forceid.cli.app import main

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
CODE = TEXT.split("```")[1::2]
PYTHON = [block.removeprefix("python\n") for block in CODE if block.startswith("python\n")]
LINES = [line for block in CODE for line in block.splitlines()]
COMMANDS = [shlex.split(line, comments=True) for line in LINES if line.startswith("forceid ")]
TARGETS = sorted(set(re.findall(r"make (\w+)", TEXT)))
NAMES = "nose", "left", "right", "top"
KNOWN = {"mass": [0.02, 0.02, 0.02, 0.02], "gravity": [0.0, 0.0, -9.81]}


@pytest.fixture
def throw(tmp_path, monkeypatch):
    """A folder with the reader's own data: four markers on a body thrown without any force, as throw.csv."""
    t = np.arange(200) / 100
    tip = np.array([[0.1, 0.0, 0.0], [-0.1, 0.1, 0.0], [-0.1, -0.1, 0.0], [0.1, 0.0, 0.1]])
    noise = 2e-4 * np.random.default_rng(0).standard_normal((200, 4, 3))
    path = np.outer(t, [2.0, 0.0, 5.0]) - 0.5 * np.outer(t**2, [0.0, 0.0, 9.81])
    table = np.column_stack([t, (path[:, None] + tip + noise).reshape(200, 12)])
    head = ",".join(["time", *(f"{name}_{axis}" for name in NAMES for axis in "xyz")])
    np.savetxt(tmp_path / "throw.csv", table, delimiter=",", header=head, comments="")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_python_of_the_readme_runs_and_finds_no_force_on_a_free_throw(throw, capsys):
    for block in PYTHON:
        exec(compile(block, "README.md", "exec"), {})
    verdict, force, unit = capsys.readouterr().out.split()
    assert verdict == "ok"
    # 0.08 kg seen for 2 s by four markers of 0.2 mm, 200 samples: sigma = m sqrt(720 / 200) s / (2 T^2)
    assert float(force) == pytest.approx(0.0, abs=4 * 0.08 * (720 / 200) ** 0.5 * 2e-4 / 2 / 2**2)
    assert unit == "N"
    assert (throw / "forces.csv").read_text().startswith("time,force_x,force_y,force_z")


def test_python_of_the_readme_is_ten_lines_and_its_shell_five():
    assert len([line for block in PYTHON for line in block.splitlines() if line]) <= 10
    assert [command[1] for command in COMMANDS[:5]] == ["import", "import", "inspect", "estimate", "report"]


def test_commands_of_the_readme_run_one_after_the_other(throw, capsys):
    for command in COMMANDS[:5]:
        assert main(command[1:]) == 0, capsys.readouterr().err
        if "--init" in command:
            settings = throw / "throw.toml"
            settings.write_text(settings.read_text().replace("nan,", "0.02,").replace("nan }", "0.02 }"))
    assert (throw / "throw.result.html").exists()


@pytest.mark.long
def test_commands_of_the_readme_to_go_on_with_run_on_the_same_data(throw, capsys):
    table = np.genfromtxt("throw.csv", delimiter=",", skip_header=1)
    position = table[:, 1:].reshape(len(table), 4, 3)
    forceid.save(forceid.motion(position, table[:, 0], nodes=NAMES, **KNOWN), "throw.h5")
    shutil.copy("throw.csv", "frames.csv")
    (throw / "trials").mkdir()
    for name in ("first.h5", "second.h5"):
        shutil.copy("throw.h5", throw / "trials" / name)
    for command in COMMANDS[5:]:
        globbed = [sorted(map(str, Path().glob(word))) if "*" in word else [word] for word in command[1:]]
        assert main([word for words in globbed for word in words]) == 0, capsys.readouterr().err
    assert (throw / "live.h5").exists()
    assert (throw / "results" / "index.html").exists()


def test_make_knows_what_the_readme_asks_of_it():
    assert {"demo", "test", "docs"} <= set(TARGETS)
    asked = subprocess.run(["make", "-n", *TARGETS], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "forceid demo -o demo" in asked.stdout  # which tests/test_cli.py runs
    assert "pytest" in asked.stdout


def test_pages_that_the_readme_links_exist():
    linked = re.findall(r"\]\(([^)#:]+)\)", TEXT)
    assert [path for path in linked if not (ROOT / path).exists()] == []
