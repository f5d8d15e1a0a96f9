"""Time and memory of an estimate as a record grows: by frames, by nodes, by modes.

    python -m evidence.attack.growth -o docs [--frames 1000 ...] [--nodes 3 ...] [--modes 0 ...]

Writes growth.md and growth.png. Every estimate is a process of its own, with one thread of BLAS. The flight
is drawn: gusts push a body that hangs on a soft spring, and make it nod about its steady spin; amplitudes of
modes are sines. A line a + b n, by least squares of ratios, goes through the sizes of each: what is off it
grows otherwise. Where modes grow each is the mean of RECORDS records, since the level that a record is
estimated at, which chance decides where modes hardly stand out, costs more or less than half of the time.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np
from scipy.optimize import nnls
from scipy.signal import cont2discrete, lfilter
from scipy.spatial.transform import Rotation

from evidence.vectors import GRAVITY
from evidence.written import asked, paged, pictured, table
from forceid.estimation.long.windows import LONG
from forceid.files.stored.blocks import STRETCH_BYTES
from forceid.report.plots.style import BLUE, GRAY, panels

RATE, NOISE = 200.0, 2e-4  # Hz, m
FEW, SHORT, BEAM = 8, 300, 60  # nodes where frames grow, frames where others do, nodes that bend
WRITTEN = 1 << 14  # frames written at a time
ALLOWED = 1.3  # times the line
RECORDS = 8  # of each number of modes: their mean scatters by a sixth where they scatter by a half
GUST, FORGETS, SWING = 2.0, 0.1, 0.5  # m/s2, one standard deviation along an axis; s; Hz
NOD, SPIN = 10.0, 6.0  # rad/s2, of a nod under gusts; rad/s
MEASURED = """\
import sys, time
from forceid.cli.app import main
code = main()
peak = open("/proc/self/status").read().partition("VmHWM:")[2].split()[0]
print(time.process_time(), peak, file=sys.stderr)
sys.exit(code)
"""  # an estimate, and then its CPU time and the most memory it held, kB: not what held it before it began
Cost = tuple[float, float]  # CPU s, peak memory in MB


def body(nodes: int, modes: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """A body of equal masses that lie anywhere in a box, and shapes that hold no rigid motion."""
    at = rng.uniform(-0.15, 0.15, (nodes, 3))
    at -= at.mean(0)
    found: dict[str, np.ndarray] = {"position": at, "mass": np.full(nodes, 1.0 / nodes)}
    if modes:
        rigid = np.concatenate(
            [np.tile(np.eye(3), (nodes, 1)), np.cross(at[:, None], np.eye(3)).reshape(-1, 3)], 1
        )
        shapes = np.linalg.qr(np.concatenate([rigid, rng.standard_normal((3 * nodes, modes))], 1))[0][:, 6:]
        found["mode_shape"] = shapes.T.reshape(modes, nodes, 3) * np.sqrt(nodes)
        found["mode_frequency"] = np.linspace(30.0, 60.0, modes)
        found["mode_damping"] = np.full(modes, 0.01)
    return found


def swung(samples: int, columns: int, rng: np.random.Generator) -> np.ndarray:
    """Gusts of unit size (time, column), and what swings under them at SWING: s2 of their unit."""
    keep = np.exp(-1 / (RATE * FORGETS))
    gusts = lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], rng.standard_normal((samples, columns)), axis=0)
    w = 2 * np.pi * SWING
    b, a, _ = cont2discrete(([1.0], [1.0, w, w**2]), 1 / RATE)
    return np.asarray(lfilter(b.ravel(), a, gusts, axis=0))


def write(file: Path, frames: int, nodes: int, modes: int, seed: int = 0) -> None:
    """A record of that size: markers on all nodes, with noise."""
    rng = np.random.default_rng([frames, nodes, modes, seed])
    about = body(nodes, modes, rng)
    pace, phase = 2 * np.pi * rng.uniform(1.0, 8.0, modes), rng.uniform(0.0, 2 * np.pi, modes)
    units = {"position": "m", "mass": "kg", "mode_shape": "1", "mode_frequency": "Hz", "mode_damping": "1"}
    with h5py.File(file, "w") as f:
        f.attrs.update(forceid_schema="1", title="growth", source="", history="", Conventions="CF-1.11")
        for name, value in about.items():
            f.create_dataset(f"body/{name}", data=value).attrs["units"] = units[name]
        time = np.arange(frames) / RATE
        swing = swung(frames, 4, rng)
        center, nod = GUST * swing[:, :3], NOD * swing[:, 3:]
        R = Rotation.from_rotvec(SPIN * time[:, None] * [0.0, 0.0, 1.0]) * Rotation.from_rotvec(
            nod * [1.0, 0.0, 0.0]
        )
        f.create_dataset("motion/time", data=time).attrs["units"] = "s"
        x = f.create_dataset("motion/position", (frames, nodes, 3), float)
        x.attrs.update(units="m", noise_std=NOISE)
        for group in ("body", "motion"):
            f.create_dataset(f"{group}/node", data=[f"n{k}" for k in range(nodes)])
        f["motion"].attrs["gravity"] = GRAVITY
        for first in range(0, frames, WRITTEN):
            t = time[first : first + WRITTEN]
            held = np.broadcast_to(about["position"], (len(t), nodes, 3))
            if modes:
                q = 2e-3 * np.sin(t[:, None] * pace + phase) / np.sqrt(modes)
                held = held + np.einsum("tm,mna->tna", q, about["mode_shape"])
            now = slice(first, first + len(t))
            flown = np.einsum("tab,tnb->tna", R[now].as_matrix(), held) + center[now, None]
            x[first : first + len(t)] = flown + NOISE * rng.standard_normal(flown.shape)


def mean_cost(folder: Path, frames: int, nodes: int, modes: int, records: int) -> Cost:
    """CPU time and peak memory of `forceid estimate` on records of that size, the mean."""
    seconds, megabytes = np.mean([cost(folder, frames, nodes, modes, k) for k in range(records)], axis=0)
    return float(seconds), float(megabytes)


def cost(folder: Path, frames: int, nodes: int, modes: int, seed: int = 0) -> Cost:
    """CPU time and peak memory of `forceid estimate` on a record of that size."""
    file = folder / "growth.h5"
    write(file, frames, nodes, modes, seed)
    words = [
        sys.executable,
        "-c",
        MEASURED,
        "estimate",
        str(file),
        "-o",
        str(folder / "growth.result.h5"),
        "--force",
        "--quiet",
    ]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    ended = subprocess.run(words, env=environment, stderr=subprocess.PIPE, text=True)
    if ended.returncode:
        raise SystemExit(f"{frames} frames, {nodes} nodes, {modes} modes: {ended.stderr}")
    seconds, kilobytes = map(float, ended.stderr.split()[-2:])
    found = seconds, kilobytes / 1e3
    print(frames, nodes, modes, *np.round(found, 2), file=sys.stderr, flush=True)
    return found


def line_through(size: Sequence[int], value: np.ndarray) -> np.ndarray:
    """The line a + b n through values: a and b, neither below zero, by least squares of ratios."""
    rows = np.stack([np.ones(len(size)), np.asarray(size, float)], 1) / value[:, None]
    return np.asarray(nnls(rows, np.ones(len(size)))[0])


def main() -> None:
    """Grow in all three ways, and write page and picture."""
    args = asked(
        "evidence.attack.growth",
        __doc__,
        frames=(1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000),
        nodes=(3, 10, 30, 100, 300, 1000, 3000, 10_000, 20_000),
        modes=(0, 2, 5, 10, 20, 40),
    )
    ways = {
        "frames": [(n, FEW, 0) for n in args.frames],
        "nodes": [(SHORT, n, 0) for n in args.nodes],
        "modes": [(SHORT, BEAM, n) for n in args.modes],
    }
    figure, axes = panels(2, 3, (10, 5.2), sharex="col")
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for column, (way, sizes) in enumerate(ways.items()):
            n = list(getattr(args, way))
            records = RECORDS if way == "modes" else 1
            found = np.array([mean_cost(Path(name), *size, records) for size in sizes])
            row: dict[str, str | float] = {"by": way, "sizes": f"{n[0]} to {n[-1]}"}
            for k, (what, unit) in enumerate((("CPU time", "s"), ("memory", "MB"))):
                line = line_through(n, found[:, k])
                expected = line[0] + line[1] * np.array(n)
                row[f"{what}, {unit}"] = f"{found[:, k].min():.3g} to {found[:, k].max():.3g}"
                row[f"{what} over line"] = float((found[:, k] / expected).max())
                ax = axes[k, column]
                fine = (
                    np.geomspace(max(n[0], 1), n[-1], 200)
                    if way != "modes"
                    else np.linspace(n[0], n[-1], 200)
                )
                through = line[0] + line[1] * fine
                ax.fill_between(fine, through / ALLOWED, through * ALLOWED, color=GRAY, alpha=0.25, lw=0)
                ax.plot(fine, through, color=GRAY, lw=1)
                ax.plot(n, found[:, k], "o", color=BLUE, ms=4)
                ax.set_yscale("log")
                low, high = ax.get_ylim()
                steps = (1, 2, 5) if high > 10 * low else (1, 1.5, 2, 3, 5, 7)
                shown = [m * 10.0**k for k in range(6) for m in steps if low < m * 10.0**k < high]
                ax.set_yticks(shown, [f"{v:g}" for v in shown])
                ax.set_yticks([], minor=True)
                if way != "modes":
                    ax.set_xscale("log")
                if not column:
                    ax.set_ylabel(f"{what} ({unit})")
            axes[1, column].set_xlabel(way)
            rows.append(row)
    pictured(args.output, "growth", figure)
    dots = f"each dot a process, by modes the mean of {RECORDS}"
    about = f"`{args.command}`: {dots}; the band is {ALLOWED:g} times off a line."
    paged(
        args.output,
        "growth",
        "Time and memory as a record grows",
        about,
        table(rows),
        "![CPU time and memory over frames, nodes and modes](growth.png)",
        f"Beyond {LONG} frames, stretches; over {STRETCH_BYTES / 1e6:g} MB of one, four markers.",
    )


if __name__ == "__main__":
    main()
