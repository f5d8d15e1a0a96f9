"""The README keeps its word: its Python runs, and its commands exist."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from forceid.cli.app import COMMANDS as KNOWN
from forceid.cli.app import main

CODE = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8").split("```")[1::2]
PYTHON = [block.removeprefix("python\n") for block in CODE if block.startswith("python\n")]
COMMANDS = [line for block in CODE for line in block.splitlines() if line.startswith("forceid ")]


def test_python_of_the_readme_runs_and_finds_no_force_on_a_free_throw(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for block in PYTHON:
        exec(compile(block, "README.md", "exec"), {})
    verdict, force, unit, estimate, std, _ = capsys.readouterr().out.split()
    assert float(estimate) == pytest.approx(-0.1 * 0.2 * 6**2 * np.sin(6.0), abs=3 * float(std))
    assert verdict == "ok"
    # 0.08 kg seen for 2 s by four markers of 0.2 mm, 200 samples: sigma = m sqrt(720 / 200) s / (2 T^2)
    assert float(force) == pytest.approx(0.0, abs=4 * 0.08 * (720 / 200) ** 0.5 * 2e-4 / 2 / 2**2)
    assert unit == "N"


def test_commands_of_the_readme_exist():
    named = {line.split()[1] for line in COMMANDS}
    assert {"import", "inspect", "estimate", "report", "batch"} <= named <= set(KNOWN)


def test_throw_of_the_readme_goes_through_its_commands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(PYTHON[0], "README.md", "exec"), {})
    steps = [
        line.split()[1:] for line in COMMANDS if re.match("forceid (inspect|estimate|report) throw", line)
    ]
    assert [main(step) for step in steps] == [0, 0, 0]
    assert (tmp_path / "throw.result.html").exists()
