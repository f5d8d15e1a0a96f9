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

POINT = re.compile(r"(?P<name>.+?)(?P<between>[ _.:\-/]?)(?P<axis>[xyzXYZ])")
OFFSET = 0.1  # of the weight: accelerometers of phones read as much amiss (data sheets: 50 to 100 mg)
SHOWN = 12  # names in a comment, or masses in a line


def triples(names: Sequence[str]) -> dict[str, list[str]]:
    """The names of x, y and z of every point that has all three."""
    found: dict[str, dict[str, str]] = {}
    for name in names:
        if match := POINT.fullmatch(name) or re.fullmatch(r"(?P<name>)(?P<between>)(?P<axis>[xyzXYZ])", name):
            found.setdefault(match["name"], {})[match["axis"].lower()] = name
    return {n or "body": [a[axis] for axis in "xyz"] for n, a in found.items() if a.keys() == set("xyz")}


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
        unit = (channels.unit or {}).get(axes[0], "")
        if point.lower().startswith("velocity"):
            continue
        told = is_acceleration(unit) if unit else "acc" in axes[0].lower()
        place = "displacement" if point.lower().startswith("displacement.") else "position"
        found.setdefault("specific_force" if told else place, {})[point] = axes
    if found.keys() == {"position"} and channels.unit is None:
        every = [one for axes in found["position"].values() for one in axes]
        means = np.reshape([np.nanmean(np.asarray(channels.values[one], float)) for one in every], (-1, 3))
        if np.all(np.abs(np.linalg.norm(means, axis=1) / standard_gravity - 1) < OFFSET):
            found["specific_force"] = found.pop("position")
    return found


def named(points: Mapping[str, Sequence[str]]) -> list[str]:
    """The names of points without what all begin with."""
    return [name.removeprefix(common_path([*points])) for name in points]


def is_acceleration(unit: str) -> bool:
    """Whether a unit is one of acceleration."""
    try:
        return si_factor(unit, "m s-2") > 0
    except DataError:
        return False


def patterned(variable: str, points: Mapping[str, Sequence[str]]) -> list[str]:
    """The lines of a variable of points: one pattern where one finds them all, else each."""
    path, short = common_path([*points]), named(points)
    for between in ("", " ", "_", ".", ":", "-", "/"):
        if all(axes[0].lower() == f"{name}{between}x".lower() for name, axes in points.items()):
            return [f'{variable} = "{path}{{name}}{between}{{axis}}"  # {", ".join(short[:SHOWN])}']
    each = zip(short, points.values(), strict=True)
    return [f"{variable}.{key(name)} = {json.dumps(list(axes))}" for name, axes in each]


def key(name: str) -> str:
    """A key of TOML."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)
