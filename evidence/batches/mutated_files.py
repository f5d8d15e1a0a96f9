"""Motion and result files with damaged bytes: what the reader makes of each, counted.

    python -m evidence.batches.mutated_files -o docs [--count 100000] [--first 0]

Writes mutated_files.md. Every file is made from its number alone, so that any of them can be made again
(`--first K --count 1`). A process reads many and says which it is at: one that dies or stops is found,
counted, and the rest go on in another.
"""

from __future__ import annotations

import itertools
import os
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from evidence.written import asked, paged, table
from forceid.config import Settings
from forceid.errors import DataError, ForceIdError
from forceid.estimation.long.out_of_core import read_recording
from forceid.files.result import read_result, write_result
from forceid.files.stored.hdf5 import write_motion
from forceid.records import Body, Motion, Recording

PATIENCE = 60  # s of wall time that one file may take
SETTINGS = Settings()
BATCH = 2000  # files a process reads
FINE = ("refused", "read")
ABOUT = """\
`{command}`: {count} files, motion and result files, each with one kind of damage. `refused`: one line that \
names the file; `read`: the damage fell where it changes no structure, or a number that is still a possible \
one."""


def markers(rng: np.random.Generator) -> Recording:
    """Twenty frames of four markers with names."""
    names = tuple(f"marker_{k}" for k in range(4))
    body = Body(node=names, position=rng.standard_normal((4, 3)), mass=rng.random(4) + 0.1)
    motion = Motion(np.arange(20) / 100, rng.standard_normal((20, 4, 3)), gravity=np.array([0.0, 0.0, -9.81]))
    return Recording(body, motion, {"force": rng.standard_normal((20, 3))}, "title", "source", "history")


def originals(folder: Path) -> dict[str, bytes]:
    """Whole files of every layout that is met: netCDF, plain, compressed, of the latest format, a result."""
    from forceid.config import load_settings
    from forceid.estimation.run import estimate_recording

    recording = markers(np.random.default_rng(0))
    path = folder / "a.h5"
    write_motion(path, recording)
    found = {"netCDF": path.read_bytes()}
    for name, options, libver in (
        ("plain", {}, "earliest"),
        ("compressed", {"compression": "gzip", "shuffle": True, "fletcher32": True}, "earliest"),
        ("latest", {"chunks": True}, "latest"),
    ):
        with h5py.File(path, "r") as whole, h5py.File(folder / "b.h5", "w", libver=libver) as f:
            for group in ("body", "motion", "truth"):
                for key, item in whole[group].items():
                    if item.dtype.kind == "f":
                        f.create_dataset(f"{group}/{key}", data=item[...], **options)
                        f[f"{group}/{key}"].attrs["units"] = item.attrs.get("units", "1")
            f["body/node"] = list(recording.body.node)
            f["motion"].attrs["gravity"] = recording.motion.gravity
        found[name] = (folder / "b.h5").read_bytes()
    settings = load_settings(method="difference", model="rigid")
    write_result(path, estimate_recording(recording, settings), recording)
    return found | {"result": path.read_bytes()}


