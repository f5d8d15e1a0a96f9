"""Named channels of a file as stored: CSV columns, MAT variables and fields, UFF functions, TDMS channels."""

from __future__ import annotations

import difflib
import re
import warnings
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from forceid.errors import ConfigError, DataError, ForceIdError
from forceid.records import Array


@dataclass(frozen=True)
class Channels:
    """What a file holds by name: numbers (time,), (time, 3), or all nodes in one array.

    unit: what the file says of a channel, None where its format has no place for units. time: the clock
    (time,) s of a channel, where the format has clocks. geometry: places (3,) of nodes in geometry_unit.
    label: lists of names. noun: what the format calls a channel; table: where the settings name them.
    sensor: by variable of /motion and by sensor, the three channels that the format itself says read it.
    """

    where: str
    noun: str
    values: Mapping[str, Array]
    unit: Mapping[str, str] | None = None
    time: Mapping[str, Array] = field(default_factory=dict)
    geometry: Mapping[str, Array] = field(default_factory=dict)
    geometry_unit: str = ""
    label: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    table: str = "import.channels"
    sensor: Mapping[str, Mapping[str, tuple[str, ...]]] = field(default_factory=dict)


@contextmanager
def reading(path: str | Path, kind: str) -> Iterator[None]:
    """Whatever a reader of `kind` files raises, as one DataError; its warnings are silenced."""
    if not Path(path).is_file():
        raise DataError("cannot be read (no such file)", str(path), f"give the path of a {kind} file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except ForceIdError:
        raise
    except Exception as e:  # a wrong byte leads readers into any error there is
        said = " ".join(f"{type(e).__name__}: {e}".split())[:160]
        raise DataError(f"is not a whole {kind} file ({said})", str(path), "export or copy it again") from e


def optional(package: str, extra: str, path: str | Path) -> Any:
    """The module of an optional extra. ConfigError: it is not installed."""
    try:
        return import_module(package)
    except ImportError as e:
        next_step = f"install it: pip install 'forceid[{extra}]'"
        raise ConfigError(f"needs the package {package}", str(path), next_step) from e


def raw(channels: Channels, name: str) -> Array:
    """The numbers of a channel, or of a part of it as MATLAB writes it, `q(:,2)`. DataError: no such name."""
    values = channels.values
    if name in values:
        return np.asarray(values[name])
    if base_of(name) in values:
        return indexed_part(np.asarray(values[base_of(name)]), name, channels.where)
    what, hint = f"has no {channels.noun} {name!r}", nearest_names(name, values)
    raise DataError(what, channels.where, hint)


def base_of(name: str) -> str:
    """The channel that a part is of.

    >>> base_of("q(:,2)"), base_of("s(2).q")
    ('q', 's(2).q')
    """
    return re.sub(r"\([:\d,\s]+\)$", "", name)


def indexed_part(values: Array, name: str, where: str = "") -> Array:
    """A part of an array as MATLAB writes it: colons keep an axis, numbers count from one.

    >>> indexed_part(np.array([[1.0, 2.0], [3.0, 4.0]]), "q(:,2)")
    array([2., 4.])
    """
    items = [item.strip() for item in name[len(base_of(name)) + 1 : -1].split(",")]
    sizes = zip(items, values.shape, strict=False)
    if len(items) != values.ndim or not all(i == ":" or (i.isdigit() and 0 < int(i) <= n) for i, n in sizes):
        what = f"is no part of an array of {shape_of(values)}"
        raise DataError(what, f"{where}:{name}", "correct the index, which counts from one")
    return np.asarray(values[tuple(slice(None) if item == ":" else int(item) - 1 for item in items)])


def shape_of(values: Array) -> str:
    """A shape in words."""
    return " x ".join(map(str, values.shape)) or "one number"


def nearest_names(name: str, known: Collection[str]) -> str:
    """What to say beside a name that is not there: the nearest that are."""
    near = difflib.get_close_matches(name, list(known), n=3, cutoff=0.0)
    return f"did you mean {' or '.join(map(repr, near))}?" if near else "export it again, with data"
