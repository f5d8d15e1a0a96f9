"""From the variables of a motion file, of h5py or of xarray, to a checked Recording in SI units."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.schema import BODY, KNOWN_LOADS, MATERIAL, MOTION, PLANAR, SCHEMA, TRUTH
from forceid.files.units import si_factor
from forceid.files.validate import check_recording
from forceid.memory import memory_limit
from forceid.records import SENSED, Array, Body, KnownLoads, Motion, Recording, Variable

_SHOWN = 12  # names in a line
READ = ("units", "noise_std", "_FillValue", "missing_value", "scale_factor", "add_offset")  # of a variable
NC_FILL = 9.969209968386869e36  # what netCDF leaves where nothing was written


@dataclass(frozen=True)
class Stored:
    """A group as found: variables of h5py or xarray (.dtype .shape .attrs, not read yet) and attributes."""

    variables: Mapping[str, Any]
    attrs: Mapping[str, Any]
    found: tuple[str, ...]  # every name in the group, known or not


def parse_recording(
    groups: Mapping[str, Stored],
    attrs: Mapping[str, Any],
    where: str,
    sha256: str = "",
    gravity: Sequence[float] | None = None,
) -> Recording:
    """The recording that `body`, `motion` and, where present, `truth` describe. DataError: see validate.

    Integers stand for real numbers; units that differ from SI are converted; packed values are unpacked.
    A truth without its own time gets that of the motion. `gravity` overrides the attribute of /motion.
    """
    if (schema := text(attrs.get("forceid_schema", SCHEMA))) != SCHEMA:
        raise DataError(f"has forceid_schema {schema!r}, expected {SCHEMA!r}", where, "update forceid")
    for name in ("body", "motion"):
        if name not in groups:
            if "estimate" in groups:
                what = "is a result of forceid, expected a motion file"
                raise DataError(what, where, "give the file that it was made from")
            found = ", ".join(groups) or "no group"
            raise DataError(f"is missing, found {found}", f"{where}:/{name}", "see `forceid import`")
    planar = is_planar(groups)
    sizes = {"axis": 2 if planar else 3, "quaternion": 4}
    body, _ = read_variables(groups["body"], BODY | (PLANAR if planar else {}), sizes, f"{where}:/body")
    motion, noise = read_variables(groups["motion"], MOTION, sizes, f"{where}:/motion")
    if planar:
        body, motion, sizes["axis"] = in_space(body, BODY), in_space(motion, MOTION), 3
    if "time" not in motion:
        next_step = likeliest_name("time", groups["motion"].found)
        raise DataError(
            "is missing, expected the times of the samples (s)", f"{where}:/motion/time", next_step
        )
    if len(motion) == 1:
        what = "holds no measurement, expected position, or center and orientation, or sensors"
        raise DataError(what, f"{where}:/motion", likeliest_name("position", groups["motion"].found))
    truth: dict[str, Array] = {}
    if "truth" in groups:
        own = {dim: n for dim, n in sizes.items() if dim not in ("time", "mode")}
        truth, _ = read_variables(groups["truth"], TRUTH, own, f"{where}:/truth")
        truth = {"time": motion["time"]} | truth if truth else {}
    if "orientation" in motion:
        motion["orientation"] = canonical(motion["orientation"])
    whole: dict[str, Any] = {
        name: float(body.pop(name)) for name in ("total_mass", "mass_rate") if name in body
    }
    recording = Recording(
        body=Body(
            node=node_names(groups, sizes.get("node", 0), where),
            marker=labels(groups["body"], "marker"),
            joint=labels(groups["body"], "joint"),
            rotor=labels(groups["body"], "rotor")
            or tuple(f"rotor_{k}" for k in range(sizes.get("rotor", 0))),
            material=read_material(groups[MATERIAL], f"{where}:/{MATERIAL}") if MATERIAL in groups else None,
            **whole,
            **body,
        ),
        motion=Motion(
            **motion,
            gravity=read_gravity(groups["motion"].attrs, f"{where}:/motion", gravity, planar),
            noise_std=noise,
        ),
        truth=truth,
        title=text(attrs.get("title", "")),
        source=text(attrs.get("source", "")),
        history=text(attrs.get("history", "")),
        sha256=sha256,
        known_loads=read_known_loads(groups, sizes, where),
        **{name: text(attrs[name]) for name in ("import_settings", "source_sha256") if name in attrs},
    )
    check_recording(recording, where)
    return recording


def is_planar(groups: Mapping[str, Stored]) -> bool:
    """Whether a file gives two axes: whichever of its positions come first says so."""
    named = (("body", "position"), ("motion", "position"), ("motion", "center"))
    shapes = [getattr(groups[g].variables.get(name), "shape", ()) for g, name in named]
    return next((shape[-1] == 2 for shape in shapes if shape), False)


def in_space(values: dict[str, Any], table: Mapping[str, Variable]) -> dict[str, Any]:
    """Variables of a planar file in space, in the plane z = 0; what a sensor does not read there is NaN.

    The inertia, one number J about z, is that of a plate: J / 2 about the axes in the plane.
    """
    found = dict(values)
    for name, value in values.items():
        if name == "inertia":
            found[name] = float(value) * np.diag([0.5, 0.5, 1.0])
        elif table[name].dims[-1:] == ("axis",):
            beyond = np.nan if name in SENSED else 0.0
            pads = [(0, 0)] * (value.ndim - 1) + [(0, 1)]
            found[name] = np.pad(value, pads, constant_values=beyond)
    return found


def read_known_loads(groups: Mapping[str, Stored], sizes: dict[str, int], where: str) -> KnownLoads | None:
    """The loads that /load_known holds, on the clock of the motion where it has none of its own."""
    if "load_known" not in groups:
        return None
    group, own = groups["load_known"], {d: sizes[d] for d in ("axis", "node") if d in sizes} | {"wrench": 6}
    if "time" not in group.variables:
        group = replace(group, variables={**group.variables, "time": groups["motion"].variables["time"]})
    found, _ = read_variables(group, KNOWN_LOADS, own, f"{where}:/load_known")
    if not {"force", "moment", "nodal_force"} & set(found):
        what = "holds no load, expected force, moment or nodal_force"
        raise DataError(what, f"{where}:/load_known", likeliest_name("force", group.found))
    count = own.get("known_load", 0)
    names = labels(group, "known_load") or tuple(f"load_{k}" for k in range(count))
    if len(set(names)) != len(names) or len(names) != count:
        what = f"names {', '.join(names)}, expected a name of its own for each of {count} loads"
        raise DataError(what, f"{where}:/load_known/known_load", "name every load once")
    return KnownLoads(name=names, **found)


def read_variables(
    group: Stored, table: Mapping[str, Variable], sizes: dict[str, int], where: str
) -> tuple[dict[str, Any], dict[str, float]]:
    """The variables of `table` in the group and their noise_std, in SI; `sizes` of dimensions is filled in.

    No units attribute means SI.
    """
    values: dict[str, Any] = {}
    noise: dict[str, float] = {}
    for name, spec in table.items():
        if (source := group.variables.get(name)) is None:
            continue
        here, found = f"{where}/{name}", getattr(source, "attrs", {})
        attrs = {key: found[key] for key in found if key in READ}
        factor = si_factor(text(attrs.get("units", spec.units)), spec.units, here)
        values[name] = unpack(read_real(source, spec, sizes, here), attrs, here)
        if factor != 1.0:
            values[name] = values[name] * factor  # what is in a tree stays as it is
        if "noise_std" in attrs:
            noise[name] = factor * real_attr(attrs["noise_std"], here, "noise_std")
    return values, noise


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


def read_gravity(
    attrs: Mapping[str, Any], where: str, gravity: Sequence[float] | None, planar: bool = False
) -> Array:
    """Gravity from the argument or the attribute; it is never assumed."""
    value = attrs.get("gravity") if gravity is None else gravity
    if value is None:
        raise DataError(
            "lacks the attribute gravity, expected three numbers in m s-2, world axes",
            where,
            "set it on /motion, or set the key `gravity` of the configuration",
        )
    array = np.asarray(value)
    if planar and array.shape == (2,):
        array = np.append(array, 0.0)
    if array.dtype.kind not in "fiu" or array.shape != (3,):
        raise DataError(
            f"has gravity {value!r}, expected three numbers in m s-2",
            where,
            "set the attribute gravity, for example 0, 0, -9.81",
        )
    return array.astype(np.float64)


def read_material(group: Stored, where: str) -> dict[str, str | float | tuple[float, ...]]:
    """Name and constants of a material, one number or several each; an estimate judges what they mean."""
    found: dict[str, str | float | tuple[float, ...]] = {}
    for name, value in group.attrs.items():
        array = np.asarray(value)
        if name == "name":
            found[name] = text(value)
        elif not name.startswith("_") and (array.dtype.kind not in "fiu" or array.ndim > 1):
            raise DataError(f"is {value!r}, expected numbers", f"{where}@{name}", "write it as float64")
        elif not name.startswith("_"):
            found[name] = float(array.item()) if array.size == 1 else tuple(map(float, array))
    return found


def node_names(groups: Mapping[str, Stored], count: int, where: str) -> tuple[str, ...]:
    """Names of the nodes; those of the motion must be those of the body, in the same order."""
    named = {g: labels(groups[g], "node") for g in ("body", "motion") if "node" in groups[g].variables}
    names = named.get("body", named.get("motion", tuple(f"node_{k}" for k in range(count))))
    if len(names) != count:
        what = f"names {len(names)} nodes, expected {count}"
        raise DataError(what, f"{where}:/body/node", "name every node once")
    if (other := named.get("motion", names)) != names:
        odd = next((a for a, b in zip(other, names, strict=False) if a != b), "one more")
        what = f"holds {odd!r} where /body/node holds another name, expected the same nodes in the same order"
        raise DataError(what, f"{where}:/motion/node", "reorder the nodes")
    return names


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
