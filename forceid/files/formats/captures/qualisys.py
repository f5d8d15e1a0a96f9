"""Qualisys TSV: a header of names and values, the names of the markers, then rows of places in mm.

A marker that is not seen is blank or at zero in all three coordinates.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.captures.capture import (
    Capture,
    Row,
    check_count,
    number_in,
    number_rows,
    text_lines,
)


def is_qualisys(head: str) -> bool:
    """Whether the file begins as one of Qualisys does."""
    return head.startswith("NO_OF_FRAMES\t")


def read_qualisys(path: Path) -> Capture:
    """Markers of 3D data. DataError: cut short, other data, or no frequency."""
    lines = text_lines(path)
    head: dict[str, list[str]] = {}
    left: list[str] = []
    start = 0
    for line in lines:
        name, *values = line.rstrip("\t").split("\t")
        if number(name) or not name.replace("_", "").isupper():
            break
        start += 1
        left += [f"event {' '.join(values)}"] if name == "EVENT" else []
        head[name] = values
    kind = (head.get("DATA_INCLUDED") or [""])[0]
    if "MARKER_NAMES" not in head or kind not in ("", "3D"):
        what = f"holds {kind or 'no'} data, expected markers in 3D"
        raise DataError(what, str(path), "export 3D data to TSV")
    names = tuple(name.strip() for name in head["MARKER_NAMES"])
    rate = number_in(" ".join(head.get("FREQUENCY", [])), "FREQUENCY", str(path))
    numbered = enumerate(lines[start:], start + 1)
    rows: list[Row] = [(n, line.split("\t")) for n, line in numbered if line.strip()]
    if rows and not number(rows[0][1][0]):  # a row that names the columns
        rows = rows[1:]
    blank = all(not row[-1].strip() for _, row in rows)  # lines may end in a tab
    lead = min(max(max((len(row) for _, row in rows), default=0) - blank - 3 * len(names), 0), 2)
    rows = [(n, ["" if cell.strip().lower() in ("null", "nan") else cell for cell in row]) for n, row in rows]
    data = number_rows(rows, lead + 3 * len(names), str(path))
    check_count(len(data), " ".join(head.get("NO_OF_FRAMES", [])), "frames", str(path))
    check_count(len(names), " ".join(head.get("NO_OF_MARKERS", [])), "markers", str(path))
    position = 1e-3 * data[:, lead:].reshape(len(data), -1, 3)
    lost = (position == 0).all(-1, keepdims=True)
    return Capture(names, np.arange(len(data)) / rate, np.where(lost, np.nan, position), left_out=tuple(left))


def number(cell: str) -> bool:
    """Whether a cell is blank or a number."""
    try:
        return not cell.strip() or np.isfinite(float(cell))
    except ValueError:
        return False
