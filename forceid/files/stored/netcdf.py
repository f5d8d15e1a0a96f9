"""HDF5 files that are netCDF-4: groups with dimension scales, written with h5py."""

from __future__ import annotations

import io
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from forceid import __version__
from forceid.files.schema import Group
from forceid.files.stored.atomic import atomic

PROPERTIES = np.bytes_(
    f"version=2,forceid={__version__},hdf5={h5py.version.hdf5_version},h5py={h5py.__version__}"
)  # what netCDF-4 asks a file to say of the libraries that made it
NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable.{:10d}"  # words of netCDF-4, and a size


def write_groups(path: str | Path, groups: Mapping[str, Group]) -> None:
    """Groups as netCDF-4: dimension scales, attributes, text as UTF-8 strings. ConfigError: not writable.

    Made in memory, then written: HDF5 on a full disk ends the process.
    """
    whole = io.BytesIO()
    with h5py.File(whole, "w", track_order=True) as f:  # or else nothing could be added by netCDF-4
        f.attrs["_NCProperties"] = PROPERTIES
        ids = count()
        for name, group in groups.items():
            write_group(f if name == "/" else f.create_group(name, track_order=True), group, ids)
    with atomic(path) as partial:
        partial.write_bytes(whole.getbuffer())


def write_group(node: Any, group: Group, ids: count[int]) -> None:
    """A group: its attributes, its dimensions with the next numbers of the file, and its variables."""
    set_attributes(node, group.attrs)
    sizes = {
        dim: n for item in group.variables.values() for dim, n in zip(item.dims, item.data.shape, strict=True)
    }
    number = dict(zip(sizes, ids, strict=False))
    made, scales = {}, {}
    for name, item in group.variables.items():
        words = {"dtype": h5py.string_dtype()} if item.data.dtype.kind == "U" else {}
        data = item.data.astype(object) if words else item.data
        made[name] = node.create_dataset(name, data=data, track_order=True, **words)
    for dim, n in sizes.items():  # where a dimension has no variable, nothing but its size stands for it
        scales[dim] = made.get(dim) or node.create_dataset(dim, (n,), ">f4", track_order=True)
    for dim, scale in scales.items():
        scale.make_scale(dim if dim in made else NO_VARIABLE.format(sizes[dim]))
        scale.attrs["_Netcdf4Dimid"] = np.int32(number[dim])
    for name, item in group.variables.items():
        variable = made[name]
        if item.dims:
            variable.attrs["_Netcdf4Coordinates"] = np.array([number[dim] for dim in item.dims], np.int32)
        if name not in scales:
            if item.dims:
                variable.attrs["_Netcdf4Dimid"] = np.int32(number[item.dims[0]])
            for axis, dim in enumerate(item.dims):
                variable.dims[axis].attach_scale(scales[dim])
        set_attributes(variable, item.attrs)


def set_attributes(item: Any, attrs: Mapping[str, Any]) -> None:
    """Attributes as netCDF has them: a text, or a row of numbers."""
    for name, value in attrs.items():
        item.attrs[name] = value if isinstance(value, str) else np.atleast_1d(value)
