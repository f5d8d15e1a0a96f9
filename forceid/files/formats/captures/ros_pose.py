"""Poses of ROS as CSV: PoseStamped, TransformStamped, Odometry, as rostopic, bagpy or PlotJuggler write.

Columns end in position.x, orientation.w and so on, after any prefix; stamps are ns, s, or s and ns apart.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.captures.capture import Capture, listed
from forceid.files.formats.csv import CsvTable, read_csv
from forceid.files.values import likeliest_name
from forceid.records import Array

PLACE = re.compile(r"(?:(?P<body>.*)[./])?(?:position|translation)[./](?P<axis>[xyz])")
TURN = re.compile(r"(?:(?P<body>.*)[./])?(?:orientation|rotation)[./](?P<axis>[xyzw])")
STAMPS = ("header.stamp", "%time", "Time", "time", "__time", "timestamp")
PARTS = (("header.stamp.secs", "header.stamp.nsecs"), ("header.stamp.sec", "header.stamp.nanosec"))
NANOSECONDS = 10**15  # beyond, in s, any date: stamps without a point count ns


def is_ros_pose(head: str) -> bool:
    """Whether the first row names a place and an orientation as messages of ROS do."""
    first = [name.strip() for name in next(iter(head.splitlines()), "").split(",")]
    return any(map(TURN.fullmatch, first)) and any(map(PLACE.fullmatch, first))


def read_ros_pose(path: Path) -> Capture:
    """Poses by the prefix of their columns; times count from the first. DataError: no time, or not whole."""
    table = read_csv(path)
    numbers = CsvTable(table, str(path))
    pose: dict[str, tuple[Array, Array]] = {}
    taken: set[str] = set()
    for body in dict.fromkeys(m["body"] for name in table if (m := TURN.fullmatch(name))):
        turn = {m["axis"]: n for n in table if (m := TURN.fullmatch(n)) and m["body"] == body}
        place = {m["axis"]: n for n in table if (m := PLACE.fullmatch(n)) and m["body"] == body}
        if turn.keys() == set("xyzw") and place.keys() == set("xyz"):
            center = np.stack([numbers[place[axis]] for axis in "xyz"], 1)
            pose[body or "pose"] = center, np.stack([numbers[turn[axis]] for axis in "xyzw"], 1)
            taken |= {*turn.values(), *place.values()}
    if not pose:
        raise DataError("holds no whole pose", str(path), "keep x, y, z and x, y, z, w of one topic")
    for name in table:
        if name.endswith("child_frame_id") and len(set(table[name])) > 1:
            what = f"holds {', '.join(sorted(set(table[name]))[:4])} in one table, expected one body"
            raise DataError(what, f"{path}:{name}", "write a file for each")
    time, clock = stamps(table, str(path))
    beside = ("seq", "frame_id", *STAMPS, *(name for pair in PARTS for name in pair))
    rest = [name for name in table if name not in taken | clock and not name.endswith(beside)]
    left = (f"columns {listed(rest)}",) if rest else ()
    return Capture((), time, np.empty((len(time), 0, 3)), pose, left)


def stamps(table: dict[str, list[str]], where: str) -> tuple[Array, set[str]]:
    """Times (time,) s from the first, counted in whole ns where they are stated so, and their columns."""

    def ending(name: str) -> str | None:
        return next((c for c in table if c == name or c.endswith((f".{name}", f"/{name}"))), None)

    try:
        for secs, nsecs in PARTS:
            if (s := ending(secs)) and (ns := ending(nsecs)):
                whole = [10**9 * int(a) + int(b) for a, b in zip(table[s], table[ns], strict=True)]
                return np.array([1e-9 * (t - whole[0]) for t in whole]), {s, ns}
        for name in STAMPS:
            if column := ending(name):
                cells = [cell.strip() for cell in table[column]]
                if cells[0].isdigit() and int(cells[0]) > NANOSECONDS:
                    return np.array([1e-9 * (int(cell) - int(cells[0])) for cell in cells]), {column}
                return np.array([float(cell) for cell in cells]) - float(cells[0]), {column}
    except ValueError as e:
        raise DataError(f"holds a time that is none ({e})", where, "correct it") from e
    raise DataError("holds no time", where, likeliest_name("header.stamp", list(table)))
