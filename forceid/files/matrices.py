"""Stiffness and mass as another program wrote them: Matrix Market, scipy, numpy, HDF5.

A finite-element code of the user's is the source of K and M; here they become sparse rows, and what is not a
matrix of finite real numbers is told in one line. Source: principal equations 2.7.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.sparse as sp

from forceid.errors import DataError
from forceid.files.compressed import read_group, read_npz, variable
from forceid.files.hdf5 import guarded, open_hdf5
from forceid.files.matrix_market import read_market
from forceid.files.parse import kind_of, memory_limit, nearest, read_real, text, unpack
from forceid.files.schema import BODY, Variable
from forceid.files.units import si_factor

FORMS = ".mtx, .mtx.gz, .npz, .npy, or file.h5:/group/name"


def read_matrix(source: str | Path, square: bool = True) -> Any:
    """A matrix of a file as scipy.sparse.csr_array of float64; entries that repeat are added.

    source: Matrix Market (.mtx, .mtx.gz), a sparse matrix of scipy (.npz), an array of numpy (.npy), or
    file.h5:/body/stiffness, a dense variable or a group of data, indices, indptr and shape (by rows, unless
    its attribute format or encoding-type says csc). square: a stiffness or a mass is asked for, so that one
    triangle alone is an error too. Values are as stored, SI by contract; variables of /body with units are
    converted. Raises DataError.

    >>> import scipy.io, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     scipy.io.mmwrite(f"{folder}/K.mtx", sp.coo_array([[2.0, -1.0], [-1.0, 2.0]]))
    ...     K = read_matrix(f"{folder}/K.mtx")
    >>> K.toarray().tolist()
    [[2.0, -1.0], [-1.0, 2.0]]
    """
    path, inside = parted(str(source))
    if not Path(path).is_file():
        how = "not a file" if Path(path).exists() else "no such file"
        raise DataError(f"cannot be read ({how})", path, f"give the path of a matrix: {FORMS}")
    found = from_hdf5(path, inside) if inside else from_file(path)
    return checked(found, f"{path}:{inside}" if inside else path, square)


def parted(source: str) -> tuple[str, str]:
    """Path of the file, and the place inside it, empty where none is named."""
    path, mark, inside = source.rpartition(":/")
    if not mark or "." not in Path(path).name or Path(source).is_file():
        return source, ""
    return path, f"/{inside}"


def from_file(path: str) -> Any:
    """The sparse matrix or the array of a file, by how its name ends."""
    readers: dict[str, Callable[[str], Any]] = {
        ".mtx": read_market,
        ".mtx.gz": read_market,
        ".npz": read_npz,
        ".npy": read_npy,
    }
    reader = next((read for end, read in readers.items() if path.lower().endswith(end)), None)
    if reader is None and h5py.is_hdf5(path):
        raise DataError("is HDF5, expected the place of a matrix in it", path, f"give {path}:/body/stiffness")
    if reader is None:
        raise DataError(f"ends in {Path(path).suffix!r}, expected {FORMS}", path, "convert it first")
    try:
        return reader(path)
    except DataError:
        raise
    except Exception as e:  # on damaged files numpy, scipy, gzip and zipfile raise whatever they meet
        if "Object arrays" in str(e) or "Python objects" in str(e):
            raise DataError("holds objects, expected real numbers", path, "write it as float64") from e
        what = " ".join(str(e).split())[:150] or type(e).__name__
        next_step = "write or copy it again"
        raise DataError(f"cannot be read ({what}), expected a whole matrix", path, next_step) from e


def read_npy(path: str) -> Any:
    """A dense array; it is mapped first, so that a shape beyond the file is found without memory."""
    found = np.load(path, mmap_mode="r", allow_pickle=False)
    if 8 * found.size > memory_limit():
        raise DataError(f"holds {8e-9 * found.size:.3g} GB, expected less here", path, "save it sparse, .npz")
    return found


def from_hdf5(path: str, inside: str) -> Any:
    """A dense variable, or a group of compressed rows or columns."""
    parts = [part for part in inside.split("/") if part not in ("", ".")]
    with open_hdf5(path) as file:
        item, where, name = file, f"{path}:", ""
        for name in parts:
            if not isinstance(item, h5py.Group) or name not in item:
                known = [repr(str(key))[1:-1] for key in item][:20] if isinstance(item, h5py.Group) else []
                raise DataError("is missing, expected a matrix", f"{where}/{name}", nearest(name, known))
            above, item, where = item, guarded(item, name, where), f"{where}/{name}"
        attrs = {key: item.attrs[key] for key in ("units", "_FillValue") if key in item.attrs}
        if isinstance(item, h5py.Group):
            found = read_group(item, where)
        else:
            stored = variable(above, name, where.removesuffix(f"/{name}"))
            found = unpack(read_real(stored, Variable(("row", "column"), "", ""), {}, where), attrs, where)
    if name in BODY and "units" in attrs:
        found = found * si_factor(text(attrs["units"]), BODY[name].units, where)
    return found


def checked(found: Any, where: str, square: bool) -> Any:
    """Sparse rows of finite real numbers; square, and both triangles, where these are asked for."""
    if found.dtype.kind not in "fiu":
        raise DataError(f"holds {kind_of(found.dtype)}, expected real numbers", where, "write it as float64")
    if found.ndim != 2 or 0 in found.shape:
        raise DataError(
            f"has shape {found.shape}, expected rows and columns", where, "save the matrix itself"
        )
    K = sp.csr_array(found).astype(np.float64)
    K.sum_duplicates()
    if len(bad := np.flatnonzero(~np.isfinite(K.data))):
        row = int(np.searchsorted(K.indptr, bad[0], side="right")) - 1
        what = f"holds {len(bad)} numbers that are not finite, the first in row {row}, expected none"
        raise DataError(what, where, "look at the element that makes it")
    if not square:
        return K
    if K.shape[0] != K.shape[1]:
        next_step = "give the stiffness or mass of all degrees of freedom"
        raise DataError(f"has shape {K.shape}, expected a square matrix", where, next_step)
    above, below = (abs(half).sum() for half in (sp.triu(K, 1), sp.tril(K, -1)))
    if (above == 0) != (below == 0):
        side = "upper" if below == 0 else "lower"
        what = f"holds the {side} triangle alone, expected both"
        raise DataError(what, where, "add the other triangle, or declare the matrix symmetric")
    return K
