"""Motion files in HDF5 that is netCDF-4: read with h5py; whatever a file holds, it does no harm."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from forceid.errors import DataError
from forceid.files.parse import READ, parse_recording
from forceid.files.schema import BODY, KNOWN_LOADS, MATERIAL, MOTION, TRUTH, motion_groups
from forceid.files.stored.heap import check_heaps, check_references, fingerprint
from forceid.files.stored.links import holds
from forceid.files.stored.netcdf import write_groups
from forceid.files.stored.object_header import attributes, check_texts, judge_attribute
from forceid.files.values import Stored, text
from forceid.records import Recording

_COMPRESSION_LIMIT = 2000  # deflate reaches 1032
_CHUNK = 1 << 30  # bytes that reading a single value may unpack
_NAMES = 1000  # members of a group that are looked at
DAMAGE = OSError, RuntimeError, KeyError, ValueError  # what h5py raises on damaged metadata
TABLES = {
    "body": BODY, MATERIAL: {}, "motion": MOTION, "load_known": KNOWN_LOADS, "truth": TRUTH, "estimate": {},
}  # fmt: skip


def read_motion(path: str | Path, gravity: Sequence[float] | None = None) -> Recording:
    """The recording in a motion file, SI units, checked, with the SHA-256 of the file's bytes.

    `gravity` (3,) m/s2, world axes, overrides the attribute of /motion. DataError: not a readable file of the
    contract; the message names file and variable.
    """
    return read_checked(path, stamp(path), fingerprint(path), gravity)


def read_checked(
    path: str | Path, before: tuple[int, int, int], sha256: str, gravity: Sequence[float] | None = None
) -> Recording:
    """The recording in a motion file of that fingerprint. DataError also if its stamp is not `before`."""
    with open_hdf5(path, checked=True) as f:
        recording = parse_recording(motion_file_groups(f, path), f.attrs, str(path), sha256, gravity)
    if stamp(path) != before:
        raise DataError("changed while it was read", str(path), "wait until it is complete and try again")
    return recording


def motion_file_groups(file: Any, path: str | Path) -> dict[str, Stored]:
    """The groups of a motion file that are there."""
    there = {name: table for name, table in TABLES.items() if holds(file, name, f"{path}:")}
    return {name: source_group(file, name, table, f"{path}:") for name, table in there.items()}


def write_motion(path: str | Path, recording: Recording) -> None:
    """A motion file by the contract; `path` appears whole or not at all. ConfigError: not writable."""
    write_groups(path, motion_groups(recording))


@contextmanager
def open_hdf5(path: str | Path, checked: bool = False) -> Iterator[Any]:
    """An open h5py file. DataError: missing, not HDF5, truncated, being written, or damaged where read.

    checked: whether its heaps are known to be whole.
    """
    stamp(path)
    if not checked:
        check_heaps(path)
    try:
        file = h5py.File(path, "r")
    except OSError as e:
        what, next_step = unopened(str(e))
        raise DataError(f"{what}, expected a file by the contract", str(path), next_step) from e
    with file:
        try:
            check_texts(file["/"], str(path))
            yield file
        except Exception as e:
            if not (isinstance(e, DAMAGE) or raised_by_h5py(e)):
                raise
            what = " ".join(str(e).split())
            raise DataError(f"is damaged ({what}), expected readable HDF5", str(path), "copy it again") from e


def unopened(said: str) -> tuple[str, str]:
    """What keeps a file from being opened, by what HDF5 says, and what to do."""
    if "unable to lock" in said or "already open" in said:
        return "is being written by another program", "wait until it is complete and try again"
    again = "make one with `forceid import` or copy it again"
    return ("is cut short" if "truncated" in said else "is not an HDF5 file"), again


def raised_by_h5py(error: Exception) -> bool:
    """Whether the error comes out of h5py, which damaged metadata makes raise almost anything."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace is not None and "h5py" in trace.tb_frame.f_code.co_filename


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


def source_group(file: Any, name: str, table: Iterable[str], where: str) -> Stored:
    """A group of the file with those of its variables that are known or names, each opened once.

    DataError: something in it reaches out of the file, or swells beyond what is stored.
    """
    group = guarded(file, name, where)
    if not isinstance(group, h5py.Group):
        raise DataError(
            "is a variable, expected a group", f"{where}/{name}", "see the contract of motion files"
        )
    named = (
        "node",
        "load_name",
        "known_load",
        "foot",
        *(("marker", "joint", "rotor") if name == "body" else ()),
    )
    wanted = [n for n in (*table, *named) if holds(group, n, f"{where}/{name}")]
    variables = {n: guarded(group, n, f"{where}/{name}") for n in wanted}
    return Stored(variables, attributes(group, f"{where}/{name}"), tuple(map(text, islice(group, _NAMES))))


