"""A batch end to end beside the bytes and kernels it cannot do without; a file larger than memory; dask.

    python -m evidence.batches.batch -o docs [--files 200] [--gigabytes 20] [--only files large cluster]

Writes batch.md, batch.json and batch.png. CPU time is that of all processes. What was measured by an earlier
run is kept in batch.json, so that the parts can be run one by one.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import matplotlib
import numpy as np
from scipy.spatial.transform import Rotation

from evidence.written import asked, table, written
from forceid.config import Settings, load_settings
from forceid.files.hdf5 import read_motion, write_motion
from forceid.records import Array, Body, Motion, Recording

FRAMES, NODES = 2083, 100  # 5 MB of positions
LARGE_NODES = 10_000
SAMPLE = 20  # files whose stages are timed one by one
OPTIONS = ("--model", "rigid")
LEFT_OUT = "kernels", "two at once, start, page"
Found = dict[str, Any]


def body(rng: np.random.Generator, nodes: int) -> Body:
    X = rng.standard_normal((nodes, 3)) * [0.2, 0.1, 0.05]
    mass = (0.5 + rng.random(nodes)) / nodes
    return Body(node=tuple(f"n{i}" for i in range(nodes)), position=X - mass @ X / mass.sum(), mass=mass)


def pose(t: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """A body that is swung about in a room, turning all the while."""
    spin = rng.uniform(2, 6, 3)
    c = np.stack([2 * np.sin(2 * t), 0.3 * np.sin(7 * t), 1.5 + np.cos(3 * t)], 1)
    return c, Rotation.from_rotvec(np.outer(t, spin)).as_matrix()


def recording(seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    b, t = body(rng, NODES), 1e-3 * np.arange(FRAMES)
    c, R = pose(t, rng)
    assert b.position is not None
    x = c[:, None] + np.einsum("tab,nb->tna", R, b.position) + 5e-4 * rng.standard_normal((FRAMES, NODES, 3))
    return Recording(b, Motion(t, x, gravity=np.array([0, 0, -9.81]), noise_std={"position": 5e-4}))


def cpu() -> float:
    """CPU time of this process and of those that ended."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


@contextmanager
def timed(into: Found, name: str) -> Iterator[None]:
    began = cpu()
    yield
    into[name] = into.get(name, 0.0) + cpu() - began


def forceid(words: list[str]) -> tuple[float, float]:
    """CPU and wall time of a command."""
    began, clock = cpu(), time.perf_counter()
    done = subprocess.run(
        [str(Path(sys.executable).with_name("forceid")), *words], capture_output=True, text=True
    )
    if done.returncode not in (0, 1) or "Traceback" in done.stderr:
        raise RuntimeError(done.stderr)
    return cpu() - began, time.perf_counter() - clock


def stages(paths: list[Path], folder: Path, settings: Settings) -> Found:
    """CPU time of what happens to a file, one after the other in one process; and of the bytes alone."""
    from forceid.cli.output import describe
    from forceid.cli.pool import nis_mean
    from forceid.estimation.run import estimate_recording
    from forceid.files.heap import fingerprint
    from forceid.files.result import write_result

    found: Found = {}
    arrays: dict[str, Array] = {}
    estimate_recording(read_motion(paths[0]), settings)
    for path in paths:
        out = folder / "r.h5"
        with timed(found, "hash"):
            fingerprint(path)
        with timed(found, "read and check"):
            motion = read_motion(path)
        with timed(found, "kernels"):
            estimate = estimate_recording(motion, settings)
        with timed(found, "write"):
            write_result(out, estimate, motion)
        with timed(found, "describe"):
            describe(estimate, path, out, motion.truth)
            nis_mean(out)
        with timed(found, "raw read"), h5py.File(path) as f:
            for name in ("motion/time", "motion/position", "body/position", "body/mass"):
                f[name][...]
        with h5py.File(out) as f:
            f.visititems(
                lambda name, item: (
                    arrays.update({name: item[...]}) if getattr(item, "dtype", None) == "f8" else None
                )
            )
        with timed(found, "raw write"), h5py.File(folder / "raw.h5", "w") as f:
            for name, values in arrays.items():
                f[name] = values
    found["read and check"] -= found["hash"]
    return {name: seconds / len(paths) for name, seconds in found.items()}


