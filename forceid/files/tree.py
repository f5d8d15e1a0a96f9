"""The same files as xarray trees: what a user of Python sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr

from forceid.files.parse import Stored, parse_recording
from forceid.files.schema import MATERIAL, Group, estimate_groups, hash_arrays, motion_groups
from forceid.files.stored.hdf5 import read_motion
from forceid.records import Estimate, Recording


def open_motion(path: str | Path, gravity: Sequence[float] | None = None) -> xr.DataTree:
    """A motion file as a tree with /body, /motion and, where present, /truth: validated, SI units, in memory.

    `gravity` (3,) m/s2 overrides the file. DataError: not a motion file by the contract.
    """
    return tree_from_recording(read_motion(path, gravity))


def recording_from_tree(tree: xr.DataTree, gravity: Sequence[float] | None = None) -> Recording:
    """The validated recording in a tree; its SHA-256 is that of the arrays. DataError: see open_motion."""
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
    return tree_from_groups(estimate_groups(estimate, recording))


def tree_from_groups(groups: Mapping[str, Group]) -> xr.DataTree:
    """Groups as an xarray tree; variables named as their only dimension become coordinates."""
    found = {}
    for name, group in groups.items():
        fields: dict[str, Any] = {k: (v.dims, v.data, v.attrs) for k, v in group.variables.items()}
        found[f"/{name.strip('/')}"] = xr.Dataset(fields, attrs=group.attrs)
    return xr.DataTree.from_dict(found)
