"""What a person at a terminal sees while a command works, and what a pipe never sees."""

import json
import os
import re
import subprocess
import sys
import webbrowser
from pathlib import Path

import pytest
from pseudo_terminal import watched_on_terminal

from forceid.cli.app import main
from forceid.cli.boundary import terminal
from forceid.cli.boundary.status import SHARES, Status
from forceid.timing import STAGES, stage, watched

ROOT = Path(__file__).parents[1]
TOP = ROOT / "data" / "synthetic" / "top.h5"
QUICK = ["--method", "difference", "--model", "rigid"]


def run(words, stderr=subprocess.PIPE, **environment):
    """The command in a process of its own, by its module."""
    return subprocess.Popen(
        [sys.executable, "-m", "forceid", *words], stdout=subprocess.PIPE, stderr=stderr, text=True,
        env={**os.environ, "TERM": "xterm", "PYTHONPATH": str(ROOT), **environment},
    )  # fmt: skip


def on_terminal(words, **environment):
    """What stdout as a pipe and stderr as a terminal get."""
    process, written = watched_on_terminal(lambda end: run(words, end, **environment))
    return process.communicate()[0], written


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The result of a quick estimate."""
    path = tmp_path_factory.mktemp("result") / "top.result.h5"
    assert main(["estimate", str(TOP), *QUICK, "-o", str(path), "--quiet"]) == 0
    return path


def test_a_terminal_sees_stage_and_time_while_stdout_stays_clean(tmp_path):
    slow = "import forceid.cli.boundary.status as s; s.FIRST = s.EVERY = 0.01; "
    (tmp_path / "sitecustomize.py").write_text(slow)
    words = ["estimate", str(TOP), *QUICK, "--json", "-o", str(tmp_path / "r.h5")]
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    out, seen = on_terminal(words, PYTHONPATH=path)
    assert json.loads(out)["verdict"] == "ok"
    lines = [line for line in seen.split("\r\x1b[K") if line]
    assert any("forceid estimate: loading (modules that load on first use)" in line for line in lines)
    assert all(re.search(r"\d+ s (so far|left)$", line) for line in lines)
    assert seen.endswith("\r\x1b[K")  # nothing stays


def test_quiet_says_nothing_but_errors_and_json(tmp_path, capsys):
    output = ["-o", str(tmp_path / "r.h5")]
    assert main(["estimate", str(TOP), *QUICK, *output, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert main(["-q", "estimate", str(TOP), *QUICK, *output, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)
    assert main(["estimate", str(tmp_path / "no.h5"), "-q"]) == 3
    assert "no.h5" in capsys.readouterr().err


def test_verbose_names_every_stage_with_its_time_and_keeps_stdout(tmp_path, capsys):
    assert main(["estimate", str(TOP), *QUICK, "-o", str(tmp_path / "r.h5"), "-v", "--json"]) == 0
    shown = capsys.readouterr()
    assert json.loads(shown.out)
    met = re.findall(r"^ +\d+\.\d\d s  (\w+)", shown.err, re.MULTILINE)
    assert met[:3] == ["loading", "reading", "kinematics"]
    assert len(met) == len(set(met))
    assert re.search(r"^ ?total +\d+\.\d+ +100 %", shown.err, re.MULTILINE)


def test_python_m_forceid_is_the_command_and_a_pipe_sees_no_progress(tmp_path):
    out, err = run(["estimate", str(TOP), *QUICK, "--json", "-o", str(tmp_path / "r.h5")]).communicate()
    assert json.loads(out)["output"] == str(tmp_path / "r.h5")
    assert err == ""


def test_estimate_shows_force_and_moment_by_axis_as_a_table(tmp_path, capsys):
    assert main(["estimate", str(TOP), *QUICK, "-o", str(tmp_path / "r.h5")]) == 0
    verdict, head, force, moment, *_, last = capsys.readouterr().out.splitlines()
    assert verdict == "verdict  ok"
    assert head.split() == ["mean", "x", "mean", "y", "mean", "z", "rms", "and", "sigma"]
    for row, name, unit in ((force, "force", "N"), (moment, "moment", "N m")):
        number = r"-?\d[\d.e-]*"
        assert re.fullmatch(rf"{name} +{number} +{number} +{number}   {number} ± {number} {unit}", row)
    assert last.startswith(f"result   {tmp_path / 'r.h5'}")


def test_the_share_of_a_whole_body_never_falls_and_every_stage_has_one():
    assert set(SHARES) == set(STAGES) - {"rest"}
    status = Status("estimate", iter(map(float, range(1000))).__next__)
    shares = []
    for name in ("loading", "reading", "level", "flight", "level", "force", "flight", "axes", "claims"):
        status.enter(name)
        shares += [int(re.search(r"(\d+) %", status.text())[1]) for _ in range(3)]
    assert shares == sorted(shares)
    assert shares[-1] < 100


def test_a_stage_around_is_told_again_when_the_one_within_ends():
    told = []
    with watched(told.append), stage("level"), stage("flight"):
        pass
    assert told == ["level", "flight", "level"]


def test_words_of_a_verdict_have_their_color_on_a_terminal_only(monkeypatch):
    class Screen:
        def isatty(self):
            return True

    text = "verdict  refused\n       - ok is a word here"
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    assert terminal.colored(text, Screen()) == text.replace("refused", "\x1b[1;31mrefused\x1b[0m")
    monkeypatch.setenv("NO_COLOR", "1")
    assert terminal.colored(text, Screen()) == text


@pytest.mark.long
def test_open_writes_the_page_once_and_gives_it_to_the_browser(result, monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(webbrowser, "open", lambda address: not asked.append(address))
    page = result.with_suffix(".html")
    assert main(["open", str(result)]) == 0
    assert asked == [page.resolve().as_uri()]
    assert "opened" in capsys.readouterr().out
    written = page.stat().st_mtime_ns
    monkeypatch.setattr(webbrowser, "open", lambda address: False)
    assert main(["open", str(result)]) == 0
    assert page.stat().st_mtime_ns == written  # it was current
    assert capsys.readouterr().out == f"{page}: no browser here; open it in one\n"


def test_report_of_several_results_is_one_page_beside_the_first(result, capsys):
    assert main(["report", str(result), str(result)]) == 0
    page = result.parent / "comparison.html"
    assert capsys.readouterr().out == f"{page}\n"
    assert "100 % of the force and 100 % of the moment" in page.read_text()
