"""A partitioned system of the body of a motion file. Source: principal equations 2.7."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forceid.config import PartSetting, load_settings
from forceid.errors import ConfigError, DataError
from forceid.files import read_motion, recording_from_tree
from forceid.partition.assembled import from_assembled
from forceid.partition.system import PartitionedSystem

if TYPE_CHECKING:
    import xarray as xr


def from_motion_file(
    source: xr.DataTree | str | Path,
    parts: Mapping[str, Iterable[str | int]] | Sequence[PartSetting] | str | Path,
    fixed: Iterable[str | int] = (),
) -> PartitionedSystem:
    """The system of the stiffness, mass and reference shape in /body, where its parts touch through nodes.

    source: a motion file, or its tree; parts: the nodes of every part, by name or number, as the tables
    [[part]] of a configuration (name and nodes are used), its path, or a mapping. Nodes where parts meet are
    named in each of them. fixed: nodes held. What an assembled stiffness tells of its parts, and what not:
    `from_assembled`. Raises DataError, ConfigError.
    """
    if isinstance(parts, str | Path):
        path, parts = parts, load_settings(parts).part
        if not parts:
            raise ConfigError("holds no [[part]]", str(path), "add one for each part, with name and nodes")
    if not isinstance(parts, Mapping):
        parts = {part.name: part.nodes for part in parts}
    is_path = isinstance(source, str | Path)
    where = f"{source}:/body" if is_path else "/body"
    body = (read_motion(source) if is_path else recording_from_tree(source)).body  # type: ignore[arg-type]
    if body.stiffness is None or body.position is None:
        lacking = "stiffness" if body.stiffness is None else "position"
        raise DataError("is missing, expected for parts that deform", f"{where}/{lacking}", "add it")
    mass: Any = body.mass if body.mass is not None else body.mass_matrix
    try:
        return from_assembled(body.stiffness, mass, parts, body.position, fixed, body.node or None)
    except DataError as e:
        inside = e.where.removeprefix("assembled ")
        raise DataError(e.what, f"{where}/{inside}" if inside != e.where else e.where, e.next_step) from e
