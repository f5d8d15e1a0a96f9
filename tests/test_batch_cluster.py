"""A batch on a dask.distributed cluster: the same bits as by processes here, whoever is lost on the way."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import h5py
import pytest

from forceid.cli.app import main
from forceid.cli.crew import cluster as crews
from forceid.cli.crew import pool
from forceid.config import load_settings

distributed = pytest.importorskip("distributed")
QUICK = ["--method", "difference", "--model", "rigid"]
RECIPE = 'scene = "spinner"\ntitle = "toss"\nduration = 0.2\nsample_rate = 200\nnoise_std = 5e-4\n'


@pytest.fixture(scope="module")
def local():
    """Two workers of one thread each on this machine; a job may lose its worker once."""
    import dask

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1", silence_logs=50
        ) as running,
    ):
        yield running


def contents(path):
    """The bytes of every number of a result."""
    found = {}
    with h5py.File(path) as f:
        f.visititems(
            lambda name, item: found.update(
                {name: item[...].tobytes()} if getattr(item, "dtype", None) == "f8" else {}
            )
        )
    return found


@pytest.mark.long
def test_a_cluster_gives_the_same_bits_as_two_processes(local, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "toss.toml").write_text(RECIPE)
    names = [f"m{k}.h5" for k in range(3)]
    for k, name in enumerate(names):
        assert main(["simulate", "toss.toml", "-o", name, "--seed", str(k)]) == 0
    (tmp_path / "bad.h5").write_text("no HDF5")
    capsys.readouterr()
    records, made = {}, {}
    for way, options in (("cluster", ["--scheduler", local.scheduler_address]), ("here", ["-j", "2"])):
        words = ["batch", *names, "bad.h5", "-o", way, *options, *QUICK, "--json"]
        assert main(words) == 1  # the bad one
        streams = capsys.readouterr()
        records[way] = sorted(
            (r["file"], r["status"], r.get("force_rms")) for r in map(json.loads, streams.out.splitlines())
        )
        made[way] = [contents(Path(way, name).with_suffix(".result.h5")) for name in names]
        assert "Traceback" not in streams.err
        assert Path(way, "index.html").is_file()
    assert records["cluster"] == records["here"]
    assert len(made["here"][0]) > 12
    assert made["cluster"] == made["here"]


def dies_once(source, output, _settings):
    """One file takes its worker with it the first time, another every time."""
    flag = Path(f"{output}.begun")
    if source.stem == "2" and not flag.exists():
        flag.touch()
        os._exit(9)
    if source.stem == "4":
        os._exit(9)
    output.write_text("whole")
    return {"status": "ok", "file": str(source), "output": str(output)}


@pytest.mark.long
def test_a_lost_worker_costs_no_file_but_the_one_that_kills_it(local, tmp_path):
    jobs = [(Path(f"{k}.h5"), tmp_path / f"{k}.result.h5") for k in range(8)]
    with crews.cluster(local.scheduler_address) as crew:
        records = list(pool.run_jobs(jobs, load_settings(), crew, crews.on_workers(dies_once)))
    assert sorted(r["file"] for r in records) == [str(a) for a, _ in jobs]
    assert [r["file"] for r in records if r["status"] == "failed"] == ["4.h5"]
    assert len(list(tmp_path.glob("*.result.h5"))) == 7
    assert (tmp_path / "2.result.h5.begun").exists()


def waits(source, output, _settings):
    """A job that lasts until there is a file of the name of its output."""
    while not output.exists():
        time.sleep(0.02)
    return {"status": "ok", "file": str(source), "output": str(output)}


def comes(true, seconds=60):
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(0.05)
    return true()


def test_a_crew_says_whether_it_is_at_work(local, tmp_path):
    done = tmp_path / "a.result.h5"
    with crews.cluster(local.scheduler_address) as crew, crew.open() as executor:
        assert crew.idle()
        job = executor.submit(crews.on_workers(waits), Path("a.h5"), done, load_settings())
        assert comes(lambda: not crew.idle())
        done.touch()
        assert job.result()["status"] == "ok"
        assert comes(crew.idle)


def test_a_worker_of_another_version_fails_its_files(tmp_path):
    job = Path("a.h5"), tmp_path / "a.result.h5", load_settings()
    record = crews.remotely(pool.run_job, "0.0.9", str(tmp_path), *job)
    assert record["status"] == "failed"
    assert "expected 0.0.9" in record["error"]


def test_a_scheduler_that_does_not_answer_is_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(crews, "ANSWER", 0.5)
    (tmp_path / "m.h5").write_text("never read")
    words = ["batch", str(tmp_path / "m.h5"), "-o", str(tmp_path / "out"), "--scheduler"]
    for address in ("tcp://127.0.0.1:1", "nowhere.json"):
        assert main([*words, address]) == 2
        line = capsys.readouterr().err
        assert line.startswith(f"forceid: error: --scheduler {address} no scheduler answers")
        assert line.count("\n") == 1


def test_a_cluster_that_stays_without_workers_is_given_up():
    now, workers = [0.0], [1]
    deserted = crews.watch(lambda: workers[0], lambda: now[0])
    seen = []
    for now[0], workers[0] in ((0, 1), (10, 0), (60, 0), (65, 1), (66, 0), (125, 0), (126, 0)):
        seen.append(deserted())
    assert seen == [False] * 6 + [True]
