"""Motion capture: OpenSim TRC markers and MOT force plates, C3D."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.channels import optional
from forceid.files.units import si_factor
from forceid.import_settings import PlateSetting
from forceid.records import Array

C3D_PATIENCE = 20.0  # s to load the reader on a busy machine, ten times what it takes
C3D_PACE = 5e6  # bytes/s that any machine reads


@dataclass(frozen=True)
class Markers:
    """Marker tracks: time (time,) s, position (time, marker, 3) m, NaN where a marker is not seen."""

    name: tuple[str, ...]
    time: Array
    position: Array


@dataclass(frozen=True)
class Plates:
    """Force plates: force, point and free moment (time, plate, 3) in N, m, N m, world axes."""

    time: Array
    force: Array
    point: Array
    moment: Array

    def of(self, which: list[int]) -> Plates:
        """Some of the plates."""
        return Plates(self.time, self.force[:, which], self.point[:, which], self.moment[:, which])


def read_trc(path: str | Path) -> Markers:
    """Markers of an OpenSim TRC file; blank cells are NaN. DataError: cut short, ragged, not of length."""
    lines = text_lines(path)
    if len(lines) < 6 or not lines[0].startswith("PathFileType"):
        raise DataError(
            "is not a TRC file, expected 'PathFileType' first", str(path), "export the markers again"
        )
    head = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=False))
    names = tuple(name.strip() for name in lines[3].split("\t")[2:] if name.strip())
    width = 2 + 3 * len(names)
    data = number_rows([line.split("\t") for line in lines[5:] if line.strip()], width, str(path))
    check_count(len(data), head.get("NumFrames", ""), "frames", str(path))
    check_count(len(names), head.get("NumMarkers", ""), "markers", str(path))
    factor = si_factor(head.get("Units", "m").strip(), "m", f"{path}:Units")
    return Markers(names, data[:, 1], factor * data[:, 2:].reshape(len(data), -1, 3))


def read_mot(path: str | Path, setting: PlateSetting) -> Plates:
    """Force plates of an OpenSim MOT file. DataError: cut short, or a column of `setting` is missing."""
    lines = text_lines(path)
    stripped = [line.strip().lower() for line in lines]
    if "endheader" not in stripped:
        raise DataError(
            "is not a MOT file, expected a line 'endheader'", str(path), "export the plates again"
        )
    start = stripped.index("endheader") + 1
    head = dict(line.replace(" ", "").split("=", 1) for line in lines[: start - 1] if "=" in line)
    names = lines[start].split()
    data = number_rows([line.split() for line in lines[start + 1 :] if line.strip()], len(names), str(path))
    check_count(len(data), head.get("nRows", head.get("datarows", "")), "rows", str(path))

    def take(pattern: str) -> Array:
        wanted = [[pattern.format(plate=plate) + axis for axis in "xyz"] for plate in setting.plate]
        for name in (name for names_of_plate in wanted for name in names_of_plate):
            if name not in names:
                what = f"has no column {name!r}, found {', '.join(names[:4])}, ..."
                raise DataError(what, str(path), "correct [import.plates]")
        return np.stack([data[:, [names.index(name) for name in plate]] for plate in wanted], 1)

    return Plates(
        data[:, names.index("time")], take(setting.force), take(setting.point), take(setting.moment)
    )


def read_c3d(path: str | Path) -> Markers:
    """Markers of a C3D file; lost points are NaN. ConfigError: ezc3d is not installed. DataError: not C3D."""
    ezc3d = optional("ezc3d", "c3d", path)
    if not Path(path).is_file():
        raise DataError("cannot be read (no such file)", str(path), "give the path of a C3D file")
    check_survived(path)
    try:
        c3d = ezc3d.c3d(str(path))
    except (OSError, RuntimeError, ValueError) as e:
        raise DataError(f"is not a C3D file ({e})", str(path), "export the markers again") from e
    point = c3d["parameters"]["POINT"]
    names = tuple(str(name) for name in point["LABELS"]["value"])
    data = np.asarray(c3d["data"]["points"], float)[:3].transpose(2, 1, 0)[:, : len(names)]
    lost = np.asarray(c3d["data"]["meta_points"]["residuals"])[0].T[:, : len(names)] < 0
    factor = si_factor(str(point["UNITS"]["value"][0]), "m", f"{path}:POINT:UNITS")
    frame = np.arange(len(data)) + c3d["header"]["points"]["first_frame"]
    return Markers(
        names, frame / float(point["RATE"]["value"][0]), np.where(lost[..., None], np.nan, factor * data)
    )


def check_survived(path: str | Path) -> None:
    """A DataError where a file takes down, or holds up, the process that reads it with ezc3d."""
    words = [sys.executable, "-c", "import sys, ezc3d; ezc3d.c3d(sys.argv[1])", str(path)]
    patience = C3D_PATIENCE + Path(path).stat().st_size / C3D_PACE
    try:
        ended = subprocess.run(words, capture_output=True, timeout=patience, check=False).returncode
    except subprocess.TimeoutExpired:
        ended = -1
    if ended < 0:
        what = "is damaged: ezc3d does not come to the end of it"
        raise DataError(what, str(path), "export the markers again")


def text_lines(path: str | Path) -> list[str]:
    """The lines of a text file. DataError: missing or not text."""
    try:
        return Path(path).read_text(encoding="utf-8-sig").splitlines()
    except OSError as e:
        raise DataError(f"cannot be read ({e.strerror})", str(path), "give the path of a text file") from e
    except UnicodeDecodeError as e:
        raise DataError("is not text", str(path), "export it again") from e


def number_rows(rows: list[list[str]], width: int, where: str) -> Array:
    """Cells as float64 (row, width): blanks and cells left out at the end of a row are NaN."""
    data = np.full((len(rows), width), np.nan)
    for k, row in enumerate(rows):
        try:
            cells = [float(cell) if cell.strip() else np.nan for cell in row]
        except ValueError as e:
            raise DataError(
                f"holds text in data row {k + 1} ({e}), expected numbers", where, "correct it"
            ) from e
        if not np.isnan(cells[width:]).all():
            raise DataError(
                f"has {len(cells)} cells in data row {k + 1}, expected {width}", where, "correct it"
            )
        data[k, : len(cells[:width])] = cells[:width]
    return data


def check_count(found: int, declared: str, what: str, where: str) -> None:
    """The count in the header is what the file holds."""
    if declared.strip().isdigit() and int(declared) != found:
        raise DataError(
            f"holds {found} {what}, expected {declared.strip()} by its header", where, "export it again"
        )
