"""OpenSim STO: a header up to `endheader`, names, rows of numbers, or of triples x,y,z (DataType=Vec3)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.captures.capture import number_rows, text_lines
from forceid.files.formats.channels import Channels
from forceid.records import Array


def read_sto(path: Path) -> Channels:
    """The columns of an STO file by name, with its clock; units where the header states them for all."""
    lines = text_lines(path)
    ends = [k for k, line in enumerate(lines) if line.strip().lower() == "endheader"]
    if not ends or len(lines) < ends[0] + 3:
        what = "is not a whole STO file, expected 'endheader', names and rows"
        raise DataError(what, str(path), "export it again")
    head = dict(line.replace(" ", "").split("=", 1) for line in lines[: ends[0]] if "=" in line)
    names = lines[ends[0] + 1].split()
    parts = {"Vec3": 3, "Quaternion": 4, "SpatialVec": 6}.get(head.get("DataType", "double"), 1)
    width = 1 + parts * (len(names) - 1)
    split = [(n, line.replace(",", " ").split()) for n, line in enumerate(lines[ends[0] + 2 :], ends[0] + 3)]
    rows = [row for row in split if row[1]]
    data = number_rows(rows, width, str(path))
    if not np.isfinite(data[:, 0]).all():
        line = rows[int(np.argmin(np.isfinite(data[:, 0])))][0]
        raise DataError(f"holds no time in line {line}, expected a finite number", str(path), "correct it")
    columns = data[:, 1:].reshape(len(data), len(names) - 1, parts)
    values: dict[str, Array] = {
        name: np.ascontiguousarray(columns[:, k, 0] if parts == 1 else columns[:, k])
        for k, name in enumerate(names[1:])
    }
    unit = dict.fromkeys(values, head["Units"]) if "Units" in head and parts == 3 else None
    return Channels(str(path), "column", values, unit, dict.fromkeys(values, data[:, 0]))
