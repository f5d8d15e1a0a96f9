"""The same files as xarray trees: what a user of Python sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import forceid
from forceid.errors import DataError
from forceid.files.accessor import Accessor
from forceid.files.parse import parse_recording
from forceid.files.schema import MATERIAL, Field, Group, estimate_groups, hash_arrays, motion_groups
from forceid.files.stored.hdf5 import read_motion
from forceid.files.stored.netcdf import write_groups
from forceid.files.values import Stored
from forceid.records import Estimate, Recording

xr.register_datatree_accessor("forceid")(Accessor)  # type: ignore[no-untyped-call]


def open_motion(path: str | Path, gravity: Sequence[float] | None = None) -> xr.DataTree:
    """A motion file as a tree with /body, /motion and, where present, /truth: validated, SI units, in memory.

    `gravity` (3,) m/s2 overrides the file. DataError: not a motion file by the contract.
    """
    return tree_from_recording(read_motion(path, gravity))


def import_(
    sources: str | Path | Sequence[str | Path], config: str | Path | None = None, **settings: Any
) -> dict[str, xr.DataTree]:
    """The motions in the files of a laboratory, by name, as `forceid import` writes them: trees, SI units.

    config: a TOML file with the table [import]; settings: keys of that table that override it, as
    `gravity=[0.0, 0.0, -9.81]`. One motion a capture, or a group of a CSV file that is parted. DataError,
    ConfigError: see `forceid import`.
    """
    from forceid.files.formats.sources import import_sources, load_import_settings  # scipy and pydantic

    paths = [sources] if isinstance(sources, (str, Path)) else list(sources)
    recordings = import_sources(paths, load_import_settings(config, **settings))
    return {name: tree_from_recording(recording) for name, recording in recordings}


def save(tree: xr.DataTree, path: str | Path) -> Path:
    """Write a motion or a result as the file that the commands read; it appears whole or not at all.

    DataError: a motion that is none by the contract. ConfigError: not writable.
    """
    if "estimate" not in tree.children:
        write_groups(path, motion_groups(recording_from_tree(tree)))
        return Path(path)
    groups = {"/": Group({}, {str(k): v for k, v in tree.attrs.items()})}
    for node in tree.descendants:
        fields = {
            str(name): Field(tuple(map(str, v.dims)), np.asarray(v.values), dict(v.attrs))
            for name, v in node.variables.items()
        }
        groups[node.path.strip("/")] = Group(fields, {str(k): v for k, v in node.attrs.items()})
    write_groups(path, groups)
    return Path(path)


def recording_from_tree(tree: xr.DataTree, gravity: Sequence[float] | None = None) -> Recording:
    """The validated recording in a tree; its SHA-256 is that of the arrays. DataError: see open_motion."""
    if not isinstance(tree, xr.DataTree):
        what = f"is of type {type(tree).__name__}, expected a motion, as forceid.motion makes one"
        if isinstance(tree, (str, Path)):
            raise DataError(what, "tree", f"open it: forceid.open_motion({str(tree)!r})")
        raise DataError(what, "tree", "build it: forceid.motion(position, time, mass=..., gravity=...)")
    groups = {name: tree_group(node) for name, node in tree.children.items()}
    if "body" in groups and (material := tree.children["body"].children.get("material")) is not None:
        groups[MATERIAL] = tree_group(material)
    where = tree.name or "tree"
    recording = parse_recording(groups, {str(k): v for k, v in tree.attrs.items()}, where, gravity=gravity)
    return replace(recording, sha256=hash_arrays(motion_groups(recording)))


def tree_group(node: xr.DataTree) -> Stored:
    """A node of the tree as the parser takes it."""
    variables = {str(k): v for k, v in node.variables.items()}
    return Stored(variables, {str(k): v for k, v in node.attrs.items()}, tuple(variables))


def tree_from_recording(recording: Recording) -> xr.DataTree:
    """A recording as the tree that xarray shows of its motion file."""
    return tree_from_groups(motion_groups(recording))


def tree_from_estimate(estimate: Estimate, recording: Recording | None = None) -> xr.DataTree:
    """An estimate as the tree that xarray shows of its result file."""
    return tree_from_groups(estimate_groups(estimate, recording), ResultTree)


class ResultTree(xr.DataTree):  # type: ignore[no-untyped-call]
    """A result as a tree: a notebook shows its verdict and numbers before what it holds."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        held: str = super()._repr_html_()  # type: ignore[no-untyped-call]
        if "estimate" not in self.children:
            return held
        said: str = forceid.headline(self)._repr_html_()
        return f"{said}<details><summary>All it holds</summary>{held}</details>"


def tree_from_groups(groups: Mapping[str, Group], kind: type[xr.DataTree] = xr.DataTree) -> xr.DataTree:
    """Groups as an xarray tree; variables named as their only dimension become coordinates."""
    found = {}
    for name, group in groups.items():
        fields: dict[str, Any] = {k: (v.dims, v.data, v.attrs) for k, v in group.variables.items()}
        found[f"/{name.strip('/')}"] = xr.Dataset(fields, attrs=group.attrs)
    return kind.from_dict(found)
