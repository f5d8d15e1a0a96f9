"""A result as one table: a column for every component of what runs over time, with its unit."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from forceid.files.schema import Field, estimate_groups
from forceid.records import Array, Estimate

GROUPS = (
    "estimate",
    "load",
    "interface",
    "aero",
)  # as they stand in the table; names of the first stand alone
REPEATED = (
    "wrench_cov",
    "innovation",
    "first_moment_cov",
    "applied_first_moment_cov",
    "F_cov",
)  # left to HDF5


@dataclass(frozen=True)
class Table:
    """Columns over time: name, unit and values (time, column); time (time,) s stands apart."""

    time: Array
    name: tuple[str, ...]
    unit: tuple[str, ...]
    value: Array


def table_of(estimate: Estimate) -> Table:
    """What a result says over time, a column each component: `force_x`, `force_std_x`, `aero_CL`, `center_z`.

    Covariances are left to the result itself, but for those of force and moment, as `cov_force_x_moment_y`.
    """
    names, units, values = [], [], []
    groups = estimate_groups(estimate)
    for group in GROUPS:
        if group not in groups:
            continue
        fields = groups[group].variables
        before = "" if group == "estimate" else f"{group}_"
        for name, item in fields.items():
            if (
                name == "time"
                or not item.dims
                or item.dims[0] != "time"
                or name in REPEATED
                or name.endswith("cov")
            ):
                continue
            for at, words in labeled(item, fields):
                names.append(before + "_".join([name, *words]))
                units.append(str(item.attrs.get("units", "1")))
                values.append(item.data.reshape(len(item.data), -1)[:, at])
    wrench = groups["estimate"].variables.get("wrench")
    if wrench is not None:
        labels = [str(w) for w in wrench.data]
        for i, j in product(range(6), repeat=2):
            if i <= j:
                names.append(f"cov_{labels[i]}_{labels[j]}")
                units.append("N2" if j < 3 else "N2 m" if i < 3 else "N2 m2")
                values.append(estimate.wrench_cov[:, i, j])
    return Table(estimate.time, tuple(names), tuple(units), np.stack(values, 1))


def labeled(item: Field, fields: dict[str, Field]) -> list[tuple[int, list[str]]]:
    """Every component of a variable: its number, in order, and the names of its indices behind the time."""
    found = []
    for number, at in enumerate(np.ndindex(item.data.shape[1:])):
        words = []
        for k, dim in zip(at, item.dims[1:], strict=True):
            named = fields.get(dim) or fields.get(dim.removesuffix("_2"))
            words.append(str(named.data[k]) if named is not None else str(k))
        found.append((number, words))
    return found
