"""Qualisys TSV: a header of names and values, then rows of places in mm: of markers (3D) or of bodies (6D).

What is not seen is blank, or zero in all its numbers. A body has X, Y, Z, three angles, a residual, and the
rotation matrix to the world column by column, Rot[0] to Rot[8].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.files.formats.captures.capture import (
    Capture,
    Row,
    check_count,
    number_in,
    number_rows,
    text_lines,
)
from forceid.records import Array

OF_BODY = 16  # columns of a body
ROT = 7  # of these the first of the rotation matrix
Header = Mapping[str, list[str]]


def is_qualisys(head: str) -> bool:
    """Whether the file begins as one of Qualisys does."""
    return any(line.startswith("NO_OF_FRAMES\t") for line in head.splitlines()[:3])


def read_qualisys(path: Path) -> Capture:
    """Markers of 3D data, or poses of 6D data. DataError: cut short, other data, or no clock."""
    lines, where = text_lines(path), str(path)
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
    kind = (head.get("DATA_INCLUDED") or ["3D"])[0]
    named, counted, each = ("MARKER_NAMES", "NO_OF_MARKERS", 3)
    if kind == "6D":
        named, counted, each = ("BODY_NAMES", "NO_OF_BODIES", OF_BODY)
    if named not in head or kind not in ("3D", "6D"):
        what = f"holds {kind} data without {named}, expected markers (3D) or bodies (6D)"
        raise DataError(what, where, "export 3D or 6D data to TSV, with the header")
    names = tuple(name.strip() for name in head[named])
    numbered = enumerate(lines[start:], start + 1)
    rows: list[Row] = [(n, line.split("\t")) for n, line in numbered if line.strip()]
    titles: list[str] = []
    if rows and not number(rows[0][1][0]):  # a row that names the columns
        titles, rows = [cell.strip() for cell in rows[0][1]], rows[1:]
    blank = all(not row[-1].strip() for _, row in rows)  # lines may end in a tab
    lead = min(max(max((len(row) for _, row in rows), default=0) - blank - each * len(names), 0), 2)
    rows = [(n, ["" if cell.strip().lower() in ("null", "nan") else cell for cell in row]) for n, row in rows]
    data = number_rows(rows, lead + each * len(names), where)
    check_count(len(data), " ".join(head.get("NO_OF_FRAMES", [])), "frames", where)
    check_count(len(names), " ".join(head.get(counted, [])), counted.removeprefix("NO_OF_").lower(), where)
    time, block = clock(head, titles[:lead], data, where), data[:, lead:].reshape(len(data), -1, each)
    if kind == "3D":
        return Capture(names, time, seen_part(1e-3 * block), left_out=tuple(left))
    if titles and titles[lead + ROT : lead + OF_BODY] != [f"Rot[{k}]" for k in range(9)]:
        what = f"names columns {', '.join(titles[lead : lead + OF_BODY])}, expected Rot[0] to Rot[8] last"
        raise DataError(what, f"{where}:{names[0]}", "export the rotation matrix too")
    pose = {name: pose_of(block[:, k]) for k, name in enumerate(names)}
    return Capture((), time, np.empty((len(data), 0, 3)), pose, (*left, "angles and residuals of the bodies"))


def clock(head: Header, titles: Sequence[str], data: Array, where: str) -> Array:
    """The times (time,) s: by the frequency, or of the column Time where frames came from outside."""
    said = " ".join(head.get("FREQUENCY", []))
    if "Time" in titles and not number(said or "?"):
        return data[:, titles.index("Time")]
    return np.asarray(np.arange(len(data)) / number_in(said, "FREQUENCY", where))


def seen_part(places: Array) -> Array:
    """Places (..., 3), NaN where all three are zero."""
    return np.where((places == 0).all(-1, keepdims=True), np.nan, places)


def pose_of(block: Array) -> tuple[Array, Array]:
    """Origin (time, 3) m and orientation (time, 4) of a body, NaN where it is not seen."""
    matrix = block[:, ROT:].reshape(-1, 3, 3).swapaxes(1, 2)
    seen = np.isfinite(block).all(1) & matrix.any((1, 2))
    origin, turn = np.full((len(block), 3), np.nan), np.full((len(block), 4), np.nan)
    origin[seen] = 1e-3 * block[seen, :3]
    try:
        turn[seen] = Rotation.from_matrix(matrix[seen]).as_quat()
    except ValueError:  # not of right hand: whoever checks quaternions says so
        turn[seen] = 0.0
    return origin, turn


def number(cell: str) -> bool:
    """Whether a cell is blank or a number."""
    try:
        return not cell.strip() or np.isfinite(float(cell))
    except ValueError:
        return False