def many_files(count: int) -> Found:
    """The batch of that many files of 5 MB by two processes, and where its time goes."""
    settings = load_settings(model="rigid")
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, f"m{k:03d}.h5") for k in range(count)]
        for k, path in enumerate(paths):
            write_motion(path, recording(k))
        each = stages(paths[:SAMPLE], Path(folder), settings)
        words = ["batch", *map(str, paths), "-o", f"{folder}/out", "-j", "2", *OPTIONS]
        whole, wall = forceid(words)
        again, _ = forceid([*words, "--resume"])
        size = sum(path.stat().st_size for path in paths) / 1e6
    floor = each["raw read"] + each["raw write"] + each["kernels"]
    return {
        "files": count, "MB": size, "cpu_s": whole, "wall_s": wall, "resume_cpu_s": again,
        "each_s": each, "floor_s": count * floor, "ratio": whole / (count * floor),
    }  # fmt: skip


def write_large(path: Path, gigabytes: float) -> None:
    """A file of so many GB, 10000 nodes, written frame by frame."""
    rng = np.random.default_rng(0)
    b, frames = body(rng, LARGE_NODES), int(gigabytes * 1e9 / (24 * LARGE_NODES))
    t = 1e-3 * np.arange(frames)
    c, R = pose(t, rng)
    noise = np.empty((64, LARGE_NODES, 3))
    with h5py.File(path, "w") as f:
        f["body/position"], f["body/mass"], f["motion/time"] = b.position, b.mass, t
        f["motion"].attrs["gravity"] = [0.0, 0.0, -9.81]
        x = f.create_dataset("motion/position", (frames, LARGE_NODES, 3), float)
        x.attrs["noise_std"] = 5e-4
        for a in range(0, frames, 64):
            stop = min(a + 64, frames)
            rng.standard_normal(out=noise)
            block = c[a:stop, None] + np.einsum("tab,nb->tna", R[a:stop], b.position)
            x[a:stop] = block + 5e-4 * noise[: stop - a]


LARGE_STUDY = """
import json, os, sys, time
from pathlib import Path
import numpy as np
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.body.tetrahedron import affine_maps
from forceid.estimation.long.out_of_core import summed
from forceid.files.blocks import opened
from forceid.files.heap import fingerprint
path, found = Path(sys.argv[1]), {}
def lap(name, work):
    with open(path, "rb") as f:
        os.posix_fadvise(f.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    wall, cpu = time.perf_counter(), time.process_time()
    done = work()
    found[name] = time.perf_counter() - wall, time.process_time() - cpu
    return done
with opened(path) as (recording, positions):
    inertia = inertia_of(recording.body)
    X = recording.body.position - inertia.center
    w, Z = inertia.weight, np.hstack([np.ones((len(X), 1)), X])
    room = np.empty(max(a.stop - a.start for a, _ in positions.blocks()) * 3 * len(X))
    def read():
        for a, b in positions.blocks():
            at = room[: (a.stop - a.start) * X.size].reshape(-1, len(X), 3)
            positions.item.read_direct(at, np.s_[a, b, :])
    lap("read with h5py", read)
    sums = lap("read and project", lambda: summed(positions, w, Z))
    lap("motion of four markers", lambda: affine_maps(sums, (w[:, None] * Z).T @ Z))
lap("hash and heaps", lambda: fingerprint(path))
print(json.dumps({"stages": found, "frames": positions.shape[0]}))
"""


