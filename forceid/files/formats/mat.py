"""MATLAB files: v4 to v7.2 through scipy, v7.3 through h5py. Fields of structs are named `s.markers.tip`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.channels import Channels, reading
from forceid.files.formats.mat_elements import check_elements
from forceid.records import Array

_EXPANSION = 2000  # values of one byte in a byte of the file: deflate reaches 1032
_LEFT_OUT = ("sparse", "object", "function", "opaque", "unknown")
_DEPTH = 16  # structs in structs
_ENTRIES = 100_000  # of all cells and structs


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
        if math.prod(shape) > _EXPANSION * len(data):
            what = f"declares {math.prod(shape)} values, more than the file can hold"
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
