"""Stiffness and mass as another program wrote them: Matrix Market, scipy, numpy, HDF5.

A finite-element code of the user's is the source of K and M; here they become sparse rows, and what is not a
matrix of finite real numbers is told in one line. Matrix Market is not read by scipy.io.mmread, which takes
the interpreter down on a file that ends inside a number (scipy issue 19949). Source: principal equations 2.7;
Boisvert, Pozo, Remington, The Matrix Market exchange formats: initial design (NISTIR 5935, 1996).
"""

from __future__ import annotations

import gzip
import io
import warnings
import zipfile
from collections.abc import Callable
from functools import partial
from operator import index
from pathlib import Path
from typing import Any, TextIO

import h5py
import numpy as np
import scipy.sparse as sp

from forceid.errors import DataError
from forceid.files.schema import BODY
from forceid.files.stored.hdf5 import guarded, open_hdf5
from forceid.files.units import si_factor
from forceid.files.values import kind_of, likeliest_name, read_real, text, unpack
from forceid.memory import memory_limit
from forceid.records import Variable

FORMS = ".mtx, .mtx.gz, .npz, .npy, or file.h5:/group/name"
BANNER = "%%MatrixMarket matrix coordinate real symmetric"
REAL = ("real", "double", "integer", "unsigned-integer")
SIGNS = {"general": 0.0, "symmetric": 1.0, "hermitian": 1.0, "skew-symmetric": -1.0}  # of mirrored entries
SWELLS = 100  # times its size that a packed text may be: texts of numbers pack to a third, of zeros to 40
SPARSEST = 1000  # rows an entry; a shape that declares more, and above a million, is not what is stored
LISTS = ("data", "indices", "indptr")  # of compressed rows
DENSE = Variable(("row", "column"), "", "")


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
    path, mark, inside = str(source).rpartition(":/")
    if not mark or "." not in Path(path).name or Path(source).is_file():
        path, inside = str(source), ""
    if not Path(path).is_file():
        how = "not a file" if Path(path).exists() else "no such file"
        raise DataError(f"cannot be read ({how})", path, f"give the path of a matrix: {FORMS}")
    try:
        found = from_hdf5(path, inside) if mark and inside else from_file(path)
        return validated_matrix(found, f"{path}:/{inside}" if inside else path, square)
    except DataError:
        raise
    except Exception as e:  # on damaged files numpy, scipy, gzip and zipfile raise whatever they meet
        what = " ".join(str(e).split())[:150] or type(e).__name__
        next_step = "write or copy it again"
        raise DataError(f"cannot be read ({what}), expected a whole matrix", path, next_step) from e


def from_file(path: str) -> Any:
    """The sparse matrix or the array of a file, by how its name ends."""
    readers: dict[str, Callable[[str], Any]] = {
        ".mtx": read_market, ".mtx.gz": read_market, ".npz": read_npz,
        # mapped first, so that a shape beyond the file is found without memory
        ".npy": partial(np.load, mmap_mode="r", allow_pickle=False),
    }  # fmt: skip
    reader = next((read for end, read in readers.items() if path.lower().endswith(end)), None)
    if reader is None and h5py.is_hdf5(path):
        raise DataError("is HDF5, expected the place of a matrix in it", path, f"give {path}:/body/stiffness")
    if reader is None:
        raise DataError(f"ends in {Path(path).suffix!r}, expected {FORMS}", path, "convert it first")
    return reader(path)


def read_npz(path: str) -> Any:
    """What scipy.sparse.save_npz wrote."""
    with open(path, "rb") as file, zipfile.ZipFile(file) as packed:
        size = sum(item.file_size for item in packed.infolist())
        if size > memory_limit():
            raise DataError(f"declares {size / 1e9:.3g} GB, expected less here", path, "write it again")
        return sp.load_npz(file)


