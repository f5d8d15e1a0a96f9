"""Motive (OptiTrack) CSV: a line of metadata, rows that say what each column is, then frames.

Of the rows between, the first says the type of a column, the second its name, the last before `Frame` whether
it is a place or a turn. `Rigid Body Marker` is where the solved body has one, `Marker` what was measured.
"""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.captures.capture import Capture, number_rows, text_lines, without_subject
from forceid.files.units import si_factor
from forceid.records import Array

Column = tuple[str, str, str]  # type, name, and Position or Rotation


def is_motive(head: str) -> bool:
    """Whether the file begins as one of Motive does."""
    return head.startswith("Format Version,")


def read_motive(path: Path) -> Capture:
    """Measured markers that have names, and poses of rigid bodies. DataError: neither, or cut short."""
    lines = list(csv.reader(text_lines(path)))
    meta = dict(zip(lines[0][::2], lines[0][1::2], strict=False))
    start = next((k for k, row in enumerate(lines) if row[:1] == ["Frame"]), 0)
    said = [row for row in lines[1:start] if any(cell.strip() for cell in row)]
    if not start or len(said) < 3:
        what = "has no rows of types, names and Position above Frame"
        raise DataError(what, str(path), "export it again, with the header")
    axes = [cell.strip() for cell in lines[start]]
    if len(axes) < 2 or not axes[1].startswith("Time"):
        raise DataError(f"has no column Time in line {start + 1}", str(path), "export it again")
    width = len(axes)
    kinds, names, parts = ((row + [""] * width)[:width] for row in (said[0], said[1], said[-1]))
    data = number_rows(
        [(k + start + 2, row) for k, row in enumerate(lines[start + 1 :]) if any(row)], width, str(path)
    )
    found: dict[Column, dict[str, int]] = {}
    for k in range(2, width):
        found.setdefault((kinds[k].strip(), names[k].strip(), parts[k].strip()), {})[axes[k]] = k
    factor = si_factor(meta.get("Length Units", "Meters").strip(), "m", f"{path}:Length Units")
    markers = {
        name: factor * data[:, [at[axis] for axis in "XYZ"]]
        for (kind, name, part), at in found.items()
        if kind == "Marker" and part == "Position" and at.keys() == set("XYZ") and not unlabeled(name)
    }
    pose = poses(found, data, factor) if meta.get("Rotation Type", "Quaternion") == "Quaternion" else {}
    if not markers and not pose:
        what = f"holds {in_words(found) or 'no columns'}, expected markers, or rigid bodies with quaternions"
        raise DataError(what, str(path), "export markers, or the rotation as Quaternion")
    taken = {("Marker", name, "Position") for name in markers}
    taken |= {("Rigid Body", name, part) for name in pose for part in ("Rotation", "Position")}
    left = in_words({column: at for column, at in found.items() if column not in taken})
    position = np.stack([*markers.values()], 1) if markers else np.empty((len(data), 0, 3))
    return Capture(without_subject([*markers]), data[:, 1], position, pose, (left,) if left else ())


def unlabeled(name: str) -> bool:
    """Whether Motive gave the name, for a trajectory that belongs to nothing."""
    return name.partition(":")[2].startswith("Unlabeled") or name.startswith("Unlabeled")


def poses(found: dict[Column, dict[str, int]], data: Array, factor: float) -> dict[str, tuple[Array, Array]]:
    """Origin (time, 3) m and orientation (time, 4) of every rigid body that has both."""
    result = {}
    for kind, name, part in found:
        turn, place = (found.get((kind, name, p), {}) for p in ("Rotation", "Position"))
        whole = turn.keys() == set("XYZW") and place.keys() == set("XYZ")
        if (kind, part) == ("Rigid Body", "Rotation") and whole:
            center = factor * data[:, [place[axis] for axis in "XYZ"]]
            result[name] = center, data[:, [turn[axis] for axis in "XYZW"]]
    return result


def in_words(found: dict[Column, dict[str, int]]) -> str:
    """How many of what a file holds."""
    counts = Counter(
        f"{'Unlabeled ' if kind == 'Marker' and unlabeled(name) else ''}{kind or 'column'} {part}".strip()
        for kind, name, part in found
    )
    return ", ".join(f"{n} {what}" for what, n in counts.items())
