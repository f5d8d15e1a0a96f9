"""From the variables of a motion file, of h5py or of xarray, to a checked Recording in SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.schema import BODY, KNOWN_LOADS, MATERIAL, MOTION, PLANAR, SCHEMA, TRUTH
from forceid.files.units import si_factor
from forceid.files.validate import check_recording
from forceid.files.values import Stored, canonical, labels, likeliest_name, read_real, real_attr, text, unpack
from forceid.records import SENSED, Array, Body, KnownLoads, Motion, Recording, Variable

READ = ("units", "noise_std", "_FillValue", "missing_value", "scale_factor", "add_offset")  # of a variable


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
