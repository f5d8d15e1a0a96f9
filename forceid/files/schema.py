"""The variables of the motion file and the result file: one table for HDF5, for xarray and for the checks."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from dataclasses import fields as record_fields
from importlib.resources import files
from typing import Any

import numpy as np

from forceid import __version__
from forceid.errors import DataError
from forceid.records import SENSED, Aero, Array, Estimate, Interface, Recording, Variable, Verdict

SCHEMA = "1"
MATERIAL = "body/material"  # a group of attributes: name and constants
CONVENTIONS = "CF-1.11"
Labels = Mapping[str, tuple[str, ...]]


@dataclass(frozen=True)
class Field:
    """An array with its dimensions and attributes, ready to be written."""

    dims: tuple[str, ...]
    data: np.ndarray[Any, Any]
    attrs: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Group:
    """A group of a file: variables, coordinates among them, and attributes."""

    variables: dict[str, Field]
    attrs: dict[str, Any] = field(default_factory=dict)


_TABLES = tomllib.loads((files("forceid.files") / "variables.toml").read_text("utf-8"))


def variables(group: str) -> dict[str, Variable]:
    """The variables of a group, by name."""
    return {name: Variable(tuple(dims.split()), *said) for name, (dims, *said) in _TABLES[group].items()}


BODY: dict[str, Variable] = variables("body")
PLANAR: dict[str, Variable] = variables("planar")
MOTION: dict[str, Variable] = variables("motion") | SENSED
KNOWN_LOADS: dict[str, Variable] = variables("known_loads")
ESTIMATE: dict[str, Variable] = variables("estimate")
HIDDEN, MODAL, IMPULSE = variables("hidden"), variables("modal"), variables("impulse")
LOAD, INTERFACE, FLOWN = variables("load"), variables("interface"), variables("flown")
FEET = variables("feet")
AERO_QUANTITIES, AERO_VECTORS = variables("aero"), variables("aero_vectors")
AERO = {
    name + end: replace(spec, long_name=f"{said}{spec.long_name}")
    for name, spec in (AERO_QUANTITIES | AERO_VECTORS).items()
    for end, said in (("", ""), ("_std", "standard deviation of the "))
} | variables("aero_cov")
PARTS = {"hidden": HIDDEN, "modal": MODAL, "impulses": IMPULSE}  # records in an estimate, and their fields
WITNESS = {
    name: replace(ESTIMATE[name], long_name=f"{ESTIMATE[name].long_name}, by the plain route")
    for name in ("force", "moment", "force_std", "moment_std")
}
WITNESSED = ("cutoff", "band", "apart", "difference", "limit")  # by axis: Hz, Hz, N or N m, joint errors
WITNESS_ATTRS = tuple(f"{number}_{load}" for load in ("force", "moment") for number in WITNESSED)
TRUTH: dict[str, Variable] = ESTIMATE | {
    "load": LOAD["load"],
    "joint_force": INTERFACE["force"],
    "joint_moment": INTERFACE["moment"],
    "joint_point": INTERFACE["point"],
}
# numbers with names, as attributes of an estimate
NUMBERS = ("tuned", "ladder", "leakage", "sensitivity", "timing")
ESTIMATE_ATTRS = (
    "method",
    "model",
    "engine",
    "log_likelihood",
    "moment_about",
    "mass",
    "gravity",
    "runtime_s",
)
LABELS = {
    "axis": ("x", "y", "z"),
    "quaternion": ("x", "y", "z", "w"),
    "entry": tuple(f"{force}{arm}" for force in "xyz" for arm in "xyz"),  # of a matrix, row by row
    "pose": ("x", "y", "z", "turn_x", "turn_y", "turn_z"),
    "wrench": ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z"),
}


def fields(
    table: Mapping[str, Variable],
    values: Mapping[str, Any],
    labels: Labels | None = None,
    attrs: Mapping[str, dict[str, Any]] | None = None,
) -> dict[str, Field]:
    """The values that are there (not None, not empty) as fields of `table`, after their coordinates."""
    coordinates: dict[str, Field] = {}
    variables: dict[str, Field] = {}
    known = LABELS | dict(labels or {})
    for name, value in values.items():
        if value is None:
            continue
        if name not in table:
            raise DataError(f"is no variable of the contract; known are {', '.join(table)}", f"/{name}")
        spec, data = table[name], np.asarray(value, float)
        if data.ndim != len(spec.dims):
            raise DataError(f"has shape {data.shape}, expected {spec.dims}", f"/{name}")
        if data.size == 0:
            continue
        describe = {"units": spec.units, "long_name": spec.long_name, **(attrs or {}).get(name, {})}
        variables[name] = Field(spec.dims, data, describe)
        for dim in spec.dims:
            if dim in known:
                text = np.array(known[dim], dtype=str)
                coordinates[dim] = Field((dim,), text, {"long_name": f"name of the {dim.replace('_', ' ')}"})
    return coordinates | variables


def root_attrs(title: str, history: str, **more: Any) -> dict[str, Any]:
    """Attributes of `/` that motion and result files share."""
    return {"Conventions": CONVENTIONS, "title": title, "history": history, **more}


def motion_groups(recording: Recording) -> dict[str, Group]:
    """A recording as the groups of a motion file; the truth gets the time of the motion if it has none."""
    body, motion = recording.body, recording.motion
    named = {"node": body.node, "marker": body.marker, "joint": body.joint, "rotor": body.rotor}
    node = {dim: names for dim, names in named.items() if names}
    noise = {name: {"noise_std": std} for name, std in motion.noise_std.items()}
    root = root_attrs(recording.title, recording.history, forceid_schema=SCHEMA, source=recording.source)
    came = {"import_settings": recording.import_settings, "source_sha256": recording.source_sha256}
    groups = {
        "/": Group({}, root | {name: said for name, said in came.items() if said}),
        "body": Group(fields(BODY, {name: getattr(body, name) for name in BODY}, node)),
        "motion": Group(
            fields(MOTION, {name: getattr(motion, name) for name in MOTION}, node, noise),
            {"gravity": np.asarray(motion.gravity, float)},
        ),
    }
    if body.material is not None:
        groups[MATERIAL] = Group({}, dict(body.material))
    if (known := recording.known_loads) is not None:
        values = {name: getattr(known, name) for name in KNOWN_LOADS}
        groups["load_known"] = Group(fields(KNOWN_LOADS, values, node | {"known_load": known.name}))
    return groups | truth_group(recording)


def truth_group(recording: Recording) -> dict[str, Group]:
    """The group /truth of a recording, or nothing."""
    if not recording.truth:
        return {}
    node = {"node": recording.body.node} if recording.body.node else {}
    return {"truth": Group(fields(TRUTH, {"time": recording.motion.time, **recording.truth}, node))}


def estimate_groups(estimate: Estimate, recording: Recording | None = None) -> dict[str, Group]:
    """An estimate as the groups of a result file, with title, history and truth of its recording."""
    node = {"node": estimate.node} if estimate.node else {}
    line = f"forceid {__version__} estimate --method {estimate.method} --model {estimate.model}"
    history = "\n".join(filter(None, (recording.history if recording else "", line)))
    root = root_attrs(
        recording.title if recording else "",
        history,
        forceid_version=__version__,
        config=estimate.settings,
        input_sha256=estimate.input_sha256,
    )
    groups = {
        "/": Group({}, root),
        "estimate": Group(
            fields(
                ESTIMATE | HIDDEN | MODAL | IMPULSE,
                {name: getattr(estimate, name) for name in ESTIMATE} | part_values(estimate),
                node,
            ),
            {
                **{name: getattr(estimate, name) for name in ESTIMATE_ATTRS},
                **verdict_attrs(estimate.verdict),
                "model_choice": estimate.model_choice,
                **{
                    f"{kind}_{name}": float(value)
                    for kind in NUMBERS
                    for name, value in getattr(estimate, kind).items()
                },
            },
        ),
    }
    time = estimate.time
    if (loads := estimate.loads) is not None:
        groups["load"] = timed(time, loads, LOAD, {"load_name": loads.name}, {"dof": loads.dof})
    if (witness := estimate.witness) is not None:
        numbers = {name: getattr(witness, name) for name in WITNESS_ATTRS}
        groups["witness"] = timed(time, witness, WITNESS, {}, {"moment_about": "mass_center"} | numbers)
    if (flown := estimate.flown) is not None:
        groups["flown"] = timed(time, flown, FLOWN, {}, {"frame": "poses in world axes, the body in its own"})
    if (feet := estimate.feet) is not None:
        groups["feet"] = timed(time, feet, FEET, {"foot": feet.name}, {"frame": "world axes, right-handed"})
    if (aero := estimate.aero) is not None:
        values = {"time": time, **aero_values(aero)}
        names = {"coefficient": ("CL", "CD", "CY", "Cl", "Cm", "Cn")}
        table = {"time": ESTIMATE["time"]} | AERO
        groups["aero"] = Group(fields(table, values, names), {"std_counts": aero.counts})
    if (joints := estimate.interface) is not None:
        groups["interface"] = timed(time, joints, INTERFACE, {"joint": joints.name}, interface_attrs(joints))
    return groups | (truth_group(recording) if recording else {})


def verdict_attrs(verdict: Verdict) -> dict[str, str]:
    """A verdict as attributes: its level, and of its findings a line each, all in one order."""
    lines: dict[str, Any] = {"reasons": verdict.reasons, **verdict.coded}
    lines["reason_values"] = [json.dumps(values, allow_nan=False) for values in lines["reason_values"]]
    return {"verdict": verdict.level} | {name: "\n".join(said) for name, said in lines.items()}


def part_values(estimate: Estimate) -> dict[str, Array]:
    """The records beside the variables of an estimate, by the names of the file."""
    return {
        name: getattr(record, field.name)
        for part, table in PARTS.items()
        if (record := getattr(estimate, part)) is not None
        for name, field in zip(table, record_fields(record), strict=False)
    }


def aero_values(aero: Aero) -> dict[str, Array]:
    """What the air does, by the names of the file."""
    columns = zip(aero.name, aero.value.T, aero.std.T, strict=True)
    own = {name + end: a for name, value, std in columns for end, a in (("", value), ("_std", std))}
    return own | {name: getattr(aero, name) for name in AERO if name not in own}


def timed(time: Array, record: Any, table: dict[str, Variable], names: Labels, attrs: Any) -> Group:
    """A record over the times of an estimate as a group of its own; names: of what runs along a dimension."""
    values = {"time": time} | {name: getattr(record, name) for name in table}
    return Group(fields({"time": ESTIMATE["time"]} | table, values, names), dict(attrs))


def interface_attrs(interface: Interface) -> dict[str, Any]:
    """The attributes of /interface."""
    return {
        "frame": "world axes, right-handed",
        "acts_on": "the second part of a joint, from the first",
        "moment_about": "the point of the joint",
        "null_space_about": "the mass center of all parts",
        "joint_parts": "\n".join("\t".join(pair) for pair in interface.parts),
        "dof": interface.dof,
        "consistency": interface.consistency,
        **verdict_attrs(interface.verdict),
    }


def hash_arrays(groups: Mapping[str, Group]) -> str:
    """SHA-256 over variables and attributes of every group but the root: the identity of data in no file."""
    digest = hashlib.sha256()
    for group, content in sorted(groups.items()):
        if group == "/":
            continue
        digest.update(f"{group}{sorted(content.attrs.items())}".encode())
        for name, item in sorted(content.variables.items()):
            digest.update(f"/{name}{item.data.shape}{sorted(item.attrs.items())}".encode())
            digest.update(np.ascontiguousarray(item.data).tobytes())
    return digest.hexdigest()
