"""A batch end to end beside the bytes and kernels it cannot do without; a file larger than memory; dask.

    python -m evidence.batches.batch -o docs [--files 200] [--gigabytes 20] [--only files large cluster]

Writes batch.md and batch.json. CPU time is that of all processes. What was measured by an earlier
run is kept in batch.json, so that the parts can be run one by one.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import h5py

from evidence.batches import large
from evidence.batches.records import Found, cpu, numbers, results, run, run_command, shelf, timed_into
from evidence.written import asked, paged, table
from forceid.cli.boundary.output import describe
from forceid.cli.crew.pool import nis_mean
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.files.result import write_result
from forceid.files.stored.hdf5 import read_motion
from forceid.files.stored.heap import fingerprint

SAMPLE = 20  # files whose stages are timed one by one
OPTIONS = ("--model", "rigid")
CLUSTER = """
import json, subprocess, sys, time
from distributed import LocalCluster
from forceid.cli.app import main
if __name__ == "__main__":
    began = time.perf_counter()
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster:
        up = time.perf_counter()
        code = main([*sys.argv[1:], "--scheduler", cluster.scheduler_address])
        print(json.dumps([up - began, time.perf_counter() - up]))
    sys.exit(code if code > 1 else 0)
"""


def stages_of_files(paths: list[Path], folder: Path) -> Found:
    """CPU time of what happens to a file, one after the other in one process; and of the bytes alone."""
    found: Found = {}
    settings, out = load_settings(model="rigid"), folder / "r.h5"
    estimate_recording(read_motion(paths[0]), settings)
    for path in paths:
        with timed_into(found, "hash"):
            fingerprint(path)
        with timed_into(found, "read and check"):
            motion = read_motion(path)
        with timed_into(found, "kernels"):
            estimate = estimate_recording(motion, settings)
        with timed_into(found, "write"):
            write_result(out, estimate, motion)
        with timed_into(found, "describe"):
            describe(estimate, path, out, motion.truth)
            nis_mean(out)
        with timed_into(found, "raw read"), h5py.File(path) as f:
            for name in ("motion/time", "motion/position", "body/position", "body/mass"):
                f[name][...]
        arrays = numbers(out)
        with timed_into(found, "raw write"), h5py.File(folder / "raw.h5", "w") as f:
            for name, values in arrays.items():
                f[name] = values
    found["read and check"] -= found["hash"]
    return {name: seconds / len(paths) for name, seconds in found.items()}


def many_files(count: int) -> Found:
    """The batch of that many files of 5 MB by two processes, and where its time goes."""
    with tempfile.TemporaryDirectory() as folder:
        paths = shelf(folder, count)
        each = stages_of_files(paths[:SAMPLE], Path(folder))
        words = ["batch", *map(str, paths), "-o", f"{folder}/out", "-j", "2", *OPTIONS]
        whole, wall = run_command(words)
        again, _ = run_command([*words, "--resume"])
        size = sum(path.stat().st_size for path in paths) / 1e6
    floor = count * (each["raw read"] + each["raw write"] + each["kernels"])
    return {
        "files": count, "MB": size, "cpu_s": whole, "wall_s": wall, "resume_cpu_s": again,
        "each_s": each, "floor_s": floor, "ratio": whole / floor,
    }  # fmt: skip


def on_cluster(count: int) -> Found:
    """Two dask workers beside -j 2: the same bits, and what it costs."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["batch", *map(str, shelf(folder, count)), *OPTIONS, "-o"]
        here = run_command([*words, f"{folder}/here", "-j", "2"])
        began = cpu()
        said = run([sys.executable, "-c", CLUSTER, *words, f"{folder}/there"])
        started, batch = json.loads(said.splitlines()[-1])
        made = results(Path(folder, "here"))
        return {
            "files": count, "here_cpu_s": here[0], "here_wall_s": here[1], "cluster_cpu_s": cpu() - began,
            "cluster_start_s": started, "cluster_wall_s": batch, "arrays": sum(map(len, made.values())),
            "same_bits": made == results(Path(folder, "there")),
        }  # fmt: skip


def of_files(files: Found) -> list[str]:
    """The batch on the page."""
    each = [{"stage": name, "ms a file": 1e3 * s} for name, s in files["each_s"].items()]
    return [
        f"## {files['files']} files of 5 MB",
        f"CPU time of all processes {files['cpu_s']:.0f} s, of reading and writing the same bytes with "
        f"h5py and of the kernels {files['floor_s']:.0f} s: **{files['ratio']:.2f} times** (asked: at "
        f"most 3). Wall time {files['wall_s']:.0f} s. `--resume` of all: "
        f"{files['resume_cpu_s']:.0f} s.",
        f"Stages of the first {SAMPLE} files, one process:", table(each),
    ]  # fmt: skip


def of_large(found: Found) -> list[str]:
    """The large file on the page."""
    rows = [{"stage": n, "wall, s": w, "CPU, s": c} for n, (w, c) in found["stages"].items()]
    read, project = (found["stages"][n] for n in ("read with h5py", "read and project"))
    return [
        f"## One file of {found['GB']:.1f} GB, {large.NODES} nodes, {found['frames']} frames",
        f"`forceid estimate`: peak memory {found['peak_MB']:.0f} MB (asked: at most 1000), "
        f"{found['wall_s']:.0f} s, CPU time {found['cpu_s']:.0f} s, verdict {found['verdict']}. Its reasons "
        "are in `batch.json`.",
        f"Reading and projecting takes {project[0] / read[0]:.2f} times the wall time of reading with "
        f"h5py, {project[1] / read[1]:.2f} times its CPU time (asked: at most 2). Each stage begins with "
        "the file on the disk, none of it in memory.", table(rows),
    ]  # fmt: skip


def of_cluster(cluster: Found) -> list[str]:
    """The cluster on the page."""
    same = "The same bits" if cluster["same_bits"] else "**Other bits**"
    return [
        f"## Two dask workers beside `-j 2`, {cluster['files']} files",
        f"{same} in {cluster['arrays']} arrays. CPU time {cluster['cluster_cpu_s']:.0f} s "
        f"with scheduler and start of the workers, {cluster['here_cpu_s']:.0f} s by `-j 2`; wall time of "
        f"the batch {cluster['cluster_wall_s']:.0f} s after {cluster['cluster_start_s']:.1f} s of start, "
        f"{cluster['here_wall_s']:.0f} s by `-j 2`.",
    ]


PAGE_PARTS = {"files": of_files, "large": of_large, "cluster": of_cluster}


def main() -> None:
    """Run the parts that were asked for."""
    taken = {"files": 200, "gigabytes": 20.0, "scratch": tempfile.gettempdir(), "cluster_files": 40}
    args = asked("evidence.batches.batch", __doc__, **taken, only=tuple(PAGE_PARTS))
    args.output.mkdir(parents=True, exist_ok=True)
    kept = args.output / "batch.json"
    found: Found = json.loads(kept.read_text()) if kept.exists() else {}
    parts: dict[str, Callable[[], Found]] = {
        "files": lambda: many_files(args.files),
        "large": lambda: large.large_file(args.gigabytes, Path(args.scratch)),
        "cluster": lambda: on_cluster(args.cluster_files),
    }
    for name in args.only:
        found[name] = parts[name]()
        kept.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    said = f"`python -m evidence.batches.batch`, {os.cpu_count()} cores, {time.strftime('%Y-%m-%d')}."
    text = [part for name, of in PAGE_PARTS.items() if name in found for part in of(found[name])]
    paged(args.output, "batch", "Batches", said, *text)


if __name__ == "__main__":
    main()