def large_file(gigabytes: float, folder: Path) -> Found:
    """A file larger than is held: the stages of its reduction, and `forceid estimate` as it is."""
    path = folder / "large.h5"
    try:
        write_large(path, gigabytes)
        done = subprocess.run([sys.executable, "-c", LARGE_STUDY, str(path)], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr)
        found: Found = json.loads(done.stdout) | {"GB": path.stat().st_size / 1e9}
        argv = [Path(sys.executable).with_name("forceid"), "estimate", path, "--json"]
        clock = time.perf_counter()
        with subprocess.Popen(argv, stdout=subprocess.PIPE) as command:
            assert command.stdout is not None
            record = json.loads(command.stdout.read())
            _, _, used = os.wait4(command.pid, 0)
        return found | {
            "wall_s": time.perf_counter() - clock, "cpu_s": used.ru_utime + used.ru_stime,
            "peak_MB": used.ru_maxrss / 1e3, "verdict": record["verdict"], "reasons": record["reasons"],
        }  # fmt: skip
    finally:
        for left in (path, path.with_suffix(".result.h5")):
            left.unlink(missing_ok=True)


def numbers(path: Path) -> dict[str, bytes]:
    """The numbers of a result, bit by bit; OSError where it is torn."""
    found: dict[str, bytes] = {}
    with h5py.File(path) as f:
        f.visititems(
            lambda name, item: found.update(
                {name: item[...].tobytes()} if getattr(item, "dtype", None) == "f8" else {}
            )
        )
    return found


def bits(folder: Path) -> dict[str, dict[str, bytes]]:
    """The numbers of every result of a folder."""
    return {path.name: numbers(path) for path in folder.glob("*.result.h5")}


