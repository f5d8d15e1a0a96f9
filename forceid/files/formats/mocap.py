"""Motion capture: OpenSim TRC markers and MOT force plates, C3D."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.captures.capture import Capture, Plates, check_count, number_rows, text_lines
from forceid.files.formats.channels import Channels, optional
from forceid.files.units import si_factor
from forceid.import_settings import PlateSetting
from forceid.records import Array

C3D_PATIENCE = 20.0  # s to load the reader on a busy machine, ten times what it takes
C3D_PACE = 5e6  # bytes/s that any machine reads


def is_trc(head: str) -> bool:
    """Whether the file begins as a TRC file does."""
    return head.startswith("PathFileType")


def is_c3d(head: str) -> bool:
    """Whether the file begins as a C3D file does: its second byte is 0x50."""
    return head[1:2] == "P" and not head[:1].isprintable()


def read_trc(path: str | Path) -> Capture:
    """Markers of an OpenSim TRC file; blank cells are NaN. DataError: cut short, ragged, not of length."""
    lines = text_lines(path)
    if len(lines) < 6 or not lines[0].startswith("PathFileType"):
        raise DataError(
            "is not a TRC file, expected 'PathFileType' first", str(path), "export the markers again"
        )
    head = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=False))
    names = tuple(name.strip() for name in lines[3].split("\t")[2:] if name.strip())
    width = 2 + 3 * len(names)
    rows = [(n, line.split("\t")) for n, line in enumerate(lines[5:], 6) if line.strip()]
    data = number_rows(rows, width, str(path))
    check_count(len(data), head.get("NumFrames", ""), "frames", str(path))
    check_count(len(names), head.get("NumMarkers", ""), "markers", str(path))
    factor = si_factor(head.get("Units", "m").strip(), "m", f"{path}:Units")
    return Capture(names, data[:, 1], factor * data[:, 2:].reshape(len(data), -1, 3))


def read_columns(path: str | Path) -> tuple[list[str], Array]:
    """Names of the columns of a MOT file, and its rows. DataError: cut short, or none."""
    lines = text_lines(path)
    stripped = [line.strip().lower() for line in lines]
    if "endheader" not in stripped:
        raise DataError(
            "is not a MOT file, expected a line 'endheader'", str(path), "export the plates again"
        )
    start = stripped.index("endheader") + 1
    head = dict(line.replace(" ", "").split("=", 1) for line in lines[: start - 1] if "=" in line)
    names = lines[start].split() if start < len(lines) else []
    rows = [(n, line.split()) for n, line in enumerate(lines[start + 1 :], start + 2) if line.strip()]
    data = number_rows(rows, len(names), str(path))
    check_count(len(data), head.get("nRows", head.get("datarows", "")), "rows", str(path))
    return names, data


def read_mot(path: str | Path, setting: PlateSetting) -> Plates:
    """Force plates of an OpenSim MOT file. DataError: cut short, or a column of `setting` is missing."""
    names, data = read_columns(path)

    def column(name: str) -> int:
        if name not in names:
            what = f"has no column {name!r}, found {', '.join(names[:4]) or 'no line of names'}, ..."
            raise DataError(what, str(path), "export the plates again, or correct [import.plates]")
        return names.index(name)

    def take(pattern: str) -> Array:
        wanted = [[pattern.format(plate=plate) + axis for axis in "xyz"] for plate in setting.plate]
        return np.stack([data[:, [column(name) for name in plate]] for plate in wanted], 1)

    loads = take(setting.force), take(setting.point), take(setting.moment)
    return Plates(data[:, column("time")], *loads, setting.plate)


def read_c3d(path: str | Path) -> Capture:
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
    data = np.asarray(c3d["data"]["points"], float)[:3].transpose(2, 1, 0)
    names = tuple(str(name) for name in point["LABELS"]["value"])[: data.shape[1]]  # others have no track
    data = data[:, : len(names)]
    lost = np.asarray(c3d["data"]["meta_points"]["residuals"])[0].T[:, : len(names)] < 0
    factor = si_factor(str(first_of(point, "UNITS", path)), "m", f"{path}:POINT:UNITS")
    frame = np.arange(len(data)) + c3d["header"]["points"]["first_frame"]
    time = frame / float(first_of(point, "RATE", path))
    start = time[0] if len(time) else 0.0
    analog = c3d_analog(c3d, path, start)
    plates, said = c3d_plates(ezc3d, c3d, path, start)
    taken = 0 if plates is None else int(np.size(c3d["parameters"]["FORCE_PLATFORM"]["CHANNEL"]["value"]))
    count = 0 if analog is None else len(analog.values)
    left = [f"{count - taken} analog channels"] if count > taken else []
    position = np.where(lost[..., None], np.nan, factor * data)
    return Capture(names, time, position, left_out=(*left, *said), plates=plates, analog=analog)


def c3d_analog(c3d: Any, path: str | Path, start: float) -> Channels | None:
    """The analog channels of a C3D file by their labels, in their units; None where there are none."""
    read = np.asarray(c3d["data"]["analogs"], float)[0]
    if not read.size:
        return None
    group = c3d["parameters"]["ANALOG"]
    labels = [str(name) for name in group["LABELS"]["value"]][: len(read)]
    units = [str(name) for name in group["UNITS"]["value"]] if "UNITS" in group else []
    clock = start + np.arange(read.shape[1]) / float(first_of(group, "RATE", path))
    return Channels(
        str(path), "analog channel", dict(zip(labels, read, strict=False)),
        dict(zip(labels, units, strict=False)), dict.fromkeys(labels, clock),
    )  # fmt: skip


def first_of(group: Any, name: str, path: str | Path) -> Any:
    """The first value of a parameter of a C3D file; a DataError where it has none."""
    values: Any = group[name]["value"] if name in group else []
    if not len(values):
        raise DataError("holds no value, expected one", f"{path}:{name}", "export the markers again")
    return values[0]


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


def c3d_plates(ezc3d: Any, c3d: Any, path: str | Path, start: float) -> tuple[Plates | None, tuple[str, ...]]:
    """The force plates of a C3D file as ezc3d reads them, moments about their middles; why not, in words."""
    known = c3d["parameters"].get("FORCE_PLATFORM", {})
    used = int(sum(known["USED"]["value"][:1])) if "USED" in known else 0
    if not used:
        return None, ()
    try:
        found = ezc3d.c3d(str(path), extract_forceplat_data=True)["data"]["platform"]
    except (OSError, RuntimeError, ValueError, IndexError) as e:
        return None, (f"{used} force plates ({' '.join(str(e).split())[:120]})",)
    rate, where = float(first_of(c3d["parameters"]["ANALOG"], "RATE", path)), f"{path}:FORCE_PLATFORM"
    force, point, moment = [], [], []
    for plate in found:
        newton = si_factor(plate["unit_force"] or "N", "N", where)
        meter = si_factor(plate["unit_position"] or "m", "m", where)
        force.append(newton * np.asarray(plate["force"]).T)
        moment.append(newton * meter * np.asarray(plate["moment"]).T)
        point.append(np.broadcast_to(meter * np.mean(plate["corners"], axis=1), force[-1].shape))
    time = start + np.arange(len(force[0])) / rate
    names = tuple(str(k + 1) for k in range(used))
    return Plates(time, np.stack(force, 1), np.stack(point, 1), np.stack(moment, 1), names), ()