def unpacked(path: str) -> TextIO:
    """The text of a packed file; DataError: it swells beyond what texts of numbers do, or does not fit."""
    room = min(SWELLS * Path(path).stat().st_size, memory_limit() // 2)
    with gzip.open(path) as file:
        data = file.read(room + 1)
    if len(data) > room:
        what = f"unpacks to more than {room / 1e6:.3g} MB, expected a text of numbers"
        raise DataError(what, path, "unpack it first")
    return io.StringIO(data.decode("latin-1"))


def read_market(path: str) -> Any:
    """The matrix of a .mtx or .mtx.gz file; what a symmetric one leaves out is filled in."""
    packed = path.lower().endswith(".gz")
    with unpacked(path) if packed else open(path, encoding="latin-1") as file:  # comments in any language
        first = line = file.readline(4096)
        words = first.lower().split()
        known = len(words) == 5 and words[2] in ("coordinate", "array") and words[4] in SIGNS
        if not known or words[0] != "%%matrixmarket" or words[3] not in REAL:
            raise DataError(f"begins with {first[:60].strip()!r}, expected {BANNER!r}", path, "convert it")
        while line.startswith("%") or line.isspace():
            line = file.readline(4096)
        size, listed, sign = [int(n) for n in line.split()], words[2] == "coordinate", SIGNS[words[4]]
        if len(size) != 2 + listed or min(size) < 0:
            raise DataError(f"has the size line {line[:60].strip()!r}", path, "write or copy it again")
        with warnings.catch_warnings(action="ignore"):  # numpy warns of a body that is empty
            values = np.loadtxt(file, comments="%", ndmin=2).reshape(-1, 2 * listed + 1)
    n, m = size[:2]
    full = n * m if not sign else n * (n + 1) // 2 if sign > 0 else n * (n - 1) // 2
    if len(values) != (size[2] if listed else full) or (sign and n != m):
        what = f"holds {len(values)} entries, expected {words[4]} ones, {line.strip()}"
        raise DataError(what, path, "write or copy it again")
    affordable((n, m), len(values), path)
    if listed:
        row, column = (values[:, :2] - 1).T.astype(np.intp)
        if (values[:, 0] != row + 1).any() or (values[:, 1] != column + 1).any():
            raise DataError("has an entry between two rows or columns", path, "write or copy it again")
    else:  # by columns, of the lower triangle where there is a symmetry
        column, row = np.triu_indices(n, int(sign < 0)) if sign else np.indices((m, n)).reshape(2, -1)
    value = values[:, -1]
    if sign:
        if (row < column).any() and (row > column).any():
            what = f"is declared {words[4]} but holds both triangles, expected the lower one"
            raise DataError(what, path, "declare it general")
        beside = row != column
        row, column = np.r_[row, column[beside]], np.r_[column, row[beside]]
        value = np.r_[value, sign * value[beside]]
    return sp.coo_array((value, (row, column)), shape=(n, m))


def from_hdf5(path: str, inside: str) -> Any:
    """A dense variable, or a group of compressed rows or columns."""
    with open_hdf5(path) as file:
        item, where, name = file, f"{path}:", ""
        for name in [part for part in inside.split("/") if part not in ("", ".")]:
            if not isinstance(item, h5py.Group) or name not in item:
                known = [repr(str(key))[1:-1] for key in item][:20] if isinstance(item, h5py.Group) else []
                raise DataError(
                    "is missing, expected a matrix", f"{where}/{name}", likeliest_name(name, known)
                )
            item, where = guarded(item, name, where), f"{where}/{name}"
        attrs = {key: item.attrs[key] for key in ("units", "_FillValue") if key in item.attrs}
        if isinstance(item, h5py.Group):
            found = read_group(item, where)
        else:
            found = unpack(read_real(item, DENSE, {}, where), attrs, where)
    if name in BODY and "units" in attrs:
        found = found * si_factor(text(attrs["units"]), BODY[name].units, where)
    return found


def read_group(group: Any, where: str) -> Any:
    """The matrix of data, indices, indptr, and shape, a variable or an attribute; by rows if not said csc."""
    lists = {name: guarded(group, name, where)[...] for name in LISTS if name in group}
    named = {name: group.attrs[name] for name in ("h5sparse_shape", "shape") if name in group.attrs}
    shape: Any = group["shape"][...] if "shape" in group else next(reversed(named.values()), None)
    if lacking := [name for name in LISTS if name not in lists] + ["shape"] * (shape is None):
        what = f"lacks {lacking[0]}, expected data, indices, indptr and shape"
        raise DataError(what, where, f"found {list(map(str, group))[:20]}")
    keys = ("format", "encoding-type", "h5sparse_format")  # attributes that tell rows from columns
    layout = " ".join(text(group.attrs[key]) for key in keys if key in group.attrs).lower()
    try:
        rows, columns = (index(n) for n in shape)
        affordable((rows, columns), len(lists["data"]), where)
        found = (sp.csc_array if "csc" in layout else sp.csr_array)(tuple(lists.values()), (rows, columns))
        found.check_format(full_check=True)
    except (ValueError, TypeError) as e:
        what = f"makes no matrix of shape {np.asarray(shape).tolist()}: {' '.join(str(e).split())}"
        raise DataError(what, where, "write it again") from e
    return found


def affordable(shape: tuple[int, ...], entries: int, where: str) -> None:
    """DataError where a declared shape is not one that so many entries have, or does not fit in memory."""
    if 8 * sum(shape) + 32 * entries > memory_limit() or max(shape) > max(10**6, SPARSEST * entries):
        what = f"declares shape {shape} for {entries} entries, expected a shape that they fill"
        raise DataError(what, where, "write it again with the size of what is stored")


def validated_matrix(found: Any, where: str, square: bool) -> Any:
    """Sparse rows of finite real numbers; square, and both triangles, where these are asked for."""
    if found.dtype.kind not in "fiu":
        raise DataError(f"holds {kind_of(found.dtype)}, expected real numbers", where, "write it as float64")
    if found.ndim != 2 or 0 in found.shape:
        raise DataError(
            f"has shape {found.shape}, expected rows and columns", where, "save the matrix itself"
        )
    affordable(found.shape, getattr(found, "nnz", found.size), where)
    if hasattr(found, "check_format"):
        found.check_format(full_check=True)  # scipy trusts indices, and would reach beyond its arrays
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
