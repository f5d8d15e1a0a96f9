"""Points of a DataFrame: wide, a column a coordinate, or long, a row a point and time."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from forceid.errors import ConfigError, DataError
from forceid.files.values import likeliest_name
from forceid.records import AXES, Array

PATTERN = r"(?P<name>.+?)(?P<between>[ _.:\-/]?)(?P<axis>[xyzXYZ])"


def columns_of(table: Any, spec: str | Sequence[str], where: str) -> Array:
    """One column (time,) or several (time, column) of a table, as numbers. DataError: no such column."""
    several = [spec] if isinstance(spec, str) else list(spec)
    for name in several:
        if name not in table.columns:
            raise DataError(f"has no column {name!r}", where, likeliest_name(name, names_of(table)))
    values = numbers(table[several], where)
    return values[:, 0] if isinstance(spec, str) else values


def points_of(
    table: Any, time: Any, names: Mapping[str, str], columns: str, posed: bool, where: str
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Times and positions (time, node, 3) that a table holds, by variable, and the names of the nodes.

    posed: whether other variables name their columns, so that none need hold points. A long table has a row
    for each node and time that was seen; what has no row is a gap.
    """
    called = names.get("time", "time") if not isinstance(time, str) else time
    node = names.get("node", "node")
    if called in table.index.names or node in table.index.names:
        table = table.reset_index()
    if table.columns.nlevels > 1:
        table, columns = flattened(table, where), "{name}\t{axis}"
    found = {} if time is None or isinstance(time, str) else {"time": time}
    if node in table.columns:
        return long_points(table, called, node, where)
    if called in table.columns:
        found["time"] = table[called].to_numpy()
        table = table.drop(columns=called)
    elif isinstance(time, str):
        raise DataError(f"has no column {time!r}", where, likeliest_name(time, names_of(table)))
    elif "time" not in found and type(table.index).__name__ != "RangeIndex":
        found["time"] = table.index
    if posed and not columns:
        return found, ()
    groups = grouped(names_of(table), columns, where)
    wide = [numbers(table[list(group)], where) for group in groups.values()]
    return found | {"position": np.stack(wide, 1)}, tuple(groups)


def long_points(table: Any, time: str, node: str, where: str) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The same of a long table: rows in any order, nodes in the order of their first rows."""
    lower = {str(name).lower(): name for name in table.columns}
    axes = [lower[axis] for axis in AXES if axis in lower]
    for name, lacking in ((time, time not in table.columns), ("x", len(axes) < 2)):
        if lacking:
            raise DataError(f"has no column {name!r}", where, likeliest_name(name, names_of(table)))
    if odd := [name for name in table.columns if name not in (time, node, *axes)]:
        what = f"has a column {odd[0]!r}, expected {', '.join(map(str, (time, node, *axes)))} in a long table"
        raise DataError(what, where, f"drop it: drop(columns={odd})")
    times, row = np.unique(table[time].to_numpy(), return_inverse=True)
    every = table[node].astype(str).to_numpy()
    nodes = tuple(dict.fromkeys(every))
    at = np.array([nodes.index(name) for name in every])
    if len(np.unique(row * len(nodes) + at)) < len(table):
        raise DataError("has two rows of one node and time, expected one", where, "drop repeated rows")
    position = np.full((len(times), len(nodes), len(axes)), np.nan)
    position[row, at] = numbers(table[axes], where)
    return {"time": times, "position": position}, nodes


def grouped(columns: Sequence[str], pattern: str, where: str) -> dict[str, list[str]]:
    """The columns of each node in the order x, y, z, by a pattern or as they are written.

    >>> grouped(["tip_y", "tip_x"], "", "")
    {'tip': ['tip_x', 'tip_y']}
    """
    form = PATTERN
    if pattern:
        form = re.escape(pattern).replace(r"\{name\}", "(?P<name>.+)", 1)
        form = form.replace(r"\{axis\}", "(?P<axis>[xyzXYZ])", 1)
    matched = {column: re.fullmatch(form, column) for column in columns}
    found: dict[str, dict[str, str]] = {}
    for column, match in matched.items():
        if match:
            found.setdefault(match["name"], {})[match["axis"].lower()] = column
    if not found:
        next_step = 'say how they are named, as columns="{name}_{axis}"'
        raise DataError(f"has no columns of points, found {', '.join(columns[:6])}", where, next_step)
    if not pattern and (odd := [column for column, match in matched.items() if not match]):
        what = f"has a column {odd[0]!r}, expected coordinates of points and a time"
        raise DataError(what, where, f"name it if it is the time, or drop it: drop(columns={odd})")
    wanted = AXES if any("z" in axes for axes in found.values()) else AXES[:2]
    for name, axes in found.items():
        if lacking := [axis for axis in wanted if axis not in axes]:
            raise DataError(
                f"has no axis {lacking[0]} of {name!r}", where, "complete it, or drop its columns"
            )
    return {name: [axes[axis] for axis in wanted] for name, axes in found.items()}


def flattened(table: Any, where: str) -> Any:
    """A table whose columns have levels, with names and axes in one level."""
    levels = [list(map(str, table.columns.get_level_values(k))) for k in range(table.columns.nlevels)]
    axis = next((k for k, level in enumerate(levels) if {"x", "y"} <= {e.lower() for e in level}), None)
    if axis is None:
        raise DataError("has no level of columns with x, y and z", where, "name the axes so")
    rest = [level for k, level in enumerate(levels) if k != axis]
    varied = [level for level in rest if len(set(level) - {""}) > 1]
    if len(varied) > 1:
        named = ", ".join(level[0] for level in varied)
        raise ConfigError(f"names points by {len(varied)} levels ({named})", where, "select one body")
    point = (varied or rest)[-1]
    if odd := sorted({e for e in levels[axis] if e.lower() not in ("", *AXES)}):
        what = f"has columns {odd[0]!r} beside x, y and z"
        raise DataError(what, where, f"drop them: drop(columns={odd[0]!r}, level={axis})")
    flat = [f"{a}\t{b}" if b else a for a, b in zip(point, levels[axis], strict=True)]
    return table.set_axis(flat, axis=1)


def numbers(table: Any, where: str) -> Array:
    """Columns as float64 (row, column). DataError: they hold text."""
    try:
        return np.asarray(table.to_numpy(dtype=np.float64, na_value=np.nan))
    except (TypeError, ValueError) as e:
        raise DataError(f"holds text ({e}), expected numbers", where, "leave gaps blank or NaN") from e


def names_of(table: Any) -> list[str]:
    """The columns of a table, as text."""
    return [str(name) for name in table.columns]
