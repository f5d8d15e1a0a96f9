"""Frames of markers as lines of text: time, then x, y and z of every node, separated by commas."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from time import sleep
from typing import TextIO

import numpy as np

from forceid.errors import DataError
from forceid.records import Frame

END = "end"  # the line that ends a file which is followed
PAUSE = 0.005  # s between looks for a new line: a tenth of the default lag


def frames_from_lines(
    lines: Iterable[str], node: tuple[str, ...], source: str, tell: Callable[[str], None]
) -> Iterator[Frame]:
    """The frames in lines: time s, then x, y, z m of every node in the order of `node`.

    Empty and `nan` stand for what was not seen. The first line may be a header; one that reads `end` is the
    last. A line that is no frame is told and left out; DataError where that is the first one, or none comes.

    >>> lines = ["time,ax,ay,az", "0.0,1,2,3", "0.1,,nan,3"]
    >>> [f.position.tolist() for f in frames_from_lines(lines, ("a",), "stdin", print)]
    [[[1.0, 2.0, 3.0]], [[nan, nan, 3.0]]]
    """
    expected, any_frame = 1 + 3 * len(node), False
    meant = f"expected {expected}: time, then x, y, z of {len(node)} nodes ({listed(node)})"
    for number, raw in enumerate(lines, 1):
        line = raw.strip()
        if line.lower() == END:
            break
        if not line or (number == 1 and number_in(line.partition(",")[0]) is None):  # a header
            continue
        frame, wrong = read_frame(line, expected, meant)
        if frame is not None:
            any_frame = True
            yield frame
        elif any_frame:
            tell(f"{source}: line {number} {wrong}; it is left out")
        else:
            next_step = "write one line a frame, in the order of /body/node, empty where a marker is not seen"
            raise DataError(wrong, f"{source}: line {number}", next_step)
    if not any_frame:
        raise DataError(f"holds no frame, {meant}", source, "write one line a frame")


def listed(node: tuple[str, ...]) -> str:
    """The names of nodes, the first and the last of many."""
    return ", ".join(node) if len(node) < 5 else f"{node[0]}, {node[1]} ... {node[-1]}"


def number_in(field: str) -> float | None:
    """The number that a field holds, NaN if it is empty; None where it holds something else."""
    try:
        return float(field) if field and not field.isspace() else math.nan
    except ValueError:
        return None


def read_frame(line: str, expected: int, meant: str) -> tuple[Frame | None, str]:
    """The frame of a line, or None and what is wrong with it."""
    fields = line.split(",")
    if len(fields) != expected:
        return None, f"has {len(fields)} fields, {meant}"
    try:
        values = [float(field) for field in fields]
    except ValueError:  # what is empty, or no number
        read = [number_in(field) for field in fields]
        bad = next((k for k, value in enumerate(read) if value is None), None)
        if bad is not None:
            return None, f"has {fields[bad].strip()[:40]!r} in field {bad + 1}, expected a number or nothing"
        values = [math.nan if value is None else value for value in read]
    x = np.array(values)
    if not math.isfinite(values[0]):
        return None, f"has the time {fields[0].strip()!r}, expected a number of seconds"
    if np.isinf(x).any():
        return None, f"has an infinite number in field {int(np.isinf(x).argmax()) + 1}"
    return Frame(values[0], x[1:].reshape(-1, 3)), ""


def growing_lines(file: TextIO) -> Iterator[str]:
    """The lines of a file that is still being written, each when it is whole; never ends by itself."""
    begun = ""
    while True:
        part = file.readline()
        if not part:
            sleep(PAUSE)
            continue
        begun += part
        if begun.endswith("\n"):
            yield begun
            begun = ""
