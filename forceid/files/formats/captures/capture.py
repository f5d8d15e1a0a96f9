"""What a capture holds, and the text and numbers of the files that hold it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.channels import Channels
from forceid.records import Array

Row = tuple[int, list[str]]  # the number of a line, and its cells


@dataclass(frozen=True)
class Plates:
    """Force plates: force, point and the moment about it (time, plate, 3) in N, m, N m, world axes; names."""

    time: Array
    force: Array
    point: Array
    moment: Array
    name: tuple[str, ...]

    def of(self, which: list[int]) -> Plates:
        """Some of the plates."""
        names = tuple(self.name[k] for k in which)
        return Plates(self.time, self.force[:, which], self.point[:, which], self.moment[:, which], names)

    def on_body(self, gravity: Array) -> Plates:
        """What the plates do to the body, whichever of both a file holds: they push against gravity."""
        if not (self.force @ gravity).sum() > 0:
            return self
        return Plates(self.time, -self.force, self.point, -self.moment, self.name)


@dataclass(frozen=True)
class Capture:
    """Tracks of one clock: time (time,) s, position (time, marker, 3) m, NaN where a marker is not seen.

    pose: of bodies by name, origin (time, 3) m and orientation (time, 4) body to world, NaN where not seen;
    plates: that the file holds too; analog: its channels of other sensors, on clocks of their own; left_out:
    what else it holds, in words.
    """

    name: tuple[str, ...]
    time: Array
    position: Array
    pose: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    plates: Plates | None = None
    analog: Channels | None = None


def head_of(path: Path, size: int = 1 << 16) -> str:
    """The first characters of a file, whatever it is; nothing where there is none."""
    try:
        with open(path, "rb") as f:
            return f.read(size).decode("utf-8-sig", "replace")
    except OSError:
        return ""


def text_lines(path: str | Path) -> list[str]:
    """The lines of a text file. DataError: missing or not text."""
    try:
        return Path(path).read_text(encoding="utf-8-sig").splitlines()
    except OSError as e:
        raise DataError(f"cannot be read ({e.strerror})", str(path), "give the path of a text file") from e
    except UnicodeDecodeError as e:
        raise DataError("is not text", str(path), "export it again") from e


def number_rows(rows: Sequence[Row], width: int, where: str) -> Array:
    """Cells as float64 (row, width): blanks and cells left out at the end of a row are NaN."""
    data = np.full((len(rows), width), np.nan)
    for k, (line, row) in enumerate(rows):
        try:
            cells = [float(cell) if cell.strip() else np.nan for cell in row]
        except ValueError as e:
            raise DataError(f"holds text in line {line} ({e}), expected numbers", where, "correct it") from e
        if not np.isnan(cells[width:]).all():
            raise DataError(f"has {len(cells)} cells in line {line}, expected {width}", where, "correct it")
        data[k, : len(cells[:width])] = cells[:width]
    return data


def check_count(found: int, declared: str, what: str, where: str) -> None:
    """The count in the header is what the file holds."""
    if declared.strip().isdigit() and int(declared) != found:
        raise DataError(
            f"holds {found} {what}, expected {declared.strip()} by its header", where, "export it again"
        )


def number_in(text: str, what: str, where: str) -> float:
    """A positive number of a header. DataError: it is none."""
    try:
        value = float(text.strip().strip(",;"))
    except ValueError:
        value = 0.0
    if not 0 < value < np.inf:
        raise DataError(f"has {what} {text.strip()!r}, expected a positive number", where, "export it again")
    return value


def listed(names: Sequence[str], shown: int = 4) -> str:
    """The first of many names, and how many more there are.

    >>> listed(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    more = f" and {len(names) - shown} more" if len(names) > shown else ""
    return ", ".join(names[:shown]) + more


def without_subject(names: Sequence[str]) -> tuple[str, ...]:
    """Names as `subject:marker` without the subject, where all have the same.

    >>> without_subject(["me:toe", "me:heel"]), without_subject(["me:toe", "you:toe"])
    (('toe', 'heel'), ('me:toe', 'you:toe'))
    """
    subjects = {name.partition(":")[0] if ":" in name else "" for name in names}
    if len(subjects) == 1 and subjects != {""}:
        return tuple(name.partition(":")[2] for name in names)
    return tuple(names)
