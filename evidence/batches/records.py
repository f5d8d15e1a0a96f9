"""What batches are tried on and judged by: recordings, CPU time of all processes, numbers of results."""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from evidence.vectors import GRAVITY
from forceid.files.stored.hdf5 import write_motion
from forceid.records import Array, Body, Motion, Recording

FRAMES, NODES = 2083, 100  # 5 MB of positions
NOISE = 5e-4  # m
Found = dict[str, Any]


def random_body(rng: np.random.Generator, nodes: int) -> Body:
    X = rng.standard_normal((nodes, 3)) * [0.2, 0.1, 0.05]
    mass = (0.5 + rng.random(nodes)) / nodes
    return Body(node=tuple(f"n{i}" for i in range(nodes)), position=X - mass @ X / mass.sum(), mass=mass)


def pose(t: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """A body that is swung about in a room, turning all the while."""
    spin = rng.uniform(2, 6, 3)
    c = np.stack([2 * np.sin(2 * t), 0.3 * np.sin(7 * t), 1.5 + np.cos(3 * t)], 1)
    return c, Rotation.from_rotvec(np.outer(t, spin)).as_matrix()


def shelf(folder: str, count: int) -> list[Path]:
    """Motion files of 5 MB."""
    paths = [Path(folder, f"m{k:03d}.h5") for k in range(count)]
    for seed, path in enumerate(paths):
        rng = np.random.default_rng(seed)
        b, t = random_body(rng, NODES), 1e-3 * np.arange(FRAMES)
        c, R = pose(t, rng)
        x = c[:, None] + np.einsum("tab,nb->tna", R, b.position)
        x += NOISE * rng.standard_normal(x.shape)
        write_motion(path, Recording(b, Motion(t, x, gravity=GRAVITY, noise_std={"position": NOISE})))
    return paths


def cpu() -> float:
    """CPU time of this process and of those that ended."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


@contextmanager
def timed_into(into: Found, name: str) -> Iterator[None]:
    began = cpu()
    yield
    into[name] = into.get(name, 0.0) + cpu() - began


def run_command(words: list[str]) -> tuple[float, float]:
    """CPU and wall time of a command."""
    began, clock = cpu(), time.perf_counter()
    run([str(Path(sys.executable).with_name("forceid")), *words], (0, 1))
    return cpu() - began, time.perf_counter() - clock


def run(argv: list[str], fine: tuple[int, ...] = (0,)) -> str:
    """What a process prints; RuntimeError where it fails."""
    done = subprocess.run(argv, capture_output=True, text=True)
    if done.returncode not in fine or "Traceback" in done.stderr:
        raise RuntimeError(done.stderr)
    return done.stdout


def numbers(path: Path) -> dict[str, Array]:
    """The numbers of a result; OSError where it is torn."""
    found: dict[str, Array] = {}

    def keep(name: str, item: Any) -> None:
        if getattr(item, "dtype", None) == "f8":
            found[name] = item[...]

    with h5py.File(path) as f:
        f.visititems(keep)
    return found


def bits(path: Path) -> dict[str, bytes]:
    """The numbers of a result, bit by bit."""
    return {name: values.tobytes() for name, values in numbers(path).items()}


def results(folder: Path) -> dict[str, dict[str, bytes]]:
    """The bits of every result of a folder."""
    return {path.name: bits(path) for path in folder.glob("*.result.h5")}