def mutated(whole: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    """The bytes damaged in one way, and which."""
    data, n = bytearray(whole), len(whole)
    kind = str(rng.choice(["bytes", "bits", "near bytes", "number", "cut", "blank", "moved", "longer"]))
    at = int(rng.integers(n))
    if kind == "bytes":
        for k in rng.integers(0, n, rng.integers(1, 30)):
            data[k] = rng.integers(256)
    elif kind == "bits":
        for k in rng.integers(0, n, rng.integers(1, 4)):
            data[k] ^= 1 << int(rng.integers(8))
    elif kind == "near bytes":
        for k in rng.integers(at, min(at + 64, n), rng.integers(1, 8)):
            data[k] = rng.choice([0, 1, 127, 128, 255])
    elif kind == "number":
        value = (0, 1, 2**16, 2**31 - 1, 2**32 - 1, 2**63 - 1, 2**64 - 1)[rng.integers(7)]
        at = 8 * (at // 8)
        data[at : at + 8] = value.to_bytes(8, "little")[: n - at]
    elif kind == "cut":
        del data[at:]
    elif kind == "blank":
        size = min(int(rng.integers(1, 4096)), n - at)
        data[at : at + size] = bytes(size)
    elif kind == "moved":
        source, size = int(rng.integers(n)), int(rng.integers(8, 512))
        data[at : at + size] = data[source : source + size]
    else:
        data[at:at] = rng.bytes(int(rng.integers(1, 64)))
    return kind, bytes(data)


def example(number: int, whole: dict[str, bytes]) -> tuple[str, str, bytes]:
    """Layout, damage and bytes of the file of that number."""
    rng = np.random.default_rng([20260, number])
    layout = str(rng.choice(list(whole)))
    kind, data = mutated(whole[layout], rng)
    return layout, kind, data


def outcome(path: Path, layout: str) -> str:
    """What a reader makes of the file: `read`, `refused`, or what escaped."""
    try:
        read_result(path) if layout == "result" else read_recording(path, SETTINGS)
    except DataError as e:
        line = str(e)
        return "refused" if "\n" not in line and str(path) in line else f"unclear line: {line[:100]!r}"
    except ForceIdError as e:
        return f"other error: {e}"
    except BaseException as e:
        return f"escaped: {type(e).__name__}"
    return "read"


def read_many(first: int, count: int, folder: str, wire: Any) -> None:
    """Read that many files from the first, say what came of each; an alarm ends who stands still."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 2)
    with tempfile.TemporaryDirectory(dir=folder) as own:
        whole = originals(Path(own))
        path = Path(own, "m.h5")
        for number in range(first, first + count):
            layout, kind, data = example(number, whole)
            path.write_bytes(data)
            wire.send((number, layout, kind, "begun", 0.0, 0))
            signal.alarm(PATIENCE)
            began = time.perf_counter()
            said = outcome(path, layout)
            signal.alarm(0)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            wire.send((number, layout, kind, said, time.perf_counter() - began, peak))


def watched(first: int, count: int, folder: str) -> Iterator[tuple[Any, ...]]:
    """What came of every file, those included at which a process died or stood still."""
    context, end = get_context("spawn"), first + count
    while first < end:
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=read_many, args=(first, end - first, folder, theirs))
        process.start()
        theirs.close()
        last: tuple[Any, ...] = (first, "", "", "begun", 0.0, 0)
        try:
            while True:
                last = ours.recv()
                if last[3] != "begun":
                    yield last
        except EOFError:
            pass
        process.join()
        if last[3] != "begun":
            if last[0] + 1 < end:
                raise RuntimeError(f"the study itself ended after file {last[0]} ({process.exitcode})")
            return
        died = process.exitcode or 0
        said = "stood still" if died == -signal.SIGALRM else f"process died ({died})"
        yield (*last[:3], said, float(PATIENCE) if died == -signal.SIGALRM else 0.0, 0)
        first = last[0] + 1


def study(first: int, count: int, workers: int) -> list[tuple[Any, ...]]:
    """What came of all files, by `workers` processes at a time."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as pool:
        parts = [(k, min(BATCH, first + count - k), folder) for k in range(first, first + count, BATCH)]
        return list(itertools.chain.from_iterable(pool.map(lambda part: list(watched(*part)), parts)))


def damage_counts(found: list[tuple[Any, ...]]) -> list[str]:
    """The counts on the page."""
    kinds = sorted({row[2] for row in found})
    counts = {kind: Counter(row[3] for row in found if row[2] == kind) for kind in kinds}
    outcomes = sorted({row[3] for row in found}, key=lambda name: (name not in FINE, name))
    rows = [{"damage": kind, **{name: counts[kind][name] for name in outcomes}} for kind in kinds]
    rows.append({"damage": "all", **{name: sum(counts[kind][name] for kind in kinds) for name in outcomes}})
    times = np.array([row[4] for row in found])
    cost = (
        f"Time a file: median {1e3 * np.median(times):.1f} ms, at most {1e3 * times.max():.0f} ms. "
        f"Peak memory of a process: {max(row[5] for row in found) / 1e3:.0f} MB."
    )
    odd = [f"- file {n}, {layout}, {kind}: {said}" for n, layout, kind, said, *_ in found if said not in FINE]
    return [table(rows, ["damage", *outcomes]), cost, *["\n".join(odd)] * bool(odd)]


def main() -> int:
    """Read what was asked for; the exit code says whether anything escaped."""
    args = asked("evidence.batches.mutated_files", __doc__, count=100_000, first=0, jobs=2)
    found = study(args.first, args.count, args.jobs)
    about = ABOUT.format(command=args.command, count=len(found))
    title = "Damaged files, and what the reader makes of them"
    paged(args.output, "mutated_files", title, about, *damage_counts(found))
    return int(any(row[3] not in FINE for row in found))


if __name__ == "__main__":
    sys.exit(main())
