"""The command line: exit codes, what goes to which stream, and that one bad file never stops the rest."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import pytest

from forceid import scenes
from forceid.cli.app import COMMANDS, main
from forceid.cli.boundary.output import to_json, wrap
from forceid.cli.crew import pool
from forceid.config import load_settings
from forceid.scenes.recipe import load_recipe

START = "import sys; from forceid.cli.app import main; code = main()"
EXIT = START + "; sys.exit(code)"
RECIPE = """
scene = "spinner"
title = "toss"
duration = 0.3
sample_rate = 200
noise_std = 5e-4
"""


@pytest.fixture(scope="module")
def shelf(tmp_path_factory):
    """Two good motion files and a bad one."""
    folder = tmp_path_factory.mktemp("shelf")
    (folder / "toss.toml").write_text(RECIPE)
    for seed, name in enumerate(("one", "two")):
        scene = str(folder / "toss.toml")
        assert main(["simulate", scene, "-o", str(folder / f"{name}.h5"), "--seed", str(seed)]) == 0
    (folder / "bad.h5").write_text("this is no HDF5 file")
    return folder


def one_error_line(capsys) -> str:
    streams = capsys.readouterr()
    assert streams.out == ""
    assert streams.err.startswith("forceid: error: ")
    assert streams.err.count("\n") == 1
    return streams.err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(command, capsys):
    assert main([command, "--help"]) == 0
    assert f"Example: forceid {command}" in capsys.readouterr().out


def test_version_names_package_engine_and_its_instructions_on_one_line(capsys):
    import forceid
    from forceid import compiled

    assert main(["--version"]) == 0
    told = {"baseline": "baseline", "v3": "avx2", "v4": "avx512"}
    engine = "numpy" if compiled.engine is None else f"compiled, {told[compiled.engine.arch]}"
    assert capsys.readouterr().out == f"forceid {forceid.__version__}, engine {engine}\n"


def test_help_loads_no_numerics():
    code = (
        "import sys; from forceid.cli.app import main; main(['--help']); print(*sys.modules, file=sys.stderr)"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stderr.split()
    heavy = {"numpy", "scipy", "h5py", "xarray", "matplotlib", "pydantic", "jinja2", "evidence"}
    assert not heavy & set(loaded)


@pytest.mark.parametrize("command", ["chart", "stress"])
def test_a_command_of_evidence_that_is_not_installed_says_what_to_install(command, monkeypatch, capsys):
    monkeypatch.setattr("forceid.cli.app.installed", lambda name: None)
    assert main([command, "-o", "x"]) == 2
    assert "pip install 'forceid[evidence]'" in one_error_line(capsys)
    assert main(["--help"]) == 0
    assert command in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["estimat", "x.h5"], "did you mean 'estimate'"),
        (["estimate"], "Missing argument"),
        (["inspect", "x.h5", "--jsno"], "--json"),
        (["batch", "x.h5"], "--output"),
        (["batch", "x.h5", "-o", "out", "-j", "0"], "-j"),
        (["estimate", "x.h5", "--method", "magic"], "'smoother'"),
        (["estimate", "x.h5", "-c", "nowhere.toml"], "nowhere.toml"),
        (["simulate", "nowhere.toml", "-o", "x.h5"], "nowhere.toml"),
    ],
)
def test_wrong_usage_exits_2_with_one_line(words, says, capsys):
    assert main(words) == 2
    assert says in one_error_line(capsys)


def test_unknown_config_key_names_the_nearest(shelf, tmp_path, capsys):
    config = tmp_path / "c.toml"
    config.write_text('metod = "savgol"\n')
    assert main(["estimate", str(shelf / "one.h5"), "-c", str(config)]) == 2
    assert "did you mean 'method'" in one_error_line(capsys)


@pytest.mark.parametrize("command", ["estimate", "inspect", "report"])
@pytest.mark.parametrize("name", ["missing.h5", "bad.h5"])
def test_input_that_cannot_be_read_exits_3(command, name, shelf, capsys):
    assert main([command, str(shelf / name)]) == 3
    assert name in one_error_line(capsys)


def test_debug_shows_the_traceback_before_or_after_the_command(shelf, capsys):
    for words in (["--debug", "inspect", "bad.h5"], ["inspect", "bad.h5", "--debug"]):
        assert main([str(shelf / w) if w == "bad.h5" else w for w in words]) == 3
        assert "Traceback" in capsys.readouterr().err


def test_unexpected_error_is_one_line_with_a_hint(monkeypatch, capsys):
    import forceid.config

    def broken(*_args, **_more):
        raise RuntimeError("first\nsecond")

    monkeypatch.setattr(forceid.config, "load_settings", broken)
    assert main(["inspect", "x.h5"]) == 1
    line = one_error_line(capsys)
    assert "RuntimeError: first second" in line
    assert "--debug" in line


def test_interrupt_exits_130(monkeypatch, capsys):
    import forceid.config

    def interrupt(*_args, **_more):
        raise KeyboardInterrupt

    monkeypatch.setattr(forceid.config, "load_settings", interrupt)
    assert main(["inspect", "x.h5"]) == 130
    assert "interrupted" in one_error_line(capsys)


def test_json_is_strict_even_where_nothing_is_known():
    line = to_json({"a": float("nan"), "b": [1.0, float("inf")], "c": {"d": float("-inf")}})
    assert json.loads(line) == {"a": None, "b": [1.0, None], "c": {"d": None}}


def test_long_reason_is_folded_under_its_text(monkeypatch):
    reason = "the markers lie on a line, and a turn about it is not seen; add a marker off the line"
    for columns, width in (("50", 50), ("300", 100)):
        monkeypatch.setenv("COLUMNS", columns)
        first, *others = wrap(f"       - {reason} and {reason}").splitlines()
        assert first.startswith("       - the markers")
        assert others
        assert all(line.startswith(" " * 9) and line[9] != " " for line in others)
        assert max(map(len, [first, *others])) <= width
        assert " ".join([first[9:], *(line[9:] for line in others)]) == f"{reason} and {reason}"


def test_same_seed_gives_the_same_motion_and_another_does_not(shelf, tmp_path):
    for name, seed in (("a", "0"), ("b", "1")):
        assert (
            main(["simulate", str(shelf / "toss.toml"), "-o", str(tmp_path / f"{name}.h5"), "--seed", seed])
            == 0
        )
    position = {}
    for path in (shelf / "one.h5", tmp_path / "a.h5", tmp_path / "b.h5"):
        with h5py.File(path) as f:
            position[path.stem] = f["motion/position"][:]
    assert (position["one"] == position["a"]).all()
    assert (position["one"] != position["b"]).any()


CAPTURE = """
[import]
gravity = [0, 0, -9.81]
[import.csv]
time = "t"
group = "toss"
[import.csv.position]
ball = ["x", "y", "z"]
[import.body]
mass = { ball = 0.1 }
"""


def test_import_writes_one_motion_file_a_group(tmp_path, capsys):
    rows = [
        f"{name},{k / 100},{v * k / 100},0,1" for name, v in (("slow", 1), ("fast", 9)) for k in range(20)
    ]
    (tmp_path / "t.csv").write_text("\n".join(["toss,t,x,y,z", *rows]))
    (tmp_path / "c.toml").write_text(CAPTURE)
    words = [str(tmp_path / "t.csv"), "-o", str(tmp_path / "t.h5"), "-c", str(tmp_path / "c.toml")]
    assert main(["import", *words]) == 0
    assert capsys.readouterr().out.count("20 samples") == 2
    with h5py.File(tmp_path / "t-fast.h5") as f:
        assert f["motion/position"][-1, 0, 0] == pytest.approx(9 * 0.19)
    assert (tmp_path / "t-slow.h5").exists()


def test_configuration_in_the_help_of_import_is_one_that_works(tmp_path, capsys):
    assert main(["import", "--help"]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    (tmp_path / "c.toml").write_text("\n".join(line for line in lines if line.startswith("import.")))
    columns = "tip x,tip y,tip z,hub x,hub y,hub z"
    rows = [f"{k / 100},{k / 100},0,1,0,0,1" for k in range(20)]
    (tmp_path / "t.csv").write_text("\n".join([f"t,{columns}", *rows]))
    words = [str(tmp_path / "t.csv"), "-o", str(tmp_path / "t.h5"), "-c", str(tmp_path / "c.toml")]
    assert main(["import", *words]) == 0
    with h5py.File(tmp_path / "t.h5") as f:
        assert f["body/mass"][:] == pytest.approx([0.02, 0.05])


def test_import_without_configuration_says_where_to_find_one(tmp_path, capsys):
    assert main(["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "t.h5")]) == 2
    assert "forceid import --help" in one_error_line(capsys)


@pytest.mark.long
def test_demo_ends_with_a_page_and_an_error_against_truth(tmp_path, monkeypatch, capsys):
    shorter = {"duration": 0.2}  # s: a third of the flight that `make demo` throws
    monkeypatch.setattr(scenes, "load_recipe", lambda path: load_recipe(path).model_copy(update=shorter))
    assert main(["demo", "-o", str(tmp_path / "demo")]) == 0
    said = capsys.readouterr().out
    assert re.search(r"^error    force .* N rms, .* its sigma; moment .* N m rms", said, re.MULTILINE)
    page = tmp_path / "demo" / "boomerang.html"
    assert f"open {page}" in said
    assert sorted(p.name for p in page.parent.iterdir()) == ["boomerang.h5", page.name, "boomerang.result.h5"]


def test_inspect_json_is_one_object(shelf, capsys):
    assert main(["inspect", str(shelf / "one.h5"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["file"].endswith("one.h5")
    assert len(found["warnings"]) == len(found["reason_codes"]) == len(found["reason_values"])


def test_estimate_writes_beside_the_input_and_report_beside_the_result(shelf, tmp_path, capsys):
    motion = Path(shutil.copy(shelf / "one.h5", tmp_path))
    assert main(["estimate", str(motion)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("verdict  ")
    result = tmp_path / "one.result.h5"
    assert str(result) in said
    assert main(["report", str(result)]) == 0
    page = (tmp_path / "one.result.html").read_text()
    assert "data:image/png;base64," in page
    assert "://" not in page


def test_estimate_json_is_pure_and_carries_the_numbers(shelf, tmp_path):
    words = ["estimate", str(shelf / "one.h5"), "-o", str(tmp_path / "r.h5"), "--json", "--profile"]
    words += ["--method", "savgol"]
    done = subprocess.run(
        [sys.executable, "-c", EXIT, *words],
        capture_output=True,
        text=True,
    )
    record = json.loads(done.stdout)
    assert done.returncode == 0
    assert record["method"] == "savgol"
    assert len(record["force_rms"]) == len(record["moment_std"]) == 3
    assert re.fullmatch("[0-9a-f]{64}", record["input_sha256"])
    shown = [line.strip().split("  ")[0].replace(" ", "_") for line in done.stderr.splitlines()]
    assert shown == ["stage", *record["timing"], "total"]
    with h5py.File(tmp_path / "r.h5") as f:
        held = {k: v[0] for k, v in f["estimate"].attrs.items() if k.startswith("timing_")}
    told = {f"timing_{k}": v for k, v in record["timing"].items()}
    assert {"timing_reading", "timing_kinematics", "timing_flight"} < set(held)
    assert held == {k: v for k, v in told.items() if k != "timing_writing"}


def test_input_is_never_overwritten(shelf, capsys):
    before = (shelf / "one.h5").read_bytes()
    assert main(["estimate", str(shelf / "one.h5"), "-o", str(shelf / "one.h5")]) == 2
    assert "both input and output" in one_error_line(capsys)
    assert (shelf / "one.h5").read_bytes() == before


def batch(shelf: Path, out: Path, capsys, *options: str) -> tuple[int, dict[str, dict[str, object]]]:
    files = [str(shelf / f"{name}.h5") for name in ("one", "bad", "two")]
    code = main(["batch", *files, "-o", str(out), "-j", "2", "--json", *options])
    records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    return code, {Path(r["file"]).stem: r for r in records}


@pytest.mark.long
def test_bad_file_fails_alone_and_resume_keeps_what_is_current(shelf, tmp_path, capsys):
    code, records = batch(shelf, tmp_path, capsys)
    assert code == 1
    assert records["bad"]["status"] == "failed"
    assert "bad.h5" in str(records["bad"]["error"])
    assert {records[k]["status"] for k in ("one", "two")} <= {"ok", "degraded"}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["index.html", "one.result.h5", "two.result.h5"]

    code = main(["batch", str(shelf / "one.h5"), "-o", str(tmp_path)])
    assert code == 2  # there already, and neither --resume nor --force
    capsys.readouterr()

    written = (tmp_path / "one.result.h5").stat().st_mtime_ns
    code, records = batch(shelf, tmp_path, capsys, "--resume", "--dry-run")
    assert code == 0
    assert [records[k]["status"] for k in ("one", "two", "bad")] == ["skipped", "skipped", "planned"]
    code, records = batch(shelf, tmp_path, capsys, "--resume", "--method", "savgol", "--dry-run")
    assert {r["status"] for r in records.values()} == {"planned"}  # other settings, so no longer current
    code, records = batch(shelf, tmp_path, capsys, "--resume", "-j", "1")
    assert code == 1
    assert records["one"]["status"] == "skipped"
    assert (tmp_path / "one.result.h5").stat().st_mtime_ns == written


@pytest.mark.long
def test_results_among_the_inputs_of_a_batch_are_left_out_by_what_they_hold(shelf, tmp_path, capsys):
    shutil.copy(shelf / "one.h5", tmp_path / "one.h5")
    quick = ["--method", "difference", "--model", "rigid"]
    assert main(["estimate", str(tmp_path / "one.h5"), *quick]) == 0
    shutil.copy(tmp_path / "one.result.h5", tmp_path / "kept.h5")
    capsys.readouterr()
    inputs = [str(path) for path in sorted(tmp_path.glob("*.h5"))]
    code = main(["batch", *inputs, "-o", str(tmp_path / "out"), "-j", "1", "--json", *quick])
    shown = capsys.readouterr()
    assert code == 0
    assert [Path(json.loads(line)["file"]).name for line in shown.out.splitlines()] == ["one.h5"]
    assert f"left out {tmp_path / 'kept.h5'} and 1 more: results of forceid" in shown.err
    assert [path.name for path in (tmp_path / "out").glob("*.h5")] == ["one.result.h5"]
    assert main(["batch", *inputs, "-o", str(tmp_path / "dry"), "--dry-run"]) == 0
    assert "left out" in capsys.readouterr().out
    assert main(["batch", str(tmp_path / "kept.h5"), "-o", str(tmp_path / "none"), "-j", "1"]) == 3
    assert "(1 of 1 inputs are), expected motion files" in one_error_line(capsys)
    assert main(["estimate", str(tmp_path / "kept.h5")]) == 3
    assert "kept.h5 is a result of forceid, expected a motion file" in one_error_line(capsys)


def die_on_bad(source: Path, output: Path, _settings: object) -> dict[str, object]:
    if source.stem == "bad":
        os._exit(9)
    return {"status": "ok", "file": str(source), "output": str(output)}


@pytest.mark.long
def test_file_that_kills_its_process_fails_alone(monkeypatch):
    monkeypatch.setattr(pool, "run_job", die_on_bad)
    jobs = [(Path(f"{name}.h5"), Path(f"{name}.result.h5")) for name in ("one", "bad", "two")]
    records = {r["file"]: r for r in pool.run_jobs(jobs, load_settings(), pool.processes(2))}
    assert {name: r["status"] for name, r in records.items()} == {
        "one.h5": "ok",
        "two.h5": "ok",
        "bad.h5": "failed",
    }
    assert "process died" in records["bad.h5"]["error"]


def test_two_inputs_of_one_name_stop_before_anything_runs(shelf, tmp_path, capsys):
    (tmp_path / "other").mkdir()
    shutil.copy(shelf / "one.h5", tmp_path / "other")
    words = ["batch", str(shelf / "one.h5"), str(tmp_path / "other" / "one.h5"), "-o", str(tmp_path / "out")]
    assert main(words) == 2
    assert "one.result.h5" in one_error_line(capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("times", [1, pytest.param(2, marks=pytest.mark.long)])
def test_interrupted_batch_exits_130_and_leaves_nothing_half_written(shelf, tmp_path, times):
    for k in range(100):
        shutil.copy(shelf / "one.h5", tmp_path / f"m{k}.h5")
    files = [str(tmp_path / f"m{k}.h5") for k in range(100)]
    (tmp_path / "start.py").write_text(f"if __name__ == '__main__':\n    {EXIT}")
    out = tmp_path / "out"
    run = subprocess.Popen(
        [sys.executable, tmp_path / "start.py", "batch", *files, "-o", str(out), "-j", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while not (out.is_dir() and any(out.glob("*.result.h5"))) and run.poll() is None:
        time.sleep(0.02)
    for _ in range(times):
        os.killpg(run.pid, signal.SIGINT)
        time.sleep(0.1 * (times - 1))
    _, err = run.communicate(timeout=60)
    assert run.returncode == 130
    assert "Traceback" not in err
    left = list(out.glob("*.result.h5"))
    beside = {"index.html"} if times == 1 else {"index.html", ".forceid.lock"}  # a lock that holds nobody up
    assert {path.name for path in out.iterdir()} - {path.name for path in left} <= beside
    assert len(left) < 12
    for path in left:
        with h5py.File(path) as f:
            assert "estimate" in f


def test_the_engine_is_chosen_on_the_command_line_and_tunes_too(shelf, tmp_path, monkeypatch):
    from forceid.kalman.recursions import passes

    calls = []
    plain = passes.log_likelihood
    monkeypatch.setattr(passes, "log_likelihood", lambda *a: calls.append(1) or plain(*a))
    source = shelf / "one.h5"
    out = tmp_path / "out.h5"
    assert main(["estimate", str(source), "--engine", "numpy", "-o", str(out)]) == 0
    assert calls
    with h5py.File(out) as f:
        assert f["estimate"].attrs["engine"] == "numpy"
    assert main(["estimate", str(source), "--engine", "nunpy", "-o", str(out)]) == 2
