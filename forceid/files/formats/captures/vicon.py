"""Vicon Nexus and Tracker CSV: sections, each with a rate of its own, in one file.

A section is its name, its rate (Hz), a row of the names of objects, a row of fields that begins with Frame
and Sub Frame, a row of units, and rows of numbers up to a blank line. Frames count from one.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.captures.capture import (
    Capture,
    Row,
    listed,
    number_in,
    number_rows,
    text_lines,
    without_subject,
)
from forceid.files.units import si_factor
from forceid.records import Array

QUATERNION = ("RX", "RY", "RZ", "RW", "TX", "TY", "TZ")
LENGTH = QUATERNION[4:]


@dataclass(frozen=True)
class Section:
    """One section: name, rate (Hz), the object, field and unit of every column, and its rows of cells."""

    name: str
    rate: float
    objects: list[str]
    fields: list[str]
    units: list[str]
    rows: list[Row]

    def said(self) -> str:
        """What it is, in words."""
        named = list(dict.fromkeys(name for name in self.objects[2:] if name))
        return f"{self.name} at {self.rate:g} Hz ({listed(named)})"


def is_vicon(head: str) -> bool:
    """Whether the file begins as one of Vicon does: a section, its rate, and then the fields of a frame."""
    lines = head.splitlines()[:8]
    return any(cells_of(line)[:2] == ["Frame", "Sub Frame"] for line in lines)


def read_vicon(path: Path) -> Capture:
    """Markers of Trajectories, and poses of Objects with quaternions. DataError: neither, or cut short."""
    sections = sections_of(text_lines(path), str(path))
    points = next((s for s in sections if s.name.startswith("Trajectories")), None)
    bodies = next((s for s in sections if s.name.startswith("Objects")), None)
    main = points or bodies
    if main is None:
        there = ", ".join(section.said() for section in sections) or "no section"
        what = f"holds {there}, expected Trajectories or Objects"
        raise DataError(what, str(path), "export the trajectories too")
    data = number_rows(main.rows, len(main.fields), str(path))
    time = (data[:, 0] - 1) / main.rate
    names, position, left = tracks(main, data, str(path)) if points else ((), np.empty((len(time), 0, 3)), [])
    pose: dict[str, tuple[Array, Array]] = {}
    if bodies is not None and (bodies is main or same_clock(bodies, main)):
        own = data if bodies is main else number_rows(bodies.rows, len(bodies.fields), str(path))
        pose, other = poses(bodies, own, str(path))
        left += other
    taken = [s for s in (points, bodies) if s is not None and (s is main or pose)]
    left += [section.said() for section in sections if section not in taken]
    return Capture(without_subject(names), time, position, pose, tuple(left))


def same_clock(a: Section, b: Section) -> bool:
    """Whether two sections have the same frames."""
    return a.rate == b.rate and [row[0] for _, row in a.rows] == [row[0] for _, row in b.rows]


def cells_of(line: str) -> list[str]:
    """The cells of a line; its separator follows the word Frame: comma, semicolon or tab."""
    separator = next((s for s in ";\t" if line.startswith(f"Frame{s}")), ",")
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def sections_of(lines: list[str], where: str) -> list[Section]:
    """The sections of a file. DataError: one without rate or numbers."""
    heads = [k for k, line in enumerate(lines) if cells_of(line)[:2] == ["Frame", "Sub Frame"]]
    found = []
    for k in heads:
        if k < 3:
            what = f"has fields in line {k + 1}, expected a section, its rate and names above"
            raise DataError(what, where, "export it again")
        separator = lines[k][5]

        def split(line: str, separator: str = separator) -> list[str]:
            cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
            return [cell.replace(",", ".") for cell in cells] if separator != "," else cells

        fields = [cell.strip() for cell in lines[k].split(separator)]
        while fields and not fields[-1]:
            fields.pop()
        name, rate = lines[k - 3].strip(f"{separator} "), lines[k - 2].strip(f"{separator} ")
        objects = filled(split(lines[k - 1]), len(fields))
        units = (split(lines[k + 1]) if k + 1 < len(lines) else []) + [""] * len(fields)
        rows: list[Row] = []
        for n, line in enumerate(lines[k + 2 :], k + 3):
            if not line.strip(f"{separator} "):
                break
            rows.append((n, split(line)))
        if not rows:
            raise DataError(f"holds no numbers in {name}, line {k + 3}", where, "export it again")
        found.append(
            Section(name, number_in(rate, f"in line {k - 1} the rate", where), objects, fields, units, rows)
        )
    return found


def filled(names: list[str], width: int) -> list[str]:
    """The object of every column: a name holds until the next."""
    found, last = [], ""
    for name in (names + [""] * width)[:width]:
        last = name or last
        found.append(last)
    return found


def tracks(section: Section, data: Array, where: str) -> tuple[tuple[str, ...], Array, list[str]]:
    """Names and positions (time, marker, 3) m of all whole triples X, Y, Z, and what else there is."""
    starts = [k for k in range(2, len(section.fields)) if section.fields[k : k + 3] == ["X", "Y", "Z"]]
    names = tuple(section.objects[k] or f"marker_{n + 1}" for n, k in enumerate(starts))
    rest = len(section.fields) - 2 - 3 * len(starts)
    left = [f"{rest} columns of {section.name} that are no X, Y, Z"] if rest else []
    if not starts:
        raise DataError(f"holds no X, Y, Z in {section.name}", where, "export the trajectories again")
    factor = [si_factor(section.units[k] or "mm", "m", f"{where}:{section.objects[k]}") for k in starts]
    return names, np.stack([f * data[:, k : k + 3] for f, k in zip(factor, starts, strict=True)], 1), left


def poses(section: Section, data: Array, where: str) -> tuple[dict[str, tuple[Array, Array]], list[str]]:
    """Poses by name of the objects that have a quaternion and a place; the others in words."""
    found, left = {}, []
    for name in dict.fromkeys(section.objects[2:]):
        at = {section.fields[k]: k for k in range(2, len(section.fields)) if section.objects[k] == name}
        if not at.keys() >= set(QUATERNION):
            left.append(f"object {name} without quaternion ({', '.join(at)})")
            continue
        factor = si_factor(section.units[at["TX"]] or "mm", "m", f"{where}:{name}")
        turn = data[:, [at[field] for field in QUATERNION[:4]]]
        called = name.rpartition(" ")[2].partition(":")[0]
        found[called] = factor * data[:, [at[field] for field in LENGTH]], turn
    return found, left
