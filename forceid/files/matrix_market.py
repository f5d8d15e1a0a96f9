"""Matrix Market: coordinates or arrays as text, plain or compressed.

Read here and not by scipy.io.mmread, which takes the interpreter down on a file that ends inside a number,
and on numbers of 22 digits and more (scipy issue 19949). Source: Boisvert, Pozo, Remington, The Matrix Market
exchange formats: initial design (NISTIR 5935, 1996).
"""

from __future__ import annotations

import gzip
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from forceid.errors import DataError
from forceid.files.compressed import SWELL, affordable
from forceid.records import Array

BANNER = "%%MatrixMarket matrix coordinate real symmetric"
LAYOUTS, SYMMETRIES = ("coordinate", "array"), ("general", "symmetric", "skew-symmetric")
REAL = ("real", "double", "integer", "unsigned-integer")
LONGEST = 4096  # characters of a line of the header


def read_market(path: str) -> Any:
    """The matrix of a .mtx or .mtx.gz file: a coo_array, or a dense one where its layout is array.

    What a symmetric file leaves out is filled in. Raises DataError.
    """
    with opened(path) as file:
        layout, symmetry, size = header(file, path)
        n, m = size[:2]
        if symmetry != "general" and n != m:
            raise DataError(
                f"is {symmetry} of shape ({n}, {m}), expected a square matrix", path, "correct it"
            )
        half = {"general": n * m, "symmetric": n * (n + 1) // 2, "skew-symmetric": n * (n - 1) // 2}
        entries = size[2] if layout == "coordinate" else half[symmetry]
        affordable((n, m), entries, path)
        swell = SWELL if path.lower().endswith(".gz") else 1
        stored = Path(path).stat().st_size
        if 2 * entries > swell * stored:  # no line is shorter than two characters
            raise DataError(
                f"declares {entries} entries but holds {stored} bytes, expected a line for each",
                path,
                "write or copy it again: it is cut short",
            )
        values = body(file, 3 if layout == "coordinate" else 1, entries, path)
    if layout == "array":
        return dense(values[:, 0], (n, m), symmetry)
    return coordinates(values, (n, m), symmetry, path)


@contextmanager
def opened(path: str) -> Iterator[Any]:
    """The text of the file; any byte is a character, for comments are in any language."""
    if path.lower().endswith(".gz"):
        with gzip.open(path, "rt", encoding="latin-1") as file:
            yield file
    else:
        with open(path, encoding="latin-1") as file:
            yield file


def header(file: Any, path: str) -> tuple[str, str, tuple[int, ...]]:
    """Layout, symmetry and the numbers of rows, columns and, of coordinates, entries."""
    first = file.readline(LONGEST)
    words = first.lower().split()
    if len(words) != 5 or words[:2] != ["%%matrixmarket", "matrix"]:
        raise DataError(f"begins with {first[:60].strip()!r}, expected {BANNER!r}", path, "see its writer")
    layout, field, symmetry = words[2:]
    symmetry = "symmetric" if symmetry == "hermitian" and field in REAL else symmetry
    if field in ("complex", "pattern"):
        what = "complex numbers" if field == "complex" else "a pattern without values"
        raise DataError(f"holds {what}, expected real numbers", path, "write the field real")
    if layout not in LAYOUTS or field not in REAL or symmetry not in SYMMETRIES:
        raise DataError(
            f"declares {' '.join(words[2:])!r}, expected as in {BANNER!r}", path, "correct line 1"
        )
    line = "%"
    while line.startswith("%") or line.isspace():
        line = file.readline(LONGEST)
    numbers = line.split()
    count = 3 if layout == "coordinate" else 2
    if len(numbers) != count or not all(n.isdecimal() and len(n) < 19 for n in numbers):
        what = f"has the size line {line[:60].strip()!r}, expected {count} whole numbers"
        raise DataError(what, path, "write or copy it again")
    return layout, symmetry, tuple(map(int, numbers))


def body(file: Any, columns: int, entries: int, path: str) -> Array:
    """The numbers (entry, column) below the header."""
    if not entries:
        return np.zeros((0, columns))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy warns of a body that is empty
        try:
            values = np.loadtxt(file, comments="%", ndmin=2)
        except UserWarning:
            values = np.zeros((0, columns))
        except ValueError as e:
            what = " ".join(str(e).split()).split(";")[0]
            raise DataError(
                f"holds a line that is no entry ({what}), expected {columns} numbers in each",
                path,
                "write or copy it again",
            ) from e
    if values.shape != (entries, columns):
        more = "more" if len(values) > entries else str(len(values))
        what = f"declares {entries} entries of {columns} numbers, holds {more} of {values.shape[1]}"
        raise DataError(
            what, path, "write or copy it again" + (": it is cut short" if more != "more" else "")
        )
    return values


def coordinates(values: Array, shape: tuple[int, int], symmetry: str, path: str) -> Any:
    """Entries (row, column, value) as a sparse matrix, with what their symmetry adds."""
    place = values[:, :2]
    off = (place != np.floor(place)) | (place < 1) | (place > shape)
    if off.any():
        i, j = place[off.any(1)][0]
        what = f"has an entry at ({i:g}, {j:g}), expected rows 1 to {shape[0]} and columns 1 to {shape[1]}"
        raise DataError(what, path, "count from 1")
    row, column = (place - 1).astype(np.intp).T
    value = values[:, 2]
    if symmetry != "general":
        side = np.sign(row - column)
        if side.min(initial=0) < 0 < side.max(initial=0):
            what = f"is declared {symmetry} but holds both triangles, expected the lower one"
            raise DataError(what, path, "declare it general")
        beside, sign = side != 0, 1.0 if symmetry == "symmetric" else -1.0
        row, column, value = (
            np.concatenate([a, b[beside]]) for a, b in ((row, column), (column, row), (value, sign * value))
        )
    return sp.coo_array((value, (row, column)), shape=shape)


def dense(values: Array, shape: tuple[int, int], symmetry: str) -> Array:
    """Values by columns, of the lower triangle where there is a symmetry, as an array."""
    if symmetry == "general":
        return values.reshape(shape[::-1]).T
    K = np.zeros(shape)
    K.T[np.triu_indices(shape[0], 0 if symmetry == "symmetric" else 1)] = values
    lower = np.tril(K, -1)
    return K + lower.T if symmetry == "symmetric" else K - lower.T
