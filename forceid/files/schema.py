"""The variables of the motion file and the result file: one table for HDF5, for xarray and for the checks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from forceid import __version__
from forceid.errors import DataError
from forceid.records import (
    SENSED,
    Array,
    Estimate,
    HiddenLoad,
    Impulses,
    Interface,
    Loads,
    ModalForces,
    Recording,
    Variable,
    Verdict,
    Witness,
)

SCHEMA = "1"
MATERIAL = "body/material"  # a group of attributes: name and constants
CONVENTIONS = "CF-1.11"


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


BODY = {
    "position": Variable(("node", "axis"), "m", "reference shape"),
    "mass": Variable(("node",), "kg", "lumped nodal mass"),
    "mass_matrix": Variable(("dof", "dof_2"), "kg", "consistent mass matrix, node-major"),
    "total_mass": Variable((), "kg", "mass of the rigid body"),
    "mass_center": Variable(("axis",), "m", "mass center of the rigid body, reference axes"),
    "inertia": Variable(("axis", "axis_2"), "kg m2", "inertia tensor about the mass center, reference axes"),
    "internal_momentum": Variable(
        ("axis",), "kg m2 s-1", "angular momentum of what turns inside the body, reference axes"
    ),
    "stiffness": Variable(("dof", "dof_2"), "N m-1", "stiffness matrix, node-major"),
    "mode_shape": Variable(("mode", "node", "axis"), "1", "shape of the deformation modes"),
    "mode_frequency": Variable(("mode",), "Hz", "frequency of the deformation modes"),
    "mode_damping": Variable(("mode",), "1", "damping ratio of the deformation modes"),
    "sensor_position": Variable(("sensor", "axis"), "m", "sensor position, reference axes"),
    "strain_shape": Variable(("gauge", "node", "axis"), "m-1", "strain per nodal displacement"),
    "sensor_rotation": Variable(("sensor", "quaternion"), "1", "rotation from sensor to body axes"),
    "marker_weight": Variable(("node", "marker"), "1", "weight of each marker in a mass point"),
    "marker_segment": Variable(("marker",), "1", "index of the node on whose segment a marker is, -1: none"),
    "marker_shape": Variable(("marker", "axis"), "m", "markers in one pose of the body"),
    "joint_segment": Variable(("joint", "side"), "1", "indices of the nodes whose segments meet at a joint"),
    "joint_shape": Variable(("joint", "axis"), "m", "joints in that pose"),
}
PLANAR = {"inertia": Variable((), "kg m2", "moment of inertia about the mass center, of a planar file")}
MOTION = {
    "time": Variable(("time",), "s", "time"),
    "position": Variable(("time", "node", "axis"), "m", "measured position, world axes"),
    "marker_position": Variable(("time", "marker", "axis"), "m", "markers of the mass points, world axes"),
    "center": Variable(("time", "axis"), "m", "measured mass center, world axes"),
    "orientation": Variable(("time", "quaternion"), "1", "measured orientation, body to world"),
} | SENSED
KNOWN_LOADS = {
    "time": Variable(("time",), "s", "time"),
    "force": Variable(("time", "known_load", "axis"), "N", "known force, world axes"),
    "moment": Variable(("time", "known_load", "axis"), "N m", "known moment about the point, world axes"),
    "wrench_cov": Variable(
        ("time", "known_load", "wrench", "wrench_2"),
        "N2",
        "covariance of force and moment: blocks in N2, N2 m and N2 m2",
    ),
    "point": Variable(("time", "known_load", "axis"), "m", "where a known load acts, world axes"),
    "nodal_force": Variable(("time", "node", "axis"), "N", "known forces on the nodes, world axes"),
}
ESTIMATE = {
    "time": Variable(("time",), "s", "time"),
    "force": Variable(("time", "axis"), "N", "applied force, weight excluded, world axes"),
    "moment": Variable(("time", "axis"), "N m", "applied moment, weight excluded, world axes"),
    "force_std": Variable(("time", "axis"), "N", "standard deviation of the force"),
    "moment_std": Variable(("time", "axis"), "N m", "standard deviation of the moment"),
    "wrench_cov": Variable(
        ("time", "wrench", "wrench_2"),
        "N2",
        "covariance of the wrench, force then moment: blocks in N2, N2 m and N2 m2",
    ),
    "known_force": Variable(("time", "axis"), "N", "force of the loads known beforehand, world axes"),
    "known_moment": Variable(("time", "axis"), "N m", "their moment about the mass center, world axes"),
    "center": Variable(("time", "axis"), "m", "mass center, world axes"),
    "velocity": Variable(("time", "axis"), "m s-1", "velocity of the mass center, world axes"),
    "orientation": Variable(("time", "quaternion"), "1", "mean orientation, body to world"),
    "angular_velocity": Variable(("time", "axis"), "rad s-1", "mean angular velocity, world axes"),
    "angular_momentum": Variable(
        ("time", "axis"), "kg m2 s-1", "angular momentum about the mass center, world axes"
    ),
    "mode_amplitude": Variable(("time", "mode"), "m", "amplitude of the deformation modes"),
    "stretch": Variable(("time", "axis", "axis_2"), "1", "right stretch of the affine body, body axes"),
    "first_moment": Variable(
        ("time", "axis", "axis_2"), "N m", "first moments of all forces, force then arm, world axes"
    ),
    "first_moment_cov": Variable(
        ("time", "entry", "entry_2"), "N2 m2", "covariance of the first moments, row by row"
    ),
    "applied_first_moment": Variable(
        ("time", "axis", "axis_2"), "N m", "first moments of the applied forces, force then arm, world axes"
    ),
    "applied_first_moment_cov": Variable(
        ("time", "entry", "entry_2"), "N2 m2", "covariance of the applied first moments, row by row"
    ),
    "F": Variable(("time", "axis", "axis_2"), "1", "deformation gradient, reference to world axes"),
    "F_cov": Variable(("time", "entry", "entry_2"), "1", "covariance of F, row by row"),
    "F_rate": Variable(("time", "axis", "axis_2"), "s-1", "rate of F"),
    "spin": Variable(("time", "axis"), "rad s-1", "spin of the polar rotation, world axes"),
    "circulation": Variable(("time", "axis"), "kg m2 s-1", "circulation of the affine body, reference axes"),
    "deformation": Variable(("time", "node", "axis"), "m", "displacement from the mean shape, body axes"),
    "mean_shape": Variable(("node", "axis"), "m", "mean shape, body axes, about the mass center"),
    "nis": Variable(("time",), "1", "normalized innovation squared per degree of freedom"),
    "innovation": Variable(("time", "channel"), "1", "whitened innovation"),
}
HIDDEN = {
    "band": Variable(("wrench",), "Hz", "frequency up to which a load was followed, 0 where none was found"),
    "frequency": Variable(("frequency",), "Hz", "frequency of an oscillating load"),
    "hidden_load": Variable(
        ("frequency", "wrench"),
        "N",
        "amplitude of an oscillating load that half of all records would not show (N, moments N m)",
    ),
}
MODAL = {
    "modal_force": Variable(("time", "elastic_mode"), "N", "force of the loads on a mode, body axes"),
    "modal_force_cov": Variable(
        ("time", "elastic_mode", "elastic_mode_2"), "N2", "covariance of the forces on the modes"
    ),
    "modal_shape": Variable(("elastic_mode", "node", "axis"), "1", "shape of those modes, body axes"),
}
IMPULSE = {
    "piece_start": Variable(("piece",), "s", "start of a piece in which the loads are of one character"),
    "piece_stop": Variable(("piece",), "s", "end of that piece"),
    "impulse": Variable(
        ("piece", "wrench"),
        "N s",
        "what the loads give in a piece, about the mass center (N s, moments N m s)",
    ),
    "impulse_cov": Variable(("piece", "wrench", "wrench_2"), "N2 s2", "covariance of these impulses"),
}
# A netCDF variable may not share its name with one of its own two dimensions: the loads run along load_name.
LOAD = {
    "load": Variable(("time", "load_name"), "N", "applied load (N, or N m where the load is a moment)"),
    "load_cov": Variable(("time", "load_name", "load_name_2"), "N2", "covariance of the loads"),
    "null_space": Variable(("load_name", "null"), "1", "load patterns that leave no trace in the motion"),
    "estimable": Variable(("functional", "load_name"), "1", "combinations of loads that are determined"),
    "chi_square": Variable(
        ("time",), "1", "misfit of the resultants, and of the forces on modes where loads answer to these"
    ),
}
WITNESS = {
    name: replace(ESTIMATE[name], long_name=f"{ESTIMATE[name].long_name}, by the plain route")
    for name in ("force", "moment", "force_std", "moment_std")
}
WITNESSED = ("cutoff", "band", "apart", "difference", "limit")  # by axis: Hz, Hz, N or N m, joint errors
WITNESS_ATTRS = tuple(f"{number}_{load}" for load in ("force", "moment") for number in WITNESSED)
INTERFACE = {
    "force": Variable(("time", "joint", "axis"), "N", "joint force on the second part, world axes"),
    "moment": Variable(("time", "joint", "axis"), "N m", "joint moment on the second part, about the joint"),
    "force_std": Variable(("time", "joint", "axis"), "N", "standard deviation of the joint force"),
    "moment_std": Variable(("time", "joint", "axis"), "N m", "standard deviation of the joint moment"),
    "wrench_cov": Variable(
        ("time", "joint", "wrench", "wrench_2"),
        "N2",
        "covariance of the joint wrench, force then moment: blocks in N2, N2 m and N2 m2",
    ),
    "point": Variable(("time", "joint", "axis"), "m", "place of the joint, world axes"),
    "gap": Variable(("time", "joint", "axis"), "m", "second part less the first at the joint, world axes"),
    "determined": Variable(("joint",), "1", "1 where the motion tells the wrench of the joint"),
    "null_space": Variable(
        ("joint", "wrench", "null"), "1", "joint wrenches that leave no trace in the motion"
    ),
    "chi_square": Variable(("time",), "1", "misfit of the balances that repeat each other"),
}
TRUTH = ESTIMATE | {
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
    "wrench": ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z"),
}


def fields(
    table: Mapping[str, Variable],
    values: Mapping[str, Any],
    labels: Mapping[str, tuple[str, ...]] | None = None,
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
    named = {"node": body.node, "marker": body.marker, "joint": body.joint}
    node = {dim: names for dim, names in named.items() if names}
    noise = {name: {"noise_std": std} for name, std in motion.noise_std.items()}
    groups = {
        "/": Group(
            {}, root_attrs(recording.title, recording.history, forceid_schema=SCHEMA, source=recording.source)
        ),
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
                {name: getattr(estimate, name) for name in ESTIMATE}
                | hidden_values(estimate.hidden)
                | modal_values(estimate.modal)
                | impulse_values(estimate.impulses),
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
    if estimate.loads is not None:
        groups["load"] = load_group(estimate.time, estimate.loads)
    if estimate.witness is not None:
        groups["witness"] = witness_group(estimate.time, estimate.witness)
    if estimate.interface is not None:
        groups["interface"] = interface_group(estimate.time, estimate.interface)
    return groups | (truth_group(recording) if recording else {})


def verdict_attrs(verdict: Verdict) -> dict[str, str]:
    """A verdict as attributes: its level, and of its findings a line each, all in one order."""
    found = verdict.findings
    return {
        "verdict": verdict.level,
        "reasons": "\n".join(verdict.reasons),
        "reason_codes": "\n".join(verdict.codes),
        "reason_levels": "\n".join(f.level for f in found),
        "reason_values": "\n".join(json.dumps(dict(f.values), allow_nan=False) for f in found),
    }


def hidden_values(hidden: HiddenLoad | None) -> dict[str, Array]:
    """What an estimate leaves out, by the names of the file."""
    if hidden is None:
        return {}
    return {"band": hidden.band, "frequency": hidden.frequency, "hidden_load": hidden.amplitude}


def modal_values(modal: ModalForces | None) -> dict[str, Array]:
    """Forces on modes, by the names of the file."""
    return {} if modal is None else dict(zip(MODAL, (modal.force, modal.cov, modal.shape), strict=True))


def impulse_values(found: Impulses | None) -> dict[str, Array]:
    """Impulses of loads that come in pieces, by the names of the file."""
    if found is None:
        return {}
    return dict(zip(IMPULSE, (found.start, found.stop, found.impulse, found.cov), strict=True))


def load_group(time: Array, loads: Loads) -> Group:
    """The group /load of a result file."""
    values = {"time": time} | {name: getattr(loads, name) for name in LOAD}
    table = {"time": ESTIMATE["time"]} | LOAD
    return Group(fields(table, values, {"load_name": loads.name}), {"dof": loads.dof})


def witness_group(time: Array, witness: Witness) -> Group:
    """The group /witness of a result file."""
    values = {"time": time} | {name: getattr(witness, name) for name in WITNESS}
    attrs = {"moment_about": "mass_center"} | {name: getattr(witness, name) for name in WITNESS_ATTRS}
    return Group(fields({"time": ESTIMATE["time"]} | WITNESS, values), attrs)


def interface_group(time: Array, interface: Interface) -> Group:
    """The group /interface of a result file."""
    values = {"time": time} | {name: getattr(interface, name) for name in INTERFACE}
    table = {"time": ESTIMATE["time"]} | INTERFACE
    attrs = {
        "frame": "world axes, right-handed",
        "acts_on": "the second part of a joint, from the first",
        "moment_about": "the point of the joint",
        "null_space_about": "the mass center of all parts",
        "joint_parts": "\n".join("\t".join(pair) for pair in interface.parts),
        "dof": interface.dof,
        "consistency": interface.consistency,
        **verdict_attrs(interface.verdict),
    }
    return Group(fields(table, values, {"joint": interface.name}), attrs)


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
