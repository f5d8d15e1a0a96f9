"""forceid doctor: what there is, a test whose answer is known, a battery; and what config shows."""

import json
import subprocess
import sys

import pytest

from forceid.cli.app import main
from forceid.cli.doctor import battery, self_test
from forceid.cli.doctor.battery import Trial, judged
from forceid.cli.doctor.self_test import Check
from forceid.cli.doctor.surroundings import found


@pytest.fixture
def quick(monkeypatch):
    """A doctor whose test and battery take no time, and fail."""
    monkeypatch.setattr(self_test, "checked", lambda: iter([Check("it works", True, "yes")]))
    monkeypatch.setattr(battery, "attacked", lambda: iter([Check("it holds", False, "exit code 99")]))


def test_what_there_is_names_every_part_that_a_result_depends_on():
    said = found()
    assert {"forceid", "python", "engine", "blas", "compiler", "threads", "memory"} <= set(said)
    assert all(said.values())


def test_a_doctor_who_finds_nothing_says_so(quick, capsys):
    assert main(["doctor"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].split(maxsplit=1) == ["verdict", "all is well"]


def test_a_check_that_fails_is_named_and_exits_1(quick, capsys):
    assert main(["doctor", "--attack"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("FAULT") and "it holds: exit code 99" in line for line in lines)
    assert lines[-1].endswith("1 of 2 checks failed")
    assert main(["doctor", "--attack", "--json"]) == 1
    record = json.loads(capsys.readouterr().out)
    assert (record["faults"], [check["good"] for check in record["checks"]]) == (1, [True, False])


def test_a_file_that_changes_and_a_wrong_exit_code_are_faults(tmp_path, monkeypatch):
    (tmp_path / "m.h5").write_text("motion")

    def lost(trial, folder):
        (folder / "m.h5").write_text("gone")
        return 1, "Traceback"

    monkeypatch.setattr(battery, "ended", lost)
    check = judged(Trial("it holds", ("inspect",), (0,)), tmp_path)
    assert not check.good
    assert all(part in check.said for part in ("exit code 1, expected 0", "a traceback", "is changed"))


@pytest.mark.long
def test_the_doctor_finds_this_machine_well_and_its_attack_breaks_nothing(capsys):
    assert main(["doctor", "--attack"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.startswith("ok ") for line in lines) >= 20


def test_python_runs_the_package_as_the_command():
    words = [sys.executable, "-m", "forceid", "config", "list"]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert said.startswith("cube_toss: A tumbling cube tracked by cameras")


def test_the_configurations_that_ship_are_listed_and_shown_as_they_are(capsys):
    from test_config import CONFIG

    assert main(["config", "list", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)["configurations"]) == {
        p.stem for p in CONFIG.glob("*.toml")
    }
    assert main(["config", "show", "default"]) == 0
    assert capsys.readouterr().out.rstrip() == (CONFIG / "default.toml").read_text().rstrip()


@pytest.mark.parametrize("words", [["lsit"], ["show"], ["show", "defualt"]])
def test_a_word_or_a_name_that_is_none_exits_2_and_helps(words, capsys):
    assert main(["config", *words]) == 2
    said = capsys.readouterr().err
    assert "did you mean 'list'" in said or "two_blocks" in said
