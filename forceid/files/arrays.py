"""A motion from arrays in memory: of numpy, pandas or xarray, dimensions in any order and by any names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
import xarray as xr

from forceid.errors import ConfigError, DataError
from forceid.files.formats.segments import first_complete, known_name
from forceid.files.parse import parse_recording
from forceid.files.schema import BODY, LABELS, MOTION
from forceid.files.tables import columns_of, points_of
from forceid.files.tree import tree_from_recording
from forceid.files.units import si_factor
from forceid.files.values import Stored
from forceid.records import Variable

WHERE = "arrays"  # what errors call the source
SHAPE = "shape"  # the position of /body, since that of /motion has its name
OF_BODY = {SHAPE: "position"}
KNOWN = {name: spec for name, spec in BODY.items() if name != "position"} | {SHAPE: BODY["position"]} | MOTION
Names = Mapping[str, str]


def motion(
    position: Any = None,
    time: Any = None,
    *,
    gravity: Sequence[float] | None = None,
    rate: float | None = None,
    dims: Sequence[str] = ("time", "node", "axis"),
    names: Names | None = None,
    columns: str = "",
    nodes: Sequence[str] = (),
    units: Names | None = None,
    noise_std: float | Mapping[str, float] | None = None,
    title: str = "",
    **variables: Any,
) -> xr.DataTree:
    """A motion from arrays, as `open_motion` gives one of a file: `estimate` takes it, `save` writes it.

    position: numpy (time, node, 3) m in the order of `dims`; a DataArray, whose dimensions may come in any
    order; a Dataset with variables named as in /motion and /body; or a DataFrame, wide (a column a
    coordinate, as "tip x" or "tip_x", or two levels of columns) or long (a row a node and time, columns x,
    y, z and node). time (time,) s, or datetime64, from whose first the seconds count; left out where the
    data have a clock, as a coordinate, a column or an index; or rate in Hz. gravity (3,) m/s2, world axes:
    it is never assumed.

    variables: all others of /motion and /body by name (mass (node,) kg, shape (node, 3) m, total_mass,
    mass_center, inertia, center, orientation, specific_force, ...); mass and shape also as a mapping by node;
    beside a DataFrame the name or names of its columns. Without a shape it is the first frame that shows all
    nodes. nodes: their names, or which of those that the data name, in which order. names: what the data
    call a dimension, variable or column, as {"node": "marker", "time": "t"}. columns: how a wide table names
    a coordinate, as "{name}_{axis}". units by variable, where they are not SI; noise_std by variable, or of
    the positions. DataError: the data are none by the contract. ConfigError: a name that is not known.

    >>> import forceid, numpy as np
    >>> t = np.arange(50) / 100
    >>> x = np.eye(3) + np.outer(t**2, [0, 0, 1])[:, None]
    >>> forceid.motion(x, t, mass=[0.1, 0.1, 0.2], gravity=[0, 0, -9.81])["motion/position"].dims
    ('time', 'node', 'axis')
    """
    named = dict(names or {})
    for name in (*variables, *(units or ()), *(noise_std if isinstance(noise_std, Mapping) else ())):
        if name not in KNOWN:
            near = get_close_matches(name, KNOWN, n=1, cutoff=0.0)[0]
            raise ConfigError(f"unknown variable {name!r}", "motion:", f"did you mean {near!r}?")
    found, shown = gathered(position, named, columns, variables | {"time": time})
    pull = si(found.pop("gravity", None) if gravity is None else gravity, "m s-2", "gravity")
    found = {name: si(v, KNOWN[name].units, name) for name, v in found.items() if v is not None}
    if pull is None:
        what = "lacks gravity, expected three numbers in m s-2, world axes"
        raise ConfigError(what, "motion:", "add it, for example gravity=[0, 0, -9.81]")
    time = clock(found.pop("time", None), rate, found, named)
    by_node = {name for name in found if is_by_name(found[name], KNOWN[name])}
    fields = {
        name: laid_out(value, KNOWN[name], dims if name == "position" else KNOWN[name].dims, named, name)
        for name, value in found.items()
        if name not in by_node
    } | {"time": time}
    labels = {name: a.attrs.pop("node") for name, a in fields.items() if "node" in a.attrs}
    labels |= {"position": shown} if shown else {}
    node = tuple(map(str, nodes)) or labels.get("position", ()) or next(iter(labels.values()), ())
    for name, own in labels.items():
        if own != node:
            at = [known_name(one, own, f"{WHERE}:{name}") for one in node]
            take = np.take(fields[name], at, KNOWN[name].dims.index("node"))
            fields[name] = field(take, fields[name].attrs)
    for name in fields.keys() & (MOTION.keys() - {"time"}):
        if len(fields[name].shape) and len(fields[name]) != time.size:
            sizes, dims_of = " x ".join(map(str, fields[name].shape)), " x ".join(KNOWN[name].dims)
            what = f"has shape {sizes}, expected {dims_of} with time = {time.size}"
            raise DataError(what, f"{WHERE}:{name}", "say the order with dims, or correct time")
    fields |= {name: by_name(found[name], node, KNOWN[name].dims, name) for name in by_node}
    deviations = noise_std if isinstance(noise_std, Mapping) else {"position": noise_std}
    for key, said in (("units", units or {}), ("noise_std", deviations)):
        for name in said.keys() & fields.keys():
            value = si(said[name], fields[name].attrs.get("units", KNOWN[name].units), name)
            fields[name].attrs |= {key: value} if value is not None else {}
    if "position" in fields and {"mass", "mass_matrix"} & fields.keys() and SHAPE not in fields:
        seen = fields["position"]
        if seen.dtype.kind in "fiu" and seen.ndim == 3:  # else the parser says what it is
            shape = first_complete(seen.values.astype(float), WHERE)
            fields[SHAPE] = field(shape, {k: v for k, v in seen.attrs.items() if k == "units"})
    fields |= {"node": field(node, {})} if node else {}
    groups = {
        "motion": stored({k: v for k, v in fields.items() if k in (*MOTION, "node")}, {"gravity": pull}),
        "body": stored({str(OF_BODY.get(k, k)): v for k, v in fields.items() if k not in MOTION}, {}),
    }
    return tree_from_recording(parse_recording(groups, {"title": title, "history": "forceid.motion"}, WHERE))


def gathered(
    data: Any, names: Names, columns: str, variables: Mapping[str, Any]
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """All variables by their names in the contract, `shape` and `gravity` among them, and names of nodes."""
    found = dict(variables)
    if hasattr(data, "columns"):
        of_table = {k: spec for k, spec in found.items() if k in MOTION and k != "time" and is_names(spec)}
        found |= {name: columns_of(data, spec, WHERE) for name, spec in of_table.items()}
        own, node = points_of(data, found.get("time"), names, columns, bool(of_table), WHERE)
        return found | own, node
    if isinstance(data, xr.Dataset):
        of_data = {names.get(name, name): name for name in KNOWN}
        if odd := [str(name) for name in data.data_vars if name not in of_data]:
            what = f"holds {odd[0]!r}, which is no variable of /motion or /body"
            next_step = f'map it with names={{"position": {odd[0]!r}}}, or drop it: drop_vars({odd})'
            raise DataError(what, WHERE, next_step)
        own = {of_data[str(name)]: values for name, values in data.data_vars.items()}
        return {"gravity": data.attrs.get("gravity")} | own | found, ()
    return found | ({} if data is None else {"position": data}), ()


def si(value: Any, units: str, name: str) -> Any:
    """The numbers of quantities of pint in SI, alone, by node or in a DataArray; else what it is."""
    if isinstance(value, Mapping):
        return {key: si(one, units, name) for key, one in value.items()}
    if isinstance(value, xr.DataArray) and hasattr(value.data, "magnitude"):
        return value.copy(data=si(value.data, units, name))
    if hasattr(value, "magnitude") and hasattr(value, "units"):
        return si_factor(format(value.units, "~C"), units, f"{WHERE}:{name}") * value.magnitude
    return value


def field(data: Any, attrs: Mapping[str, Any]) -> xr.Variable:
    """A copy of an array in one block as the parser takes it, which judges its shape and type.

    The order of memory decides the last bit of a sum: the same numbers in any layout give the same result.
    """
    values = np.array(data, order="C")
    return xr.Variable(tuple(f"dim_{k}" for k in range(values.ndim)), values, attrs)


def stored(variables: Mapping[str, Any], attrs: Mapping[str, Any]) -> Stored:
    """A group as the parser takes it."""
    return Stored(variables, attrs, tuple(variables))


def is_names(spec: Any) -> bool:
    """Whether this names columns: a text, or several."""
    several = spec if isinstance(spec, (list, tuple)) else [spec]
    return all(isinstance(name, str) for name in several)


def is_by_name(value: Any, spec: Variable) -> bool:
    """Whether this gives a value a node by name: a mapping, or a Series of pandas."""
    return spec.dims[:1] == ("node",) and (isinstance(value, Mapping) or hasattr(value, "iloc"))


def laid_out(value: Any, spec: Variable, order: Sequence[str], names: Names, name: str) -> xr.Variable:
    """An array in the order of the contract, with the attributes `units` and `node` that it brings."""
    attrs: dict[str, Any] = {}
    if isinstance(value, xr.DataArray):
        value, order = renamed(value, spec.dims, names, name), spec.dims
        attrs |= {key: value.attrs[key] for key in ("units", "noise_std") if key in value.attrs}
        if "node" in value.coords and value["node"].dtype.kind in "UOST":
            attrs["node"] = tuple(map(str, value["node"].values))
        for dim in {"axis", "quaternion"} & set(value.coords):
            labels = [str(label).lower() for label in value[dim].values]
            known = LABELS[dim][: len(labels)]
            if sorted(labels) == sorted(known):
                value = value.isel({dim: [labels.index(label) for label in known]})
    data = np.asarray(value)
    if data.dtype == object:
        try:
            data = data.astype(float)
        except (TypeError, ValueError) as e:
            what = f"holds text or objects ({e}), expected real numbers"
            raise DataError(what, f"{WHERE}:{name}", "convert it") from e
    if sorted(order) != sorted(spec.dims):
        what = f"dims are {', '.join(order)}, expected {', '.join(spec.dims)}"
        raise ConfigError(what, "motion:", "name each once, in the order of the array")
    if data.ndim == len(order):
        data = data.transpose([list(order).index(dim) for dim in spec.dims])
    return field(data, attrs)


def renamed(value: xr.DataArray, wanted: Sequence[str], names: Names, name: str) -> xr.DataArray:
    """A DataArray with the dimensions of the contract, in its order; one alone that is left is the one."""
    theirs = {names.get(dim, dim): dim for dim in wanted}
    left = [str(dim) for dim in value.dims if dim not in theirs]
    lacking = [dim for called, dim in theirs.items() if called not in value.dims]
    if len(left) == len(lacking) == 1:
        theirs[left[0]] = lacking[0]
    elif left or lacking:
        what = f"has dimensions {', '.join(map(str, value.dims))}, expected {', '.join(wanted) or 'none'}"
        example = ", ".join(f"{dim!r}: {called!r}" for dim, called in zip(lacking, left, strict=False))
        next_step = f"say which is which, as names={{{example}}}" if example else "select or add them"
        raise DataError(what, f"{WHERE}:{name}", next_step)
    there = {dim: value[dim].values for dim in value.dims if dim in value.coords}
    plain = xr.DataArray(value.data, there, value.dims, attrs=value.attrs)
    return plain.rename({old: theirs[str(old)] for old in value.dims}).transpose(*wanted)


def by_name(value: Any, nodes: Sequence[str], dims: Sequence[str], name: str) -> xr.Variable:
    """Values by node, of a mapping or a Series, in the order of the nodes; a mass not named is zero."""
    values = {str(node): value[node] for node in getattr(value, "index", value)}
    if not nodes:
        what = "is given by name, expected names of the nodes"
        raise ConfigError(what, f"{WHERE}:{name}", "add nodes=[...]")
    for node in values:
        known_name(node, tuple(nodes), f"{WHERE}:{name}")
    lacking = [node for node in nodes if node not in values]
    if lacking and len(dims) > 1:
        raise ConfigError(f"lacks {lacking[0]!r}", f"{WHERE}:{name}", "give every node its own")
    return field([values.get(node, 0.0) for node in nodes], {})


def clock(time: Any, rate: float | None, found: Mapping[str, Any], names: Names) -> xr.Variable:
    """The times (time,) s: as given, of a coordinate, or by a rate; dates count from the first."""
    measured, called = [found[name] for name in found if name in MOTION], names.get("time", "time")
    arrays = [value for value in measured if isinstance(value, xr.DataArray)]
    if time is None and rate is None:
        time = next((value.coords[called] for value in arrays if called in value.coords), None)
        if time is None:
            raise DataError("say no times of the samples", WHERE, "add time=..., or rate= in Hz")
    elif time is None and rate is not None:
        counts = [value.sizes.get(called, 0) for value in arrays] or [len(value) for value in measured]
        time = np.arange(counts[0] if counts else 0) / rate
    attrs = {k: v for k, v in getattr(time, "attrs", {}).items() if k == "units"}
    values = np.asarray(time.to_numpy() if hasattr(time, "to_numpy") else time)
    if values.dtype == object:  # dates with a time zone
        import pandas as pd

        values = pd.to_datetime(values, utc=True).tz_localize(None).to_numpy()
    if values.dtype.kind in "Mm":
        values = values - values[:1] if values.dtype.kind == "M" else values
        values = values.astype("m8[ns]") / np.timedelta64(1, "s")
    return field(values, attrs)