def on_cluster(count: int) -> Found:
    """Two dask workers beside -j 2: the same bits, and what it costs."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, f"m{k:03d}.h5") for k in range(count)]
        for k, path in enumerate(paths):
            write_motion(path, recording(k))
        words = ["batch", *map(str, paths), *OPTIONS, "-o"]
        here = forceid([*words, f"{folder}/here", "-j", "2"])
        began = cpu()
        argv = [sys.executable, "-c", CLUSTER, *words, f"{folder}/there"]
        done = subprocess.run(argv, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr)
        started, batch = json.loads(done.stdout.splitlines()[-1])
        made = bits(Path(folder, "here"))
        return {
            "files": count, "here_cpu_s": here[0], "here_wall_s": here[1], "cluster_cpu_s": cpu() - began,
            "cluster_start_s": started, "cluster_wall_s": batch, "arrays": sum(map(len, made.values())),
            "same_bits": made == bits(Path(folder, "there")),
        }  # fmt: skip


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


def draw(found: Found, path: Path) -> None:
    """What a file costs: bytes and kernels alone, and the batch, in stages."""
    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    each, count = found["each_s"], found["files"]
    measured = sum(each[name] for name in ("hash", "read and check", "kernels", "write", "describe"))
    rest = max(found["cpu_s"] / count - measured, 0.0)
    bars = {
        "cannot do without": [("raw read", each["raw read"]), ("raw write", each["raw write"]),
                              ("kernels", each["kernels"])],
        "forceid batch -j 2": [("hash and heaps", each["hash"]), ("read, check", each["read and check"]),
                               ("kernels", each["kernels"]), ("write", each["write"]),
                               ("describe", each["describe"]), ("two at once, start, page", rest)],
    }  # fmt: skip
    color = {"kernels": "#0072B2", "raw read": "#009E73", "raw write": "#E69F00", "hash and heaps": "#AA4499",
             "read, check": "#009E73", "write": "#E69F00", "describe": "#56B4E9",
             "two at once, start, page": "#8A8F98"}  # fmt: skip
    fig, axes = plt.subplots(2, 1, figsize=(8, 4.6), layout="constrained")
    for ax, skip, title in ((axes[0], (), "All of it"), (axes[1], LEFT_OUT, "Bytes alone")):
        for y, (_name, parts) in enumerate(bars.items()):
            at = 0.0
            for part, seconds in parts:
                if part in skip:
                    continue
                ms = 1e3 * seconds
                ax.barh(y, ms, left=at, color=color[part], edgecolor="white", label=part if y else None)
                at += ms
            ax.text(at, y, f" {at:.0f} ms", va="center", fontsize=9)
        ax.set_yticks(range(len(bars)), list(bars), fontsize=9)
        ax.set_title(f"{title}, CPU time a file of 5 MB", fontsize=10, loc="left")
        ax.set_xlim(0, ax.get_xlim()[1] * 1.12)
        ax.spines[["top", "right"]].set_visible(False)
        ax.invert_yaxis()
    axes[1].set_xlabel("ms")
    axes[0].legend(fontsize=8, frameon=False, ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.45))
    fig.savefig(path, dpi=140)
    plt.close(fig)


def page(found: Found, command: str) -> str:
    """The measurements as markdown."""
    out = ["# Batches", "", f"`{command}`, {os.cpu_count()} cores, {time.strftime('%Y-%m-%d')}.", ""]
    if files := found.get("files"):
        each = [{"stage": name, "ms a file": 1e3 * s} for name, s in files["each_s"].items()]
        out += [
            f"## {files['files']} files of 5 MB", "",
            f"CPU time of all processes {files['cpu_s']:.0f} s, of reading and writing the same bytes with "
            f"h5py and of the kernels {files['floor_s']:.0f} s: **{files['ratio']:.2f} times** (asked: at "
            f"most 3). Wall time {files['wall_s']:.0f} s. `--resume` of all: "
            f"{files['resume_cpu_s']:.0f} s. What is over the stages below is start, handing out, the page, "
            "and what processes at once, and whatever else runs, take from each other.", "",
            f"Stages of the first {SAMPLE} files, one process:", "",
            table(each, ["stage", "ms a file"]), "", "![stages](batch.png)", "",
        ]  # fmt: skip
    if large := found.get("large"):
        rows = [{"stage": n, "wall, s": w, "CPU, s": c} for n, (w, c) in large["stages"].items()]
        read, project = (large["stages"][n] for n in ("read with h5py", "read and project"))
        out += [
            f"## One file of {large['GB']:.1f} GB, {LARGE_NODES} nodes, {large['frames']} frames", "",
            f"`forceid estimate`: peak memory {large['peak_MB']:.0f} MB (asked: at most 1000), "
            f"{large['wall_s']:.0f} s, CPU time {large['cpu_s']:.0f} s, verdict {large['verdict']}"
            f"{''.join(f'; {reason}' for reason in large['reasons'])}.", "",
            f"Reading and projecting takes {project[0] / read[0]:.2f} times the wall time of reading with "
            f"h5py, {project[1] / read[1]:.2f} times its CPU time (asked: at most 2). Each stage begins with "
            "the file on the disk, none of it in memory.", "",
            table(rows, ["stage", "wall, s", "CPU, s"]), "",
        ]  # fmt: skip
    if cluster := found.get("cluster"):
        same = "the same bits" if cluster["same_bits"] else "**other bits**"
        out += [
            f"## Two dask workers beside `-j 2`, {cluster['files']} files", "",
            f"{same.capitalize()} in {cluster['arrays']} arrays. CPU time {cluster['cluster_cpu_s']:.0f} s "
            f"with scheduler and start of the workers, {cluster['here_cpu_s']:.0f} s by `-j 2`; wall time of "
            f"the batch {cluster['cluster_wall_s']:.0f} s after {cluster['cluster_start_s']:.1f} s of start, "
            f"{cluster['here_wall_s']:.0f} s by `-j 2`.", "",
        ]  # fmt: skip
    return "\n".join(out)


def main() -> int:
    """Run the parts that were asked for."""
    room, parts_of = tempfile.gettempdir(), ("files", "large", "cluster")
    args = asked(
        "evidence.batches.batch",
        __doc__,
        files=200,
        gigabytes=20.0,
        scratch=room,
        cluster_files=40,
        only=parts_of,
    )
    args.output.mkdir(parents=True, exist_ok=True)
    kept = args.output / "batch.json"
    found: Found = json.loads(kept.read_text()) if kept.exists() else {}
    parts: dict[str, Callable[[], Found]] = {
        "files": lambda: many_files(args.files),
        "large": lambda: large_file(args.gigabytes, Path(args.scratch)),
        "cluster": lambda: on_cluster(args.cluster_files),
    }
    for name in args.only:
        found[name] = parts[name]()
        kept.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if "files" in found:
        draw(found["files"], args.output / "batch.png")
    text = page(found, "python -m evidence.batches.batch")
    written(args.output, "batch.md", text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
