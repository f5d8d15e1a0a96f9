"""A result as text: CSV, and the STO and MOT files of OpenSim; numbers in all digits that they have."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from forceid.errors import ConfigError
from forceid.files.exports.columns import Table, table_of
from forceid.files.stored.atomic import write_whole
from forceid.records import Array, Estimate

LOADS = (("force_v", "force"), ("force_p", "center"), ("torque_", "moment"))  # of an external load of OpenSim


def write_csv(path: Path, estimate: Estimate) -> None:
    """A line of names, then a line a sample; what is not known is empty."""
    table = table_of(estimate)
    names = ",".join(quoted(n) for n in ("time", *table.name))
    rows = [",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in joined(table)]
    write_whole(path, "\n".join([names, *rows]) + "\n")


def quoted(name: str) -> str:
    """A name as CSV holds it: in quotes where it has a comma, a quote or a line's end."""
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',"\n\r') else name


def write_sto(path: Path, estimate: Estimate) -> None:
    """All columns, as a storage of OpenSim."""
    table = table_of(estimate)
    names = ["_".join(name.split()) for name in table.name]
    write_whole(path, storage(path.stem, names, joined(table)))


def write_mot(path: Path, estimate: Estimate) -> None:
    """Force, its point and the torque about it, as an ExternalLoads of OpenSim reads them. ConfigError: the
    moment is about another point than the mass center.
    """
    if estimate.moment_about != "mass_center":
        what = f"would hold moments about {estimate.moment_about}, expected the mass center"
        raise ConfigError(what, str(path), 'estimate with moment_about = "mass_center", or export sto')
    names = [f"{to}{axis}" for to, _ in LOADS for axis in "xyz"]
    values = np.concatenate([getattr(estimate, name) for _, name in LOADS], 1)
    write_whole(path, storage(path.stem, names, np.column_stack([estimate.time, values])))


def storage(title: str, names: list[str], rows: Array) -> str:
    """A storage of OpenSim: its head, names, and rows between tabs."""
    head = [
        title,
        "version=1",
        f"nRows={len(rows)}",
        f"nColumns={rows.shape[1]}",
        "inDegrees=no",
        "endheader",
    ]
    lines = ["\t".join("nan" if np.isnan(v) else repr(float(v)) for v in row) for row in rows]
    return "\n".join([*head, "\t".join(["time", *names]), *lines]) + "\n"


def joined(table: Table) -> Array:
    """Time and columns (time, 1 + column)."""
    return np.column_stack([table.time, table.value])
