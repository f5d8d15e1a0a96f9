"""MATLAB files: v4 to v7.2 through scipy, v7.3 through h5py. Fields of structs are named `s.markers.tip`.

The elements of v5 to v7.2, one in another, are checked before scipy reads, which crashes on others. Source:
MATLAB, MAT-File Format, chapter 1: data types (table 1-1), array types (table 1-3), small elements.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.channels import Channels, reading
from forceid.memory import memory_limit
from forceid.records import Array

_EXPANSION = 2000  # values of one byte in a byte of the file: deflate reaches 1032
_LEFT_OUT = ("sparse", "object", "function", "opaque", "unknown")
_ORDERED = {  # what MATLAB writes, axes in reverse; in a file of another program they may not be
    *(f"{sign}int{bits}".encode() for sign in ("", "u") for bits in (8, 16, 32, 64)),
    b"double", b"single", b"logical", b"char",
}  # fmt: skip
_DEPTH = 16  # structs in structs
_ENTRIES = 100_000  # of all cells and structs
_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}  # of a number, by data type
_TEXT = (16, 17, 18)
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
_CELL, _STRUCT, _CHAR, _SPARSE, _INT64 = 1, 2, 4, 5, 15
_COMPLEX = 0x0800
_NESTED = 32
Element = tuple[int, memoryview]


def read_mat(path: str | Path) -> Channels:
    """Numeric variables and fields of a MAT file, and its texts as labels. DataError: not a whole MAT file.

    `s(2).x` and `c{2}` count from one as in MATLAB. Sparse and complex variables, tables and objects are
    left out. MATLAB keeps no units: values are SI unless the settings say otherwise.
    """
    import h5py

    values: dict[str, Array] = {}
    label: dict[str, tuple[str, ...]] = {}
    with reading(path, "MAT"):
        if h5py.is_hdf5(path):
            with h5py.File(path, "r") as f:
                for name in f:
                    if not name.startswith("#"):  # what MATLAB refers to from cells
                        flatten(name, stored(f, name, f"{path}:"), values, label)
        else:
            for name, value in load(path).items():
                flatten(name, value, values, label)
    return Channels(str(path), "variable", values, label=label)


def load(path: str | Path) -> dict[str, Any]:
    """The variables of a file up to v7.2, structs as dictionaries. DataError: one too large for the file."""
    from scipy.io import loadmat, matlab, whosmat

    data = Path(path).read_bytes()
    if matlab.matfile_version(str(path))[0] == 1:  # v5 to v7.2
        check_elements(data, str(path))
    wanted = []
    for name, shape, kind in whosmat(path):
        if kind in _LEFT_OUT:
            continue
        if math.prod(shape) > min(_EXPANSION * len(data), memory_limit() // 8):
            what = f"declares {math.prod(shape)} values, more than the file can hold, or fit here"
            raise DataError(what, f"{path}:{' '.join(name.split())}", "export or copy it again")
        wanted.append(name)
    found = loadmat(path, simplify_cells=True, variable_names=wanted) if wanted else {}
    return {name: value for name, value in found.items() if not name.startswith("__")}


def stored(group: Any, name: str, where: str, depth: int = 0) -> Any:
    """A member of a v7.3 file as `load` gives it: structs as dictionaries, cells as lists, axes in order."""
    import h5py

    from forceid.files.stored.hdf5 import guarded

    if depth > _DEPTH:
        raise DataError(f"nests structs more than {_DEPTH} deep", f"{where}/{name}", "export what is needed")
    item = guarded(group, name, where)
    if isinstance(item, h5py.Group):
        # by the alphabet: the order of MATLAB is in an attribute that crashes HDF5 where it is damaged
        return {key: stored(item, key, f"{where}/{name}", depth + 1) for key in item}
    kind = class_of(item)
    if "MATLAB_empty" in item.attrs:
        return "" if kind == b"char" else np.zeros(0)
    if item.dtype == h5py.ref_dtype:
        if item.size > _ENTRIES:
            what = f"holds {item.size} cells, expected at most {_ENTRIES}"
            raise DataError(what, f"{where}/{name}", "export numbers as arrays")
        names = [item.file[reference].name for reference in item[()].T.ravel()]
        return [stored(item.file, target, where, depth + 1) for target in names]
    if item.dtype.kind not in "biufc":
        return None
    if item.ndim > 1 and kind not in _ORDERED:
        what = (
            "does not say that MATLAB wrote it (attribute MATLAB_class): the order of its axes is not known"
        )
        raise DataError(what, f"{where}/{name}", "save it with MATLAB -v7.3, or with scipy.io.savemat")
    data = np.asarray(item[()]).T
    if kind == b"char":
        return "".join(map(chr, data.astype(int).ravel(order="F" if data.shape[0] == 1 else "C")))
    return np.squeeze(data)


def class_of(item: Any) -> bytes:
    """What MATLAB says a variable of a v7.3 file is, a short text of fixed length."""
    import h5py

    if "MATLAB_class" not in item.attrs:
        return b""
    declared = h5py.h5a.open(item.id, b"MATLAB_class")
    return bytes(item.attrs["MATLAB_class"]) if declared.dtype.kind == "S" and not declared.shape else b""


def flatten(name: str, value: Any, values: dict[str, Array], label: dict[str, tuple[str, ...]]) -> None:
    """Put a variable into `values`, or its texts into `label`, each by its full name."""
    if len(values) + len(label) > _ENTRIES:
        raise DataError(f"holds more than {_ENTRIES} fields", name, "export numbers as arrays")
    if isinstance(value, Mapping):
        for key, entry in value.items():
            flatten(f"{name}.{key}", entry, values, label)
    elif isinstance(value, str):
        label[name] = (value.strip(),)
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype.kind in "OU"):
        entries = np.asarray(value, object).ravel(order="F") if isinstance(value, np.ndarray) else value
        if len(entries) and all(isinstance(entry, str) for entry in entries):
            label[name] = tuple(str(entry).strip() for entry in entries)
            return
        for k, entry in enumerate(entries, 1):
            mark = f"({k})" if isinstance(entry, Mapping) else f"{{{k}}}"
            flatten(f"{name}{mark}", entry, values, label)
    elif isinstance(value, (np.ndarray, np.generic, int, float)):
        data = np.asarray(value)
        if data.dtype.kind in "biuf" and data.size:
            values[name] = np.atleast_1d(data.astype(float))


def check_elements(data: bytes, where: str) -> None:
    """DataError unless every array of numbers, text, cells and structs is made as the format says.

    Objects and functions are not looked into: they are not to be read.
    """
    order = "<" if data[126:128] == b"IM" else ">"
    for kind, content in elements(memoryview(data)[128:], order, where):
        if kind == _COMPRESSED:
            content = memoryview(inflated(content, len(data), where))
            inner = list(elements(content, order, where))
            if len(inner) != 1:
                raise damaged("a compressed part that is not one variable", where)
            kind, content = inner[0]
        if kind != _MATRIX:
            raise damaged(f"an element of type {kind} in place of a variable", where)
        check_array(content, order, where, 0)


def inflated(packed: memoryview, size: int, where: str) -> bytes:
    """A compressed part of a file of that size, unpacked; a DataError where it is more than fits."""
    room = min(_EXPANSION * size, memory_limit())
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(packed, room)
    if not unpacker.eof:
        what = "ends before it is whole" if len(data) < room else f"unpacks to more than {room / 1e6:.3g} MB"
        raise DataError(f"is damaged: a compressed part {what}", where, "export or copy it again")
    return data


def elements(data: memoryview, order: str, where: str) -> Iterator[Element]:
    """Type and content of the elements that follow one another."""
    start = 0
    while start < len(data):
        if len(data) - start < 8:
            raise damaged(f"{len(data) - start} bytes too many", where)
        kind, size = struct.unpack_from(f"{order}II", data, start)
        begin, room = start + 8, len(data) - start - 8
        if kind >> 16:  # type, size and at most four bytes in one tag
            kind, size, begin, room = kind & 0xFFFF, kind >> 16, start + 4, 4
        if size > room:
            raise damaged(f"an element of {size} bytes where {room} are left", where)
        yield kind, data[begin : begin + size]
        start = begin + size if kind == _COMPRESSED else start + 8 + (size + 7 if room > 4 else 0) // 8 * 8


def check_array(content: memoryview, order: str, where: str, depth: int) -> None:
    """DataError unless flags, dimensions and name are there, and what the class of the array asks for."""
    if not len(content):
        return  # an empty cell
    parts = list(elements(content, order, where))
    kinds = [kind for kind, _ in parts]
    if kinds[0] != _UINT32 or len(parts[0][1]) != 8:
        raise damaged("an array without flags", where)
    flags = struct.unpack_from(f"{order}I", parts[0][1])[0]
    kind = flags & 0xFF
    if depth and not 0 < kind <= _INT64:
        raise damaged(f"an array of class {kind} in another", where)
    if kind > _INT64 or kind == 3:
        return
    if kinds[1:3] != [_INT32, _INT8] or len(parts[1][1]) % 4:
        raise damaged("an array without dimensions and name", where)
    dims = struct.unpack(f"{order}{len(parts[1][1]) // 4}i", parts[1][1])
    if len(dims) < 2 or min(dims) < 0:
        raise damaged(f"an array of dimensions {dims}", where)
    count, rest = math.prod(dims), parts[3:]
    if kind in (_CELL, _STRUCT):
        fields = fields_of(rest, order, where) if kind == _STRUCT else 1
        rest = rest[2:] if kind == _STRUCT else rest
        if [k for k, _ in rest] != [_MATRIX] * (fields * count) or depth > _NESTED:
            raise damaged(f"{len(rest)} arrays in a class of {fields * count}, or too deep", where)
        for _, inner in rest:
            check_array(inner, order, where, depth + 1)
    elif kind == _SPARSE:
        sizes = [_BYTES.get(k, 0) for k, _ in rest]
        if len(rest) != (4 if flags & _COMPLEX else 3) or not all(sizes):
            raise damaged("a sparse array without its indices", where)
    else:
        wanted = 2 if flags & _COMPLEX and kind != _CHAR else 1
        if len(rest) != wanted or not all(has_count(part, count, kind) for part in rest):
            raise damaged(f"an array that is not made of {wanted} times {count} numbers", where)


def fields_of(rest: list[Element], order: str, where: str) -> int:
    """How many fields a struct has."""
    if [k for k, _ in rest[:2]] != [_INT32, _INT8] or len(rest[0][1]) != 4:
        raise damaged("a struct without field names", where)
    width = int(struct.unpack(f"{order}i", rest[0][1])[0])
    if width < 1 or len(rest[1][1]) % width:
        raise damaged(f"field names of {width} letters", where)
    return len(rest[1][1]) // width


def has_count(part: Element, count: int, kind: int) -> bool:
    """Whether a part holds as many numbers, or letters, as the dimensions say."""
    if kind == _CHAR:
        return (part[0] in _TEXT or part[0] in (2, 4) or not count) and count <= len(part[1])
    size = _BYTES.get(part[0], 0)
    return size > 0 and len(part[1]) == size * count


def damaged(what: str, where: str) -> DataError:
    """What is wrong in the file, in one line."""
    return DataError(f"holds {what}, which no whole MAT file does", where, "export or copy it again")
