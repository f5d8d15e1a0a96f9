"""What the columns and channels of a table are, by their names, their units and what they read."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.constants import g as standard_gravity

from forceid.errors import DataError
from forceid.files.formats.channels import Channels
from forceid.files.units import si_factor
from forceid.records import Array

POINT = re.compile(
    r"(?P<name>.*?)(?P<between>[ _.:\-/]?)(?P<axis>[xyz])"
    r"(?P<end>[ _]?[(\[][^()\[\]]+[)\]]|[ _](?:mm|cm|m|g))?",
    re.IGNORECASE,
)  # of hip_x, hip x (mm), x_m
OFFSET = 0.1  # of the weight: accelerometers of phones read as much amiss (data sheets: 50 to 100 mg)
SHOWN = 12  # names in a comment, or masses in a line


def triples(names: Sequence[str]) -> dict[str, list[str]]:
    """The names of x, y and z of every point that has all three."""
    found: dict[str, dict[str, str]] = {}
    for name in names:
        if match := POINT.fullmatch(name):
            found.setdefault(match["name"], {})[match["axis"].lower()] = name
    return {n or "body": [a[axis] for axis in "xyz"] for n, a in found.items() if a.keys() == set("xyz")}


def unit_in(name: str) -> str:
    """The unit that a name ends with, as hip_x_mm and ax (g); none where it names none.

    >>> unit_in("hip_x_mm"), unit_in("ax (m/s^2)"), unit_in("hip x")
    ('mm', 'm/s^2', '')
    """
    match = POINT.fullmatch(name)
    return "" if match is None or match["end"] is None else match["end"].strip(" _()[]")


def common_path(names: Sequence[str]) -> str:
    """What groups and types all names begin with.

    >>> common_path(["acceleration.1", "acceleration.2"]), common_path(["left toe", "left heel"])
    ('acceleration.', '')
    """
    first = names[0] if names else ""
    paths = (first[: k + 1] for k, sign in enumerate(first) if sign in "./")
    return max((path for path in paths if all(name.startswith(path) for name in names)), key=len, default="")


def variables_of(channels: Channels, names: Sequence[str]) -> dict[str, dict[str, list[str]]]:
    """By variable of /motion the names of x, y and z of every point that has all three.

    Accelerometers are those whose units or names say so; or all, where no unit is stated and all read the
    weight, as no place does.
    """
    found: dict[str, dict[str, list[str]]] = {}
    for point, axes in triples(names).items():
        unit = (channels.unit or {}).get(axes[0], "") or unit_in(axes[0])
        if point.lower().startswith("velocity"):
            continue
        told = converts(unit, "m s-2") if unit else "acc" in axes[0].lower()
        place = "displacement" if point.lower().startswith("displacement.") else "position"
        found.setdefault("specific_force" if told else place, {})[point] = axes
    if found.keys() == {"position"} and channels.unit is None:
        every = [one for axes in found["position"].values() for one in axes]
        means = np.reshape([np.nanmean(column_numbers(channels, one)) for one in every], (-1, 3))
        if np.all(np.abs(np.linalg.norm(means, axis=1) / standard_gravity - 1) < OFFSET):
            found["specific_force"] = found.pop("position")
    return found


def column_numbers(channels: Channels, name: str) -> Array:
    """The numbers of a channel; of one that holds text, zeros."""
    try:
        return np.asarray(channels.values[name], float)
    except DataError:
        return np.zeros(2)


def group_of(channels: Channels, time: str, others: Sequence[str]) -> str:
    """The column that changes where the clock goes back, and nowhere else; none where the clock does not."""
    back = np.diff(column_numbers(channels, time)) <= 0
    if not back.any():
        return ""
    marks = ((name, column_numbers(channels, name)) for name in others)
    return next((name for name, at in marks if np.array_equal(at[1:] != at[:-1], back)), "")


def short_names(points: Mapping[str, Sequence[str]]) -> list[str]:
    """The names of points without what all begin with."""
    return [name.removeprefix(common_path([*points])) for name in points]


def converts(unit: str, expected: str) -> bool:
    """Whether a unit is one of what is expected."""
    try:
        return si_factor(unit, expected) > 0
    except DataError:
        return False


def unit_line(variable: str, column: str) -> list[str]:
    """The line of the unit that a column names; none where it names no unit of the variable."""
    unit = unit_in(column)
    told = bool(unit) and converts(unit, "m s-2" if variable == "specific_force" else "m")
    return [f"units.{variable} = {json.dumps(unit)}"] if told else []


def patterned(variable: str, points: Mapping[str, Sequence[str]]) -> list[str]:
    """The lines of a variable of points: one pattern where one finds them all, else each; and its unit."""
    path, short = common_path([*points]), short_names(points)
    first = POINT.fullmatch(next(iter(points.values()))[0])
    assert first is not None
    form = f"{path}{{name}}{first['between']}{{axis}}{first['end'] or ''}"
    each = list(zip(short, points.values(), strict=True))
    lines = [f"{variable}.{key(name)} = {json.dumps(list(axes))}" for name, axes in each]
    if all(axes[0].lower() == form.format(name=name, axis="x").lower() for name, axes in each):
        lines = [f"{variable} = {json.dumps(form)}  # {', '.join(short[:SHOWN])}"]
    return lines + unit_line(variable, each[0][1][0])


def key(name: str) -> str:
    """A key of TOML."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)
