"""Result files: the estimate of a wrench with everything that is needed to judge it."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.parse import read_gravity, read_variables
from forceid.files.schema import (
    AERO,
    AERO_QUANTITIES,
    ESTIMATE,
    ESTIMATE_ATTRS,
    FEET,
    FLOWN,
    HIDDEN,
    IMPULSE,
    INTERFACE,
    LOAD,
    MODAL,
    NUMBERS,
    PARTS,
    TRUTH,
    WITNESS,
    WITNESS_ATTRS,
    estimate_groups,
)
from forceid.files.stored.hdf5 import open_hdf5, source_group
from forceid.files.stored.links import holds
from forceid.files.stored.netcdf import write_groups
from forceid.files.validate import checked_series
from forceid.files.values import Stored, labels, real_attr, text
from forceid.records import (
    Aero,
    Array,
    Estimate,
    Feet,
    Finding,
    Flown,
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

_DERIVED = ("force_std", "moment_std")
_OPTIONAL = {f.name for f in fields(Estimate) if f.default is None} | {
    *_DERIVED, "deformation", "mean_shape", "innovation"
}  # fmt: skip
_NUMBERS = ("log_likelihood", "mass", "runtime_s")
_SIZES = {"axis": 3, "quaternion": 4, "wrench": 6, "entry": 9}


def write_result(path: str | Path, estimate: Estimate, recording: Recording | None = None) -> None:
    """A result file by the contract, whole or not at all; title, history and truth come from the recording.

    ConfigError: not writable.
    """
    write_groups(path, estimate_groups(estimate, recording))


def read_result(path: str | Path) -> Estimate:
    """The estimate in a result file. DataError: not a result file."""
    where = f"{path}:/estimate"
    with open_hdf5(path) as f:
        if not holds(f, "estimate", f"{path}:"):
            raise DataError("is missing, expected in a result file", where, "run `forceid estimate` first")
        group = source_group(f, "estimate", ESTIMATE | HIDDEN | MODAL | IMPULSE, f"{path}:")
        values = checked_series(read_variables(group, ESTIMATE, dict(_SIZES), where)[0], where)
        parts: dict[str, Any] = {}
        for (part, table), record in zip(PARTS.items(), (HiddenLoad, ModalForces, Impulses), strict=True):
            found, _ = read_variables(group, table, dict(_SIZES), where)
            parts[part] = record(*found.values()) if len(found) == len(table) else None
        needed = (*ESTIMATE, *ESTIMATE_ATTRS, "verdict", "reasons")
        check_whole({*values, *group.attrs, *_OPTIONAL}, needed, where)
        node = labels(group, "node")
        n = len(values["time"])
        parts |= {
            name: read(f, n, path) if holds(f, found, f"{path}:") else None
            for name, (found, read) in READERS.items()
        }
        empty = {
            "deformation": np.zeros((n, len(node), 3)),
            "mean_shape": np.zeros((len(node), 3)),
            "innovation": np.zeros((n, 0)),
        }
        stated: dict[str, Any] = {name: text(group.attrs[name]) for name in ESTIMATE_ATTRS}
        stated |= {name: real_attr(group.attrs[name], where, name) for name in _NUMBERS}
        stated["gravity"] = read_gravity(group.attrs, where, None)
        numbers: dict[str, Any] = {
            kind: {
                k.removeprefix(f"{kind}_"): real_attr(v, where, k)
                for k, v in group.attrs.items()
                if k.startswith(f"{kind}_")
            }
            for kind in NUMBERS
        }
        return Estimate(
            **{k: v for k, v in (empty | values).items() if k not in _DERIVED},
            **stated,
            node=node,
            verdict=read_verdict(group.attrs),
            model_choice=text(group.attrs.get("model_choice", "")),
            settings=text(f.attrs.get("config", "")),
            input_sha256=text(f.attrs.get("input_sha256", "")),
            **numbers,
            **parts,
        )


def read_curves(path: str | Path) -> dict[str, Array]:
    """Only time (time,), force (time, 3) and moment (time, 3) of a result. DataError: not a result file."""
    where, wanted = f"{path}:/estimate", {name: ESTIMATE[name] for name in ("time", "force", "moment")}
    with open_hdf5(path) as f:
        if not holds(f, "estimate", f"{path}:"):
            raise DataError("is missing, expected in a result file", where, "run `forceid estimate` first")
        group = source_group(f, "estimate", wanted, f"{path}:")
        return read_variables(group, wanted, dict(_SIZES), where)[0]


def is_result(path: str | Path) -> bool:
    """Whether a file is a result and no motion file, by what it holds; what cannot be read is none."""
    try:
        with open_hdf5(path) as f:
            return holds(f, "estimate", f"{path}:") and not holds(f, "motion", f"{path}:")
    except DataError:
        return False


def read_truth(path: str | Path) -> dict[str, Array]:
    """The truth that a motion or result file carries, on its own time; empty when it has none."""
    with open_hdf5(path) as f:
        if not holds(f, "truth", f"{path}:"):
            return {}
        group = source_group(f, "truth", TRUTH, f"{path}:")
        return read_variables(group, TRUTH, dict(_SIZES), f"{path}:/truth")[0]


def read_title(path: str | Path) -> str:
    """What a motion or result file calls itself, which may be nothing."""
    with open_hdf5(path) as f:
        return text(f.attrs.get("title", ""))


def read_version(path: str | Path) -> str:
    """The version of forceid that made a result file; nothing where it does not say."""
    with open_hdf5(path) as f:
        return text(f.attrs.get("forceid_version", ""))


def read_part(
    file: Any, name: str, table: Mapping[str, Variable], samples: int, path: str | Path, dim: str = ""
) -> tuple[Stored, dict[str, Any], tuple[str, ...]]:
    """A group beside /estimate, its variables, and the names along its dimension `dim`, if it has one."""
    group = source_group(file, name, (*table, *filter(None, [dim])), f"{path}:")
    names = labels(group, dim)
    sizes = {**_SIZES, "time": samples, "pose": 6, "coefficient": 6} | ({dim: len(names)} if dim else {})
    where = f"{path}:/{name}"
    return group, checked_series(read_variables(group, table, sizes, where)[0], where), names


def check_whole(found: Collection[str], needed: Iterable[str], where: str) -> None:
    """A DataError where one of the names that are needed is not found."""
    for name in needed:
        if name not in found:
            raise DataError("is missing, expected in a result file", f"{where}/{name}", "estimate again")


def read_loads(file: Any, samples: int, path: str | Path) -> Loads:
    """The group /load of a result file."""
    group, values, names = read_part(file, "load", LOAD, samples, path, "load_name")
    empty = {"null_space": np.zeros((len(names), 0)), "estimable": np.zeros((0, len(names)))}
    dof = int(real_attr(group.attrs["dof"], f"{path}:/load", "dof"))
    return Loads(name=names, dof=dof, **(empty | values))


def read_witness(file: Any, samples: int, path: str | Path) -> Witness:
    """The group /witness of a result file."""
    group, values, _ = read_part(file, "witness", WITNESS, samples, path)
    check_whole({*values, *group.attrs}, (*WITNESS, *WITNESS_ATTRS), f"{path}:/witness")
    return Witness(**values, **{name: np.asarray(group.attrs[name], float) for name in WITNESS_ATTRS})


def read_flown(file: Any, samples: int, path: str | Path) -> Flown:
    """The group /flown of a result file."""
    _, values, _ = read_part(file, "flown", FLOWN, samples, path)
    check_whole(values, (name for name in FLOWN if name not in ("wind", "current_mass")), f"{path}:/flown")
    return Flown(**values)


def read_feet(file: Any, samples: int, path: str | Path) -> Feet:
    """The group /feet of a result file."""
    _, values, names = read_part(file, "feet", FEET, samples, path, "foot")
    check_whole(values, FEET, f"{path}:/feet")
    return Feet(name=names, **values)


def read_aero(file: Any, samples: int, path: str | Path) -> Aero:
    """The group /aero of a result file."""
    group, values, _ = read_part(file, "aero", AERO, samples, path)
    check_whole(values, AERO, f"{path}:/aero")
    names = tuple(AERO_QUANTITIES)
    value, std = (np.stack([values.pop(name + end) for name in names], 1) for end in ("", "_std"))
    return Aero(names, value, std, **values, counts=text(group.attrs.get("std_counts", "")))


def read_interface(file: Any, samples: int, path: str | Path) -> Interface:
    """The group /interface of a result file."""
    group, values, names = read_part(file, "interface", INTERFACE, samples, path, "joint")
    kept = {k: v for k, v in values.items() if k not in (*_DERIVED, "determined")}
    return Interface(
        name=names,
        parts=tuple((a, b) for a, b in (p.split("\t") for p in text(group.attrs["joint_parts"]).split("\n"))),
        determined=values["determined"] > 0.5,
        dof=int(real_attr(group.attrs["dof"], f"{path}:/interface", "dof")),
        verdict=read_verdict(group.attrs),
        **({"null_space": np.zeros((len(names), 6, 0))} | kept),
    )


READERS = {  # by fields of an estimate: the group of the file, and what reads it
    "loads": ("load", read_loads), "interface": ("interface", read_interface),
    "witness": ("witness", read_witness), "flown": ("flown", read_flown), "feet": ("feet", read_feet),
    "aero": ("aero", read_aero),
}  # fmt: skip


def read_verdict(attrs: Mapping[str, Any]) -> Verdict:
    """The verdict in the attributes of a group; a file from before findings had codes has sentences alone."""
    level: Any = text(attrs["verdict"])
    texts, codes, levels, values = (
        text(attrs.get(name, "")).split("\n")
        for name in ("reasons", "reason_codes", "reason_levels", "reason_values")
    )
    if texts == [""]:
        return Verdict(level)
    if not len(texts) == len(codes) == len(levels) == len(values) or codes == [""]:
        return Verdict(level, tuple(Finding("", level, {}, line) for line in texts))
    lines: Any = zip(codes, levels, map(json.loads, values), texts, strict=True)
    return Verdict(level, tuple(Finding(*line) for line in lines))