def guarded(group: Any, name: str, where: str) -> Any:
    """A member of a group, opened, unless it lies in another file or declares more than it stores.

    Texts are read, as far as the file can hold that many.
    """
    here = f"{where}/{name}"
    holds(group, name, where)
    item = group[name]
    if isinstance(item, h5py.Datatype):
        raise DataError("is a group or a type, expected a variable", here, "rename it")
    if not isinstance(item, h5py.Dataset):
        return item
    if item.is_virtual or item.external or h5py.h5f.get_name(item.id) != h5py.h5f.get_name(group.id):
        what = "keeps its values in another file, expected the data itself"
        raise DataError(what, here, "copy the data into the file")
    check_texts(item, here)
    for attribute in READ:
        if attribute in item.attrs:
            judge_attribute(item, attribute, here)
    size = os.path.getsize(group.file.filename)
    judge_storage(item, size, here)
    if item.dtype.kind != "O" or h5py.check_ref_dtype(item.dtype) or item.ndim != 1:
        return item
    if not h5py.check_string_dtype(item.dtype):
        raise DataError("holds objects, expected numbers or text", here, "write it as float64 or as text")
    return read_texts(item, size, here)


def judge_storage(item: Any, size: int, where: str) -> None:
    """DataError: a variable that declares more than the `size` bytes of the file can hold, or is torn."""
    stored, declared = item.id.get_storage_size(), item.dtype.itemsize * math.prod(item.shape or ())
    chunk = item.dtype.itemsize * math.prod(item.chunks or ()) if declared else 0
    if max(declared, chunk) > _COMPRESSION_LIMIT * stored:
        what = f"declares {max(declared, chunk)} bytes but stores {stored}, expected all its values"
        raise DataError(what, where, "write every value, NaN for gaps")
    if stored > size:
        what = f"says that it stores {stored} bytes, expected no more than the {size} of the file"
        raise DataError(what, where, "copy it again")
    if chunk > _CHUNK:
        what = f"is stored in chunks of {chunk / 1e9:.3g} GB, expected at most {_CHUNK / 1e9:.3g} GB"
        raise DataError(what, where, "write it again in smaller chunks")
    if item.chunks and item.fletcher32 and declared:  # HDF5 reads far beyond a chunk shorter than its sum
        torn: list[int] = []
        item.id.chunk_iter(lambda part: torn.append(part.byte_offset) if part.size <= 4 else None)
        if torn:
            raise DataError(
                f"is damaged (no data at {torn[0]}), expected readable HDF5", where, "copy it again"
            )


def read_texts(item: Any, size: int, where: str) -> Any:
    """Texts (name,) of a variable: one stored in the file may be named any number of times, and is not.

    DataError: they would take more than the `size` of the file, or are not where they should be.
    """
    stored = b"".join(references(item))
    held = check_references(item.file.filename, stored, where) if stored else 0
    found, at, stride = np.empty(item.shape, object), 0, 1
    while at < len(found) and held <= size:  # where compressed, in strides that double
        stop = len(found) if stored else min(at + stride, len(found))
        found[at:stop] = item[at:stop]
        if not stored:
            held += sum(len(name) for name in found[at:stop] if isinstance(name, bytes | str))
        at, stride = stop, min(2 * stride, 4096)
    if held > size:
        raise DataError(f"holds more text than the {size} bytes of the file", where, "write it again")
    return found


def references(item: Any) -> Iterator[bytes]:
    """The references to texts as stored: length, address and index in 16 bytes; none where compressed."""
    if item.dtype.itemsize and item.id.get_create_plist().get_nfilters() == 0:
        if item.chunks is None and (offset := item.id.get_offset()) is not None:
            with open(item.file.filename, "rb") as f:
                f.seek(offset)
                yield f.read(16 * item.size)
        elif item.chunks is not None:
            for k in range(item.id.get_num_chunks()):
                yield item.id.read_direct_chunk(item.id.get_chunk_info(k).chunk_offset)[1]
