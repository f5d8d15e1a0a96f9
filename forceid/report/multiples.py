"""Small multiples of a batch: force and moment of every file as two small curves, all to one scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files import read_curves
from forceid.records import AXES, Array
from forceid.report.numbers import plain, typeset
from forceid.report.plots.chart import kept

MOST_FILES = 150  # files drawn: with more the page outgrows two megabytes
SMALL_POINTS = 120  # points of a curve two hundred pixels wide
USUAL = 90.0  # percentile of the peaks that fills the height: a few files that are far off are cut
LOADS = {"force": "N", "moment": "N m"}


@dataclass(frozen=True)
class Part:
    """A load of a file: its greatest value in words, what a listener is told, and an SVG path by color."""

    peak: str
    words: str
    curves: list[tuple[str, str]]


@dataclass(frozen=True)
class Small:
    """A file among the small multiples."""

    name: str
    row: Mapping[str, Any]
    parts: list[Part]


def multiples(rows: Sequence[Mapping[str, Any]]) -> list[Small]:
    """The curves of the files in these rows of the table that have a result which can be read."""
    found = [(row, read) for row in rows[:MOST_FILES] if (read := curves_of(row["output"])) is not None]
    scales = {name: scale_of([peak(read[name]) for _, read in found]) for name in LOADS}
    return [
        Small(
            Path(row["file"]).stem,
            row,
            [part_of(read["time"], read[name], name, scales[name]) for name in LOADS],
        )
        for row, read in found
    ]


def curves_of(path: Path) -> dict[str, Array] | None:
    """Time, force and moment in a result, None where there is none."""
    try:
        return read_curves(path)
    except DataError:
        return None


def peak(values: Array) -> float:
    """The greatest value of any axis, zero where nothing is known."""
    return float(np.max(np.abs(np.nan_to_num(values)), initial=0.0))


def scale_of(peaks: Sequence[float]) -> float:
    """The value that fills the height."""
    known = [p for p in peaks if p > 0]
    return float(np.percentile(known, USUAL)) if known else 1.0


def part_of(time: Array, values: Array, name: str, scale: float) -> Part:
    """One load of a file."""
    if not np.isfinite(values).any():
        return Part(f"{name} not identifiable", f"No {name}", [])
    most = f"{name} {typeset(plain(peak(values), 3))} {LOADS[name]}"
    at = kept(values, SMALL_POINTS)
    x = 100 * (time[at] - time[0]) / max(float(time[-1] - time[0]), 1e-9)
    lines = [(axis, line(x, 20 - 18 * values[at, k] / scale)) for k, axis in enumerate(AXES)]
    return Part(most, f"Curve: {most} at most, the {name}", lines)


def line(x: Array, y: Array) -> str:
    """A path through points (n,), broken where one is not known.

    >>> line(np.array([0.0, 1.0, 2.0]), np.array([3.0, np.nan, 5.0]))
    'M0.0 3.0M2.0 5.0'
    """
    said, pen = [], "M"
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if np.isfinite(b):
            said.append(f"{pen}{a:.1f} {b:.1f}")
        pen = "L" if np.isfinite(b) else "M"
    return "".join(said)
