"""The import settings that a file needs, as commented TOML: what it says is filled in, the rest is nan."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from forceid.errors import ConfigError
from forceid.files.formats.bodies.marker_sets import marker_set
from forceid.files.formats.captures.capture import Capture
from forceid.files.formats.captures.table import FORMATS, Format, format_of
from forceid.files.formats.channels import Channels, shape_of
from forceid.files.formats.columns import (
    SHOWN,
    group_of,
    key,
    patterned,
    short_names,
    unit_line,
    variables_of,
)
from forceid.files.formats.csv import CsvTable, read_csv
from forceid.files.formats.logs.table import LOGS, log_of

TURN = re.compile(r"(?:.*[ _.:\-/])?(?:q|quat_?|rot_?|orientation[_.]?)(?P<axis>[xyzwXYZW])")
CLOCK = re.compile(r"(?:t|time|timestamp|seconds)(?:[ _(\[].*)?", re.I)
BODY = "[import.body]"
GRAVITY = {"z": "[0.0, 0.0, -9.81]", "y": "[0.0, -9.81, 0.0]"}


def proposal(
    sources: Sequence[Path], tables: Mapping[str, Callable[[Path], Channels]], config: str = ""
) -> str:
    """The TOML text for the first of some files; `tables` reads those that are no captures, by ending.

    ConfigError: a file that begins as none that is known. DataError: not whole.
    """
    path = sources[0]
    form = format_of(path)
    if form is not None:
        capture = form.read(path)
        said = [f"# {path.name}: {form.name}, {held(capture)}"]
        said += [f"# left out: {what}" for what in capture.left_out]
        lines = of_capture(capture, form)
    elif (log := log_of(path)) is not None:
        channels = log.read(path)
        said = [f"# {path.name}: {log.name}, {len(channels.values)} channels"]
        lines = of_log(channels)
    elif path.suffix.lower() in tables:
        channels = tables[path.suffix.lower()](path)
        said = [f"# {path.name}: {len(channels.values)} channels; the settings say which is what"]
        lines = of_channels(channels, "channels")
    elif path.suffix.lower() in (".csv", ".tsv", ".txt"):
        delimiter = likely_delimiter(path)
        table = read_csv(path, delimiter)
        channels = Channels(str(path), "column", CsvTable(table, str(path)))
        said = [f"# {path.name}: a table of {len(table)} columns, which has no units"]
        lines = of_channels(channels, "csv")
        lines[3:3] = [] if delimiter == "," else [f"delimiter = {json.dumps(delimiter)}"]
    else:
        known = ", ".join([*(one.name for one in (*FORMATS, *LOGS)), "csv", *(key[1:] for key in tables)])
        raise ConfigError(f"begins as no known format, expected {known}", str(path), "convert it first")
    names = " ".join(source.name for source in sources)
    use = f"#   forceid import {names} -o {path.stem}.h5 -c {config or f'{path.stem}.toml'}"
    return "\n".join([*said, "# Fill in what is nan, then", use, "", *lines]) + "\n"


def held(capture: Capture) -> str:
    """What a capture holds, in words."""
    time = capture.time
    rate = 1 / np.median(np.diff(time)) if len(time) > 1 else np.nan
    parts = [f"{len(capture.name)} markers"] if capture.name else []
    parts += [f"pose of {', '.join(capture.pose)}"] if capture.pose else []
    return f"{' and '.join(parts) or 'nothing'}, {len(time)} frames at {rate:.6g} Hz"


def of_capture(capture: Capture, form: Format) -> list[str]:
    """The settings of markers, or of the pose of a body."""
    lines = ["[import]", gravity(form.up), ""]
    if capture.name:
        known = marker_set(capture.name)
        lines += masses(capture.name) if known is None else person(known.name)
        if capture.plates is not None:
            names = ", ".join(capture.plates.name)
            lines += ["", f"# force plates {names}, to compare with:", "# [import.plates]"]
            lines += ["# known = []  # of these: loads beside which the others are found"]
        if capture.pose:
            body = next(iter(capture.pose))
            lines += ["", "# or the pose of a body, in place of its markers:", "# [import.capture]"]
            lines += [f"# body = {json.dumps(body)}", '# use = "pose"', *(f"# {line}" for line in rigid())]
        return lines
    if len(capture.pose) > 1:
        names = ", ".join(capture.pose)
        lines += ["[import.capture]", f"body = {json.dumps(next(iter(capture.pose)))}  # of {names}", ""]
    return lines + rigid()


def of_log(channels: Channels) -> list[str]:
    """The settings of a log, which says itself what reads force and turn."""
    lines = ["[import]", gravity("z"), "", "[import.channels]  # what it takes, without this table too"]
    for variable, sensors in channels.sensor.items():
        for name, columns in sensors.items():
            stated = (channels.unit or {}).get(columns[0])
            lines.append(f"{variable}.{name} = {json.dumps(list(columns))}")
            lines += [] if stated else [f"units.{variable} = nan  # counts, in a log without units"]
    names = dict.fromkeys(name for sensors in channels.sensor.values() for name in sensors)
    places = [f"{name} = [0.0, 0.0, 0.0]" for name in names]
    return [*lines, "", *rigid(), f"sensor_position = {{ {', '.join(places)} }}  # m, in the same axes"]


def person(markers: str) -> list[str]:
    """The lines of a person whose markers are of a set that is known."""
    return [
        "[import.body]",
        f'table = "winter"  # or "de_leva", "dempster": segments of a person; the markers are {markers}',
        "mass = nan  # kg",
        "height = nan  # m",
        '# sex = "female"  # or "male", for de_leva',
        '# ends.left_knee = ["MARKER", "MARKER"]  # in whose middle a point lies, in place of the set',
    ]


def gravity(up: str) -> str:
    """The line of gravity."""
    other = GRAVITY["y" if up == "z" else "z"]
    return f"gravity = {GRAVITY[up]}  # m/s2, world axes, if {up} is up as is usual here; else {other}"


def masses(names: Sequence[str]) -> list[str]:
    """The lines of the mass at every marker, and those of a rigid body in their place."""
    pairs = [f"{key(name)} = nan" for name in names]
    note = "# kg that each stands for; 0 for one that carries none"
    if len(names) <= SHOWN:
        lines = [BODY, f"mass = {{ {', '.join(pairs)} }}  {note}"]
    else:
        lines = [f"[import.body.mass]  {note}", *pairs]
    return [
        *lines,
        "# a rigid body known as a whole has total_mass, mass_center, inertia and position in place of mass,",
        "# a body of segments [[import.segment]]: see docs/laboratories.md",
    ]


def rigid() -> list[str]:
    """The lines of a rigid body known as a whole."""
    return [
        BODY,
        "total_mass = nan  # kg",
        "mass_center = [0.0, 0.0, 0.0]  # m, from the tracked origin, in the axes of the body",
        "inertia = [[nan, 0.0, 0.0], [0.0, nan, 0.0], [0.0, 0.0, nan]]  # kg m2, about the mass center",
    ]


def of_channels(channels: Channels, table: str) -> list[str]:
    """The settings of named columns or channels: places, turns, accelerations, times."""
    names = list(channels.values)
    lines = ["[import]", gravity("z"), f"[import.{table}]"]
    time = next((name for name in names if CLOCK.fullmatch(name)), None)
    turn = {m["axis"].lower(): n for n in names if (m := TURN.fullmatch(n))}
    read = variables_of(channels, [name for name in names if name not in turn.values()])
    places, sensors = read.get("displacement") or read.get("position") or {}, read.get("specific_force") or {}
    pose = len(turn) == 4 and len(places) == 1 and not sensors
    used = {time, *(name for points in read.values() for axes in points.values() for name in axes)}
    used |= set(turn.values()) if pose else set()
    if time is not None:
        lines.append(f"time = {json.dumps(time)}")
    elif not channels.time:
        lines.append("rate = nan  # Hz; or time, the name of the one that holds the times")
    if pose:
        center = next(iter(places.values()))
        lines += [f"center = {json.dumps(center)}", *unit_line("center", center[0])]
        lines += [f"orientation = {json.dumps([turn[axis] for axis in 'xyzw'])}  # body to world"]
    else:
        lines += [line for variable, points in read.items() for line in patterned(variable, points)]
    if not read:
        lines += SENSORS
    if channels.unit is None:
        unit = 'position = "mm"' if places else 'specific_force = "g"'
        lines.append(f"# units.{unit}  # of a variable, where it is not in SI")
    rest = [name for name in names if name not in used]
    if table == "csv" and time is not None and (group := group_of(channels, time, rest)):
        lines.append(f"group = {json.dumps(group)}  # a recording each; select = [...] takes some")
        rest.remove(group)
    lines += [f"# not used: {described(channels, name)}" for name in rest[:SHOWN]]
    lines += [f"# and {len(rest) - SHOWN} more"] if len(rest) > SHOWN else []
    of_body = masses(short_names(places)) if places and not pose else rigid()
    if sensors and not channels.geometry.keys() >= set(short_names(sensors)):
        where = ", ".join(f"{key(name)} = [nan, nan, nan]" for name in short_names(sensors))
        first = of_body[:1] if of_body[0] == BODY else []  # a table of masses has a head of its own
        of_body[: len(first)] = [BODY, f"sensor_position = {{ {where} }}  # m, in the same axes"]
    return [*lines, "", *of_body]


SENSORS = (
    '# position = "{name} {axis}"  # the pattern of the names of x, y and z of every point',
    '# specific_force = { imu = ["ax", "ay", "az"] }',
    '# angular_velocity = { imu = ["gx", "gy", "gz"] }',
)


def described(channels: Channels, name: str) -> str:
    """A channel in words: its name, and where it is no plain column its size and unit."""
    unit = (channels.unit or {}).get(name, "")
    if isinstance(channels.values, CsvTable):
        return name
    return f"{name}, {shape_of(np.asarray(channels.values[name]))}{f', {unit}' if unit else ''}"


def likely_delimiter(path: Path) -> str:
    """Which of comma, semicolon and tab the first line has most of."""
    with open(path, encoding="utf-8-sig", errors="replace") as f:
        first = f.readline()
    return max(",;\t", key=first.count)
