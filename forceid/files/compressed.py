"""Compressed rows or columns as stored, by scipy in .npz or in a group of HDF5: judged before they are used.

Scipy trusts indices, and would reach beyond its arrays by wrong ones.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.sparse as sp

from forceid.errors import DataError
from forceid.files.hdf5 import guarded
from forceid.files.parse import memory_limit, read_real, text
from forceid.files.schema import Variable

SPARSEST = 1000  # rows an entry; a shape that declares more, and above a million, is not what is stored
SWELL = 2000  # times that stored bytes may grow; deflate reaches 1032
LAYOUT = ("format", "encoding-type", "h5sparse_format")  # attributes that tell rows from columns


def affordable(shape: tuple[int, ...], entries: int, where: str) -> None:
    """DataError where a declared shape is not one that so many entries have, or does not fit in memory."""
    need = 8 * sum(shape) + 32 * entries
    if need > memory_limit() or max(shape) > max(10**6, SPARSEST * entries):
        what = f"declares shape {shape} for {entries} entries, expected a shape that they fill"
        raise DataError(what, where, "write it again with the size of what is stored")


def read_npz(path: str) -> Any:
    """What scipy.sparse.save_npz wrote. Raises DataError, and what numpy and scipy raise on damaged files."""
    with zipfile.ZipFile(path) as file:
        names = {name.removesuffix(".npy") for name in file.namelist()}
        swollen = sum(item.file_size for item in file.infolist())
    if not {"format", "shape", "data"} <= names:
        what = f"holds {sorted(names)}, expected what scipy.sparse.save_npz writes"
        raise DataError(what, path, "save the sparse matrix itself")
    if swollen > min(SWELL * Path(path).stat().st_size, memory_limit()):
        raise DataError(f"declares {swollen / 1e9:.3g} GB, expected what it stores", path, "write it again")
    found = sp.load_npz(path)
    affordable(found.shape, found.nnz, path)
    if hasattr(found, "check_format"):
        found.check_format(full_check=True)
    return found


def read_group(group: Any, where: str) -> Any:
    """The matrix of data, indices, indptr, and shape, a variable or an attribute; by rows if not said csc."""
    if lacking := [name for name in ("data", "indices", "indptr") if name not in group]:
        what = f"lacks {lacking[0]}, expected data, indices, indptr and shape"
        raise DataError(what, where, f"found {list(map(str, group))[:20]}")
    data = read_real(variable(group, "data", where), Variable(("entry",), "", ""), {}, f"{where}/data")
    indices, indptr = (whole_numbers(group, name, where) for name in ("indices", "indptr"))
    rows, columns = shape_of(group, where)
    affordable((rows, columns), len(data), where)
    layout = " ".join(text(group.attrs[key]) for key in LAYOUT if key in group.attrs).lower()
    kind, ends = (sp.csc_array, columns) if "csc" in layout else (sp.csr_array, rows)
    if len(indptr) != ends + 1:
        what = f"has shape ({rows}, {columns}) and {len(indptr)} entries of indptr, expected {ends + 1}"
        raise DataError(what, where, "correct shape, or set the attribute format to csr or csc")
    try:
        found = kind((data, indices, indptr), shape=(rows, columns))
        found.check_format(full_check=True)
    except ValueError as e:
        what = f"makes no matrix of shape ({rows}, {columns}): {e}"
        raise DataError(what, where, "write it again") from e
    return found


def shape_of(group: Any, where: str) -> tuple[int, int]:
    """The shape that the group tells."""
    if "shape" in group:
        found = whole_numbers(group, "shape", where)
    else:
        told = [group.attrs[name] for name in ("shape", "h5sparse_shape") if name in group.attrs]
        if not told:
            raise DataError("lacks shape, expected two whole numbers", where, "add it as an attribute")
        found = np.asarray(told[0])
    if found.shape != (2,) or found.dtype.kind not in "iu" or (found < 0).any():
        raise DataError(f"has shape {found.tolist()}, expected two whole numbers", where, "correct it")
    return int(found[0]), int(found[1])


def variable(group: Any, name: str, where: str) -> Any:
    """A variable of a group, opened and not read."""
    found = guarded(group, name, where)
    if not isinstance(found, h5py.Dataset):
        raise DataError("is a group or a type, expected a variable", f"{where}/{name}", "rename it")
    return found


def whole_numbers(group: Any, name: str, where: str) -> Any:
    """A variable of whole numbers, in one dimension."""
    found, here = variable(group, name, where), f"{where}/{name}"
    if found.dtype.kind not in "iu" or len(found.shape or ()) != 1:
        raise DataError("is not whole numbers in one dimension, as expected", here, "write it as int64")
    if 8 * found.size > memory_limit():
        raise DataError(f"declares {found.size} entries, expected fewer here", here, "write it again")
    return found[...].astype(np.int64)
