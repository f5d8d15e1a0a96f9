"""W6: motion files of 5 MB, read one after the other; they lie in the page cache for everyone."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from evidence.races.paired import Goal, Race, RaceAnswer, Racer
from forceid.files.stored.hdf5 import read_motion, write_motion
from forceid.records import Body, Motion, Recording

FRAMES, NODES = 2083, 100  # 5 MB of positions


def races(quick: bool) -> Iterator[Race]:
    count = 10 if quick else 40
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{i:03d}.h5" for i in range(count)]
        rng = np.random.default_rng(0)
        for path in paths:
            write_motion(path, random_recording(rng))
        yield Race(
            title=f"W6 {count} files of 5 MB",
            contestants=[
                reader("forceid", paths, read_ours),
                reader("xarray + h5netcdf, two groups", paths, read_groups),
                reader("xarray + h5netcdf, DataTree", paths, read_tree),
                reader("h5py, arrays only", paths, read_h5py),
            ],
            base="xarray + h5netcdf, two groups",
            size=count,
            check=2,
            goals=[Goal("forceid", "xarray + h5netcdf, two groups", 4)],
            unit="file",
            clock="ms",
        )


def random_recording(rng: np.random.Generator) -> Recording:
    X = rng.standard_normal((NODES, 3))
    body = Body(node=tuple(f"n{i}" for i in range(NODES)), position=X, mass=np.ones(NODES))
    x = X + 0.01 * rng.standard_normal((FRAMES, NODES, 3))
    return Recording(body, Motion(time=1e-3 * np.arange(FRAMES), position=x))


def reader(name: str, paths: list[Path], read: Callable[[Path], RaceAnswer]) -> Racer:
    def prepare(size: int):
        return lambda: [read(path) for path in paths[:size]][-1]

    return Racer(name, prepare, lambda found: found)


def read_ours(path: Path) -> RaceAnswer:
    """Everything a motion file holds, checked, and the SHA-256 of its bytes."""
    found = read_motion(path)
    return answer_by_name(found.motion.time, found.motion.position, found.body.position, found.body.mass)


def read_groups(path: Path) -> RaceAnswer:
    import xarray as xr

    motion = xr.load_dataset(path, group="motion", engine="h5netcdf")
    body = xr.load_dataset(path, group="body", engine="h5netcdf")
    return answer_by_name(motion.time, motion.position, body.position, body.mass)


def read_tree(path: Path) -> RaceAnswer:
    import xarray as xr

    with xr.open_datatree(path, engine="h5netcdf") as tree:
        motion, body = tree["motion"].load(), tree["body"].load()
        return answer_by_name(motion["time"], motion["position"], body["position"], body["mass"])


def read_h5py(path: Path) -> RaceAnswer:
    """No attribute, no check: what h5py itself takes."""
    import h5py

    names = ("motion/time", "motion/position", "body/position", "body/mass")
    with h5py.File(path, "r") as f:
        return answer_by_name(*(f[name][...] for name in names))


def answer_by_name(*arrays: Any) -> RaceAnswer:
    return dict(zip(("time", "position", "shape", "mass"), map(np.asarray, arrays), strict=True))
