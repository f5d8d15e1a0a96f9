"""A batch of bodies in parts: where the forces between parts are refused, the file is."""

import json
from pathlib import Path

import pytest

from forceid.cli.app import main
from forceid.cli.boundary.output import worse_verdict

ROOT = Path(__file__).parents[1]
DATA = ROOT / "data/synthetic/two_blocks.h5"
LOOP = """
[[joint]]
name = "strut"
parts = ["left", "right"]
at = [0.24, 0.0, 0.03]
"""
QUICK = ["--method", "difference", "--model", "modal", "-j", "1"]


@pytest.fixture
def looped(tmp_path):
    """A configuration in which a second joint closes a loop."""
    config = tmp_path / "loop.toml"
    config.write_text((ROOT / "config/two_blocks.toml").read_text() + LOOP)
    return config


@pytest.mark.long
def test_joints_that_are_refused_fail_their_file_and_its_line_says_so(looped, tmp_path, capsys):
    words = ["batch", str(DATA), "-c", str(looped), "-o", str(tmp_path / "out"), *QUICK]
    assert main([*words, "--json"]) == 1
    streams = capsys.readouterr()
    record = json.loads(streams.out)
    assert record["status"] == "refused"
    assert record["verdict"] != "refused"
    assert record["interface"]["verdict"] == "refused"
    said = " ".join(streams.err.split())
    assert f"refused {DATA}" in said
    assert "joints refused: the motion does not tell what passes through hinge, strut" in said
    assert "1 files: 1 refused" in said

    assert main([*words, "--resume"]) == 1  # kept, and still refused
    said = " ".join(capsys.readouterr().out.split())
    assert f"skipped {DATA}" in said
    assert "joints refused: the motion does not tell" in said


def test_joints_that_are_told_let_their_file_pass(tmp_path, capsys):
    config = str(ROOT / "config/two_blocks.toml")
    assert main(["batch", str(DATA), "-c", config, "-o", str(tmp_path), *QUICK, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["status"] == worse_verdict(record) != "refused"
