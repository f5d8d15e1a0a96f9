"""Motion files in HDF5 that is netCDF-4: read with h5py, written with h5netcdf."""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from forceid.errors import DataError
from forceid.files.atomic import atomic
from forceid.files.parse import Source, parse_recording
from forceid.files.schema import BODY, MOTION, TRUTH, Group, motion_groups
from forceid.records import Recording

_COMPRESSION_LIMIT = 2000  # deflate reaches 1032
_TABLES = {"body": BODY, "motion": MOTION, "truth": TRUTH, "estimate": {}}


def read_motion(path: str | Path, gravity: Sequence[float] | None = None) -> Recording:
    """The recording in a motion file, SI units, checked, with the SHA-256 of the file's bytes.

    `gravity` (3,) m/s2, world axes, overrides the attribute of /motion. DataError: not a readable file of the
    contract; the message names file and variable.
    """
    before = stamp(path)
    with open(path, "rb") as f:
        sha256 = hashlib.file_digest(f, "sha256").hexdigest()
    with open_hdf5(path) as f:
        groups = {
            name: source_group(f, name, tables, f"{path}:") for name, tables in _TABLES.items() if name in f
        }
        recording = parse_recording(groups, f.attrs, str(path), sha256, gravity)
    if stamp(path) != before:
        raise DataError("changed while it was read", str(path), "wait until it is complete and try again")
    return recording


def write_motion(path: str | Path, recording: Recording) -> None:
    """A motion file by the contract; `path` appears whole or not at all. ConfigError: not writable."""
    write_groups(path, motion_groups(recording))


def write_groups(path: str | Path, groups: Mapping[str, Group]) -> None:
    """Groups as netCDF-4: dimension scales, attributes, text as UTF-8 strings."""
    import h5netcdf  # type: ignore[import-untyped]  # only those who write pay for it

    with atomic(path) as partial, h5netcdf.File(partial, "w") as f:
        for name, group in groups.items():
            node = f if name == "/" else f.create_group(name)
            node.attrs.update(group.attrs)
            for key, item in group.variables.items():
                for dim, n in zip(item.dims, item.data.shape, strict=True):
                    if dim not in node.dimensions:
                        node.dimensions[dim] = n
                if item.data.dtype.kind == "U":
                    variable = node.create_variable(key, item.dims, h5py.string_dtype())
                    variable[...] = item.data.astype(object)
                else:
                    variable = node.create_variable(key, item.dims, data=item.data)
                variable.attrs.update(item.attrs)


@contextmanager
def open_hdf5(path: str | Path) -> Iterator[Any]:
    """An open h5py file. DataError: missing, not HDF5, truncated, or damaged where it is read."""
    stamp(path)
    try:
        file = h5py.File(path, "r")
    except OSError as e:
        what = "is cut short" if "truncated" in str(e) else "is not an HDF5 file"
        next_step = "make one with `forceid import` or copy it again"
        raise DataError(f"{what}, expected a file by the contract", str(path), next_step) from e
    with file:
        try:
            yield file
        except (OSError, RuntimeError, KeyError, ValueError) as e:  # what h5py raises on damaged metadata
            what = " ".join(str(e).split())
            raise DataError(f"is damaged ({what}), expected readable HDF5", str(path), "copy it again") from e


def stamp(path: str | Path) -> tuple[int, int, int]:
    """What changes when a file does: inode, size and time of the last write. DataError: no such file."""
    try:
        if not Path(path).is_file():
            raise FileNotFoundError(2, os.strerror(2) if not Path(path).exists() else "not a file")
        if not os.access(path, os.R_OK):
            raise PermissionError(13, os.strerror(13))
        status = os.stat(path)
    except OSError as e:
        raise DataError(f"cannot be read ({e.strerror})", str(path), "give the path of a motion file") from e
    return status.st_ino, status.st_size, status.st_mtime_ns


def source_group(file: Any, name: str, table: Iterable[str], where: str) -> Source:
    """A group of the file with those of its variables that are known or names, each opened once.

    DataError: something in it reaches out of the file, or swells beyond what is stored.
    """
    group = guarded(file, name, where)
    if not isinstance(group, h5py.Group):
        raise DataError(
            "is a variable, expected a group", f"{where}/{name}", "see the contract of motion files"
        )
    wanted = [n for n in (*table, "node", "load_name") if n in group]
    return Source({n: guarded(group, n, f"{where}/{name}") for n in wanted}, dict(group.attrs), tuple(group))


def guarded(group: Any, name: str, where: str) -> Any:
    """A member of a group, opened, unless it lies in another file or declares more than it stores."""
    if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
        what = "is a link to another file, expected the data itself"
        raise DataError(what, f"{where}/{name}", "copy the data into the file")
    item = group[name]
    if not isinstance(item, h5py.Dataset) or item.dtype.kind == "O":
        return item
    if item.is_virtual or item.external:
        what = "keeps its values in another file, expected the data itself"
        raise DataError(what, f"{where}/{name}", "copy the data into the file")
    stored, declared = item.id.get_storage_size(), item.dtype.itemsize * math.prod(item.shape or ())
    if declared > _COMPRESSION_LIMIT * stored:
        what = f"declares {declared} bytes but stores {stored}, expected all its values"
        raise DataError(what, f"{where}/{name}", "write every value, NaN for gaps")
    return item
