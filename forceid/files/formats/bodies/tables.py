"""Published tables of the segments of persons: where their mass is, by the names of their authors."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

SIDES = ("left", "right")


@dataclass(frozen=True)
class TableSegment:
    """A segment between two points: mass and the rest as parts of the body's mass and of its own length.

    center: from the first end; gyration (3,): about the sagittal, transverse and longitudinal axis; on: whose
    markers stay on it.
    """

    name: str
    ends: tuple[str, str]
    mass: float
    center: float
    gyration: tuple[float, float, float]
    on: str


@cache
def tables() -> Mapping[str, Mapping[str, Any]]:
    """All tables by name, as the file beside this module has them."""
    return tomllib.loads((files("forceid.files.formats.bodies") / "tables.toml").read_text("utf-8"))


def table_segments(table: str, sex: str = "") -> tuple[TableSegment, ...]:
    """The segments of a table, left and right. Without a sex, where the table has two: the mean of both.

    >>> thigh = next(s for s in table_segments("de_leva", "male") if s.name == "left_thigh")
    >>> thigh.ends, thigh.mass, thigh.center
    (('left_hip', 'left_knee'), 0.1416, 0.4095)
    """
    found = []
    for kind in ("middle", "sided"):
        for name, row in tables()[table][kind].items():
            columns = [row["both"]] if "both" in row else [row[s] for s in ("female", "male")]
            if len(columns) > 1 and sex:
                columns = [row[sex]]
            mass, center, *gyration = (float(f"{v:.12g}") for v in np.mean(columns, axis=0) / 100)
            for side in SIDES if kind == "sided" else ("",):
                ends = tuple(of_side(end, side) for end in row["ends"])
                on = of_side(row.get("on", name), side)
                segment = TableSegment(
                    of_side(name, side), (ends[0], ends[1]), mass, center,
                    (gyration[0], gyration[1], gyration[2]), on,
                )  # fmt: skip
                found.append(segment)
    return tuple(found)


def table_joints(table: str) -> dict[str, tuple[str, str]]:
    """Which two segments meet at a joint, left and right, by the name of its point."""
    middle, joints = tables()[table]["middle"], tables()[table]["joint"]
    found = {}
    for side in SIDES:
        for joint, pair in joints.items():
            above, below = (name if name in middle else of_side(name, side) for name in pair)
            found[of_side(joint, side)] = above, below
    return found


def of_side(name: str, side: str) -> str:
    """A name with its side, if any."""
    return f"{side}_{name}" if side else name
