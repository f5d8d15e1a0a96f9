"""What stops a batch, done to it: nothing is lost, nothing half-written, nothing done twice, no traceback."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from forceid.cli.app import main
from forceid.cli.crew import pool
from forceid.cli.crew.claim import NAME, claimed
from forceid.config import load_settings
from forceid.errors import ConfigError

RECIPE = 'scene = "spinner"\ntitle = "toss"\nduration = 0.2\nsample_rate = 200\nnoise_std = 5e-4\n'
QUICK = ["--method", "difference", "--model", "rigid"]
START = """
import os, resource, signal, sys
{before}
if __name__ == "__main__":
    from forceid.cli.app import main
    sys.exit(main())
"""


@pytest.fixture(scope="module")
def shelf(tmp_path_factory):
    """Four motion files, and a recipe."""
    folder = tmp_path_factory.mktemp("shelf")
    (folder / "toss.toml").write_text(RECIPE)
    for k in range(4):
        words = ["simulate", str(folder / "toss.toml"), "-o", str(folder / f"m{k}.h5"), "--seed", str(k)]
        assert main(words) == 0
    return folder


def dies_at_a_write(flag, kill):
    """What kills at the first file that is on its way to the disk, once."""
    return f"""
sync = os.fsync
def die(file):
    if not os.path.exists({str(flag)!r}):
        open({str(flag)!r}, "w").close()
        {kill}
    sync(file)
