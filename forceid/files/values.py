"""Values of a file as they are stored: unpacked, told by type, and named."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.memory import memory_limit
from forceid.records import Array, Variable

_SHOWN = 12  # names in a line
NC_FILL = 9.969209968386869e36  # what netCDF leaves where nothing was written


@dataclass(frozen=True)
class Stored:
    """A group as found: variables of h5py or xarray (.dtype .shape .attrs, not read yet) and attributes."""

    variables: Mapping[str, Any]
    attrs: Mapping[str, Any]
    found: tuple[str, ...]  # every name in the group, known or not


def read_real(source: Any, spec: Variable, sizes: dict[str, int], where: str) -> Array:
    """One variable as float64; type, shape and size are judged by its declaration, before it is read."""
    if not hasattr(source, "dtype"):
        raise DataError("is a group, expected a variable", where, "rename the group")
    if source.dtype.kind not in "fiu":
        raise DataError(f"holds {kind_of(source.dtype)}, expected real numbers", where, "write it as float64")
    for dim, n in zip(spec.dims, source.shape, strict=False):
        sizes.setdefault(dim.removesuffix("_2"), n)
    if "node" in sizes:
        with_rotations = spec.dims == ("dof", "dof_2") and source.shape == (6 * sizes["node"],) * 2
        sizes["dof"] = (6 if with_rotations else 3) * sizes["node"]
    expected = tuple(sizes[d.removesuffix("_2")] for d in spec.dims if d.removesuffix("_2") in sizes)
    told = source.shape == expected and len(expected) == len(spec.dims)
    if not told and not (spec.dims == () and source.size == 1):
        wanted = ", ".join(f"{d} = {sizes.get(d.removesuffix('_2'), '?')}" for d in spec.dims)
        raise DataError(
            f"has shape {tuple(map(int, source.shape))}, expected ({wanted})",
            where,
            "check the order of its dimensions",
        )
    if (need := int(np.prod(source.shape, dtype=object)) * 8) > (room := memory_limit()):
        raise DataError(
            f"declares {need / 1e9:.3g} GB, expected at most {room / 1e9:.3g} GB here",
            where,
            "split the recording",
        )
    try:
        return np.asarray(source, dtype=np.float64).reshape(expected)
    except (OSError, RuntimeError) as e:
        raise DataError(f"cannot be read ({e})", where, "restore the file: it is damaged") from e


def unpack(values: Array, attrs: Mapping[str, Any], where: str) -> Array:
    """Fill values to NaN, then scale_factor and add_offset, as netCDF defines them."""
    if np.fmax.reduce(values, axis=None, initial=-np.inf) == NC_FILL:
        values = np.where(values == NC_FILL, np.nan, values)
    for name in ("_FillValue", "missing_value"):
        if name in attrs and not np.isnan(fill := real_attr(attrs[name], where, name)):
            values = np.where(values == fill, np.nan, values)
    if "scale_factor" in attrs:
        values = values * real_attr(attrs["scale_factor"], where, "scale_factor")
    if "add_offset" in attrs:
        values = values + real_attr(attrs["add_offset"], where, "add_offset")
    return values


def labels(group: Stored, dim: str) -> tuple[str, ...]:
    """The names along a dimension of a group, none where it has none."""
    return tuple(text(name) for name in np.asarray(group.variables.get(dim, ())).ravel())


def canonical(q: Array) -> Array:
    """Quaternions with w >= 0 and unit norm, where they are near it: the rest is left to the checks."""
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    off = (np.abs(norm - 1) > 1e-12) & (np.abs(norm - 1) < 0.01)
    return np.where(q[..., 3:] < 0, -1.0, 1.0) * q / np.where(off, norm, 1.0)


def real_attr(value: Any, where: str, name: str) -> float:
    """An attribute that must be one real number."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.size != 1:
        raise DataError(f"has {name} {value!r}, expected one number", where, f"correct the attribute {name}")
    return float(array.reshape(()))


def text(value: Any) -> str:
    """A string attribute, however HDF5 stored it."""
    if isinstance(value, np.ndarray):
        value = value.reshape(-1)[0] if value.size else ""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def kind_of(dtype: np.dtype[Any]) -> str:
    """The plain word for a type that is not real numbers."""
    words = {
        "c": "complex numbers",
        "S": "text",
        "U": "text",
        "O": "text or objects",
        "b": "booleans",
        "V": "compound records",
        "M": "dates",
        "m": "durations",
    }
    return words.get(dtype.kind, str(dtype))


def likeliest_name(name: str, found: Sequence[str], otherwise: str = "add it") -> str:
    """The next step when a variable is missing: the likeliest misspelling, or what is there."""
    near = difflib.get_close_matches(name, found, n=1)
    there = ", ".join(found[:_SHOWN]) + (f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else "")
    return f"did you mean {near[0]!r}?" if near else f"{otherwise}; found {there or 'nothing'}"
