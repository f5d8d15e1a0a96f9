"""A file larger than is held: the stages of its reduction, each from the disk, and `forceid estimate`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from evidence.batches.records import GRAVITY, NOISE, Found, pose, random_body, run
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.body.tetrahedron import affine_maps
from forceid.estimation.long.out_of_core import summed
from forceid.files.stored.blocks import opened
from forceid.files.stored.heap import fingerprint

NODES = 10_000


def write_large(path: Path, gigabytes: float) -> None:
    """A file of so many GB, written frame by frame."""
    rng = np.random.default_rng(0)
    b, frames = random_body(rng, NODES), int(gigabytes * 1e9 / (24 * NODES))
    t = 1e-3 * np.arange(frames)
    c, R = pose(t, rng)
    noise = np.empty((64, NODES, 3))
    with h5py.File(path, "w") as f:
        f["body/position"], f["body/mass"], f["motion/time"] = b.position, b.mass, t
        f["motion"].attrs["gravity"] = GRAVITY
        x = f.create_dataset("motion/position", (frames, NODES, 3), float)
        x.attrs["noise_std"] = NOISE
        for a in range(0, frames, 64):
            stop = min(a + 64, frames)
            rng.standard_normal(out=noise)
            block = c[a:stop, None] + np.einsum("tab,nb->tna", R[a:stop], b.position)
            x[a:stop] = block + NOISE * noise[: stop - a]


def stages(path: Path) -> Found:
    """Wall and CPU time of every stage, which begins with nothing of the file in memory."""
    found: Found = {}

    def lap(name: str, work: Callable[[], Any]) -> Any:
        with path.open("rb") as f:
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

        def read() -> None:
            for a, b in positions.blocks():
                at = room[: (a.stop - a.start) * X.size].reshape(-1, len(X), 3)
                positions.item.read_direct(at, np.s_[a, b, :])

        lap("read with h5py", read)
        sums = lap("read and project", lambda: summed(positions, w, Z))
        lap("motion of four markers", lambda: affine_maps(sums, (w[:, None] * Z).T @ Z))
        frames = positions.shape[0]
    lap("hash and heaps", lambda: fingerprint(path))
    return {"stages": found, "frames": frames}


def large_file(gigabytes: float, folder: Path) -> Found:
    """The stages, in a process of their own, and the command."""
    path = folder / "large.h5"
    try:
        write_large(path, gigabytes)
        found: Found = json.loads(run([sys.executable, "-m", "evidence.batches.large", str(path)]))
        argv = [Path(sys.executable).with_name("forceid"), "estimate", path, "--json"]
        clock = time.perf_counter()
        with subprocess.Popen(argv, stdout=subprocess.PIPE) as command:
            assert command.stdout is not None
            record = json.loads(command.stdout.read())
            _, _, used = os.wait4(command.pid, 0)
        return found | {
            "GB": path.stat().st_size / 1e9, "wall_s": time.perf_counter() - clock,
            "cpu_s": used.ru_utime + used.ru_stime, "peak_MB": used.ru_maxrss / 1e3,
            "verdict": record["verdict"], "reasons": record["reasons"],
        }  # fmt: skip
    finally:
        for left in (path, path.with_suffix(".result.h5")):
            left.unlink(missing_ok=True)


if __name__ == "__main__":
    print(json.dumps(stages(Path(sys.argv[1]))))