os.fsync = die
"""


def files(shelf):
    return sorted(map(str, shelf.glob("m*.h5")))


def many(shelf, folder, count):
    """That many motion files, copies of the four."""
    folder.mkdir()
    for k in range(count):
        shutil.copy(shelf / f"m{k % 4}.h5", folder / f"c{k:03d}.h5")
    return sorted(map(str, folder.iterdir()))


def started(tmp_path, words, before=""):
    """The command in a group of processes of its own; `before` runs in every one of them."""
    (tmp_path / "start.py").write_text(START.format(before=before))
    argv = [sys.executable, str(tmp_path / "start.py"), "batch", *words, *QUICK]
    pipe = subprocess.PIPE
    return subprocess.Popen(argv, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def results(folder):
    """The result files, each of them whole."""
    found = sorted(folder.glob("*.result.h5"))
    for path in found:
        with h5py.File(path) as f:
            assert np.isfinite(f["estimate/force"][...]).any()
    return found


def hidden(folder):
    return sorted(path.name for path in folder.iterdir() if path.name.startswith("."))


def until(true, seconds=60):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come to it"
        time.sleep(0.02)


def gone(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return True
    return False


def resumed(words, capsys):
    """Exit code and records of the same batch, resumed in this process."""
    capsys.readouterr()
    code = main(["batch", *words, *QUICK, "--resume", "--json", "-j", "1"])
    streams = capsys.readouterr()
    assert "Traceback" not in streams.err
    return code, [json.loads(line) for line in streams.out.splitlines()]


@pytest.mark.long
def test_killed_in_mid_batch_takes_its_processes_along_and_resumes_where_it_was(shelf, tmp_path, capsys):
    words, out = [*many(shelf, tmp_path / "in", 16), "-o", str(tmp_path / "out")], tmp_path / "out"
    run = started(tmp_path, [*words, "-j", "2"])
    until(lambda: out.is_dir() and len(list(out.glob("*.result.h5"))) > 2)
    os.kill(run.pid, signal.SIGKILL)
    run.communicate()
    until(lambda: gone(run.pid))
    done = {path: path.stat().st_mtime_ns for path in results(out)}
    assert 2 < len(done) < 16
    assert NAME in hidden(out)  # nobody holds it any more

    code, records = resumed(words, capsys)
    assert code == 0
    assert [r["status"] for r in records].count("skipped") == len(done)
    assert len({r["file"] for r in records}) == len(records) == len(results(out)) == 16
    assert {path: path.stat().st_mtime_ns for path in done} == done
    assert hidden(out) == []


@pytest.mark.long
def test_killed_in_mid_write_leaves_nothing_half_written_by_the_name_of_a_result(shelf, tmp_path, capsys):
    flag = tmp_path / "flag"
    words, out = [*files(shelf), "-o", str(tmp_path / "out")], tmp_path / "out"
    run = started(tmp_path, [*words, "-j", "1"], dies_at_a_write(flag, "os.killpg(0, signal.SIGKILL)"))
    run.communicate(timeout=60)
    assert run.returncode == -signal.SIGKILL
    assert results(out) == []
    assert any(name.endswith(".partial") for name in hidden(out))

    code, records = resumed(words, capsys)
    assert code == 0
    assert len(records) == len(results(out)) == 4
    assert hidden(out) == []


@pytest.mark.long
def test_a_process_killed_in_mid_write_costs_no_file(shelf, tmp_path):
    flag = tmp_path / "flag"
    words = [*files(shelf), "-o", str(tmp_path / "out"), "-j", "1", "--json"]
    run = started(tmp_path, words, dies_at_a_write(flag, "os.kill(os.getpid(), signal.SIGKILL)"))
    said, err = run.communicate(timeout=60)
    assert run.returncode == 0
    assert "Traceback" not in err
    assert flag.exists()
    assert len(said.splitlines()) == len(results(tmp_path / "out")) == 4
    assert hidden(tmp_path / "out") == []


@pytest.mark.long
def test_a_full_disk_fails_each_file_with_one_line_and_resume_goes_on(shelf, tmp_path, capsys):
    before = "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))"
    words, out = [*files(shelf)[:2], "-o", str(tmp_path / "out")], tmp_path / "out"
    run = started(tmp_path, [*words, "-j", "1", "--json"], before)
    said, err = run.communicate(timeout=60)
    records = [json.loads(line) for line in said.splitlines()]
    assert run.returncode == 1
    assert [r["status"] for r in records] == ["failed"] * 2
    assert all("cannot be written (File too large)" in r["error"] for r in records)
    assert "Traceback" not in err
    assert results(out) == hidden(out) == []

    code, records = resumed(words, capsys)
    assert code == 0
    assert len(results(out)) == 2


def test_a_second_batch_in_the_same_folder_is_told_who_is_there(shelf, tmp_path, capsys):
    with claimed(tmp_path / "out"):
        assert main(["batch", *files(shelf), "-o", str(tmp_path / "out"), *QUICK]) == 2
        line = capsys.readouterr().err
        assert f"is in use by another batch (process {os.getpid()} on " in line
        assert line.count("\n") == 1
    assert hidden(tmp_path / "out") == []


def test_what_is_no_folder_holds_no_results(shelf, tmp_path, capsys):
    (tmp_path / "out").write_text("a file")
    assert main(["batch", *files(shelf), "-o", str(tmp_path / "out"), *QUICK]) == 2
    assert "out cannot hold results (is not a folder)" in capsys.readouterr().err
    assert (tmp_path / "out").read_text() == "a file"


def test_links_are_read_through_and_never_written_through(shelf, tmp_path, capsys):
    out, kept = tmp_path / "out", tmp_path / "kept.h5"
    out.mkdir()
    (tmp_path / "link.h5").symlink_to(shelf / "m0.h5")
    (tmp_path / "self.h5").symlink_to(shelf / "m1.h5")
    (tmp_path / "loop.h5").symlink_to(tmp_path / "loop.h5")
    kept.write_text("not ours")
    (out / "link.result.h5").symlink_to(kept)
    (out / "self.result.h5").symlink_to(shelf / "m1.h5")
    before = (shelf / "m1.h5").read_bytes()
    words = [str(tmp_path / f"{name}.h5") for name in ("link", "self", "loop")]
    code = main(["batch", *words, "-o", str(out), "--force", "--json", "-j", "1", *QUICK])
    records = {Path(r["file"]).stem: r for r in map(json.loads, capsys.readouterr().out.splitlines())}
    assert code == 1
    assert records["link"]["status"] in ("ok", "degraded")
    assert kept.read_text() == "not ours"
    assert not (out / "link.result.h5").is_symlink()
    assert "is both input and output" in records["self"]["error"]
    assert (shelf / "m1.h5").read_bytes() == before
    assert "cannot be read" in records["loop"]["error"]


def test_every_input_that_cannot_be_read_fails_by_itself(shelf, tmp_path, capsys):
    (tmp_path / "folder.h5").mkdir()
    (tmp_path / "empty.h5").write_bytes(b"")
    (tmp_path / "cut.h5").write_bytes((shelf / "m0.h5").read_bytes()[:5000])
    shutil.copy(shelf / "m0.h5", tmp_path / "open.h5")
    shutil.copy(shelf / "m0.h5", tmp_path / "good.h5")
    names = {
        "nowhere": "No such file",
        "folder": "not a file",
        "empty": "is not an HDF5 file",
        "cut": "is cut short",
        "open": "is being written by another program",
    }
    words = [str(tmp_path / f"{name}.h5") for name in (*names, "good")]
    with h5py.File(tmp_path / "open.h5", "r+"):
        code = main(["batch", *words, "-o", str(tmp_path / "out"), "--json", "-j", "1", *QUICK])
    streams = capsys.readouterr()
    records = {Path(r["file"]).stem: r for r in map(json.loads, streams.out.splitlines())}
    assert code == 1
    assert records["good"]["status"] in ("ok", "degraded")
    for name, says in names.items():
        assert records[name]["status"] == "failed"
        assert says in records[name]["error"]
    assert "Traceback" not in streams.err
    assert [path.stem for path in results(tmp_path / "out")] == ["good.result"]


def interrupting(source, output, _settings):
    """The first job interrupts the batch, and takes its time; the others wait until it has."""
    flag = output.parent.with_suffix(".begun")
    if source.stem == "0":
        os.kill(os.getppid(), signal.SIGINT)
        flag.touch()
        time.sleep(0.5)
    until(flag.exists)
    time.sleep(0.02)
    output.write_text("whole")
    return {"status": "ok", "file": str(source), "output": str(output)}


def test_an_interrupt_finishes_and_tells_what_is_under_way_and_begins_no_more(tmp_path, capfd):
    out = tmp_path / "out"
    out.mkdir()
    jobs = [(Path(f"{k}.h5"), out / f"{k}.result.h5") for k in range(60)]
    told, before = [], signal.getsignal(signal.SIGINT)
    records = pool.run_jobs(jobs, load_settings(), pool.processes(2), interrupting)
    with pytest.raises(KeyboardInterrupt):
        told.extend(record["output"] for record in records)
    assert sorted(told) == sorted(map(str, out.iterdir()))
    assert str(out / "0.result.h5") in told
    assert len(told) < 60
    assert "finishing the files under way" in capfd.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before


def deadly(source, output, _settings):
    """Two of the files kill their process; every other call is counted."""
    if source.stem in ("3", "4"):
        os._exit(9)
    with open(output, "a") as f:
        f.write("done\n")
    return {"status": "ok", "file": str(source), "output": str(output)}


@pytest.mark.long
def test_only_files_that_kill_their_process_fail(tmp_path):
    jobs = [(Path(f"{k}.h5"), tmp_path / f"{k}.result.h5") for k in range(8)]
    records = list(pool.run_jobs(jobs, load_settings(), pool.processes(2), deadly))
    assert len(records) == 8
    assert {r["file"] for r in records if r["status"] == "failed"} == {"3.h5", "4.h5"}
    assert len(list(tmp_path.iterdir())) == 6


def test_a_record_that_is_lost_on_its_way_costs_no_file(tmp_path, monkeypatch):
    from concurrent.futures import Future, ThreadPoolExecutor

    asked = []

    class Forgetful(ThreadPoolExecutor):
        """The first time, the record of the fourth file never comes back."""

        def submit(self, work, source, *rest):
            asked.append(source.stem)
            done = super().submit(work, source, *rest)
            return Future() if asked.count("3") == 1 and source.stem == "3" else done

    monkeypatch.setattr(pool, "LOOK", 0.05)
    jobs = [(Path(f"{k}.h5"), tmp_path / f"{k}.result.h5") for k in range(6)]
    crew = pool.Crew(lambda: Forgetful(1), 2, idle=lambda: True)
    done = {"status": "ok"}
    records = list(pool.run_jobs(jobs, load_settings(), crew, lambda *job: {**done, "file": job[0].stem}))
    assert sorted(r["file"] for r in records) == list("012345")
    assert {r["status"] for r in records} == {"ok"}
    assert sorted(asked) == list("0123345")


def test_a_crew_that_is_gone_for_good_fails_every_file_and_ends():
    from concurrent.futures import ThreadPoolExecutor
    from contextlib import contextmanager

    @contextmanager
    def closed():
        executor = ThreadPoolExecutor(1)
        executor.shutdown()
        yield executor

    crew = pool.Crew(closed, 2, (RuntimeError,))
    jobs = [(Path(f"{k}.h5"), Path(f"{k}.result.h5")) for k in range(5)]
    records = list(pool.run_jobs(jobs, load_settings(), crew))
    assert [r["file"] for r in records] == [str(a) for a, _ in jobs]
    assert {r["error"] for r in records} == {"no worker is left; start some, and go on with --resume"}


def contents(path):
    """Every number and text of a result, without the time it took."""
    found = {}

    def add(name, item):
        found.update({(name, key): str(value) for key, value in item.attrs.items() if key in KEPT})
        if isinstance(item, h5py.Dataset):
            found[name] = item[...].tobytes() if item.dtype.kind == "f" else item.asstr()[...].tolist()

    KEPT = {"verdict", "reasons", "method", "model", "engine", "log_likelihood", "config", "input_sha256"}
    with h5py.File(path) as f:
        f.visititems(add)
        add("/", f)
    return found


@pytest.mark.long
def test_one_process_two_and_once_more_give_the_same_bits(shelf, tmp_path):
    made = {}
    for jobs in ("1", "2"):
        words = ["batch", *files(shelf)[:2], "-o", str(tmp_path / jobs), "-j", jobs, "--model", "rigid"]
        assert main(words) == 0
        made[jobs] = {path.name: contents(path) for path in results(tmp_path / jobs)}
    (tmp_path / "again").mkdir()
    for k in range(2):
        output = tmp_path / "again" / f"m{k}.result.h5"
        pool.run_job(shelf / f"m{k}.h5", output, load_settings(model="rigid"))
    made["again"] = {path.name: contents(path) for path in results(tmp_path / "again")}
    assert len(made["1"]) == 2
    assert len(made["1"]["m0.result.h5"]) > 20
    assert made["1"] == made["2"] == made["again"]


def test_a_rehearsal_says_what_would_be_refused_and_touches_nothing(shelf, tmp_path, capsys):
    out = tmp_path / "out"
    words = ["batch", *files(shelf), str(tmp_path / "nowhere.h5"), "-o", str(out), "--dry-run", "--json"]
    assert main(words) == 0
    planned = [json.loads(line)["status"] for line in capsys.readouterr().out.splitlines()]
    assert planned == ["planned"] * 4 + ["failed"]
    assert not out.exists()
    out.mkdir()
    (out / "m2.result.h5").write_text("anything")
    assert main(words) == 2
    streams = capsys.readouterr()
    told = [json.loads(line)["status"] for line in streams.out.splitlines()]
    assert told == ["planned", "planned", "exists", "planned", "failed"]
    assert "m2.result.h5 exists already" in streams.err
    assert [path.name for path in out.iterdir()] == ["m2.result.h5"]


def test_processes_and_a_cluster_at_once_are_refused(shelf, tmp_path, capsys):
    words = ["batch", *files(shelf), "-o", str(tmp_path / "out"), "-j", "2", "--scheduler", "tcp://h:1"]
    assert main(words) == 2
    assert "-j and --scheduler are given both" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_lock_is_let_go_however_the_batch_ends(tmp_path):
    with pytest.raises(ZeroDivisionError), claimed(tmp_path):
        raise ZeroDivisionError
    with claimed(tmp_path), pytest.raises(ConfigError, match="in use"), claimed(tmp_path):
        pass
    with claimed(tmp_path):
        assert hidden(tmp_path) == [NAME]
    assert hidden(tmp_path) == []
