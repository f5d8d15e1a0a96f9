"""A result as Parquet, as MATLAB's MAT and as C3D."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.exports.columns import table_of
from forceid.files.formats.channels import optional
from forceid.files.schema import estimate_groups
from forceid.files.stored.atomic import atomic
from forceid.records import Array, Estimate

UNEVEN = 1e-6  # of a step: clocks of C3D have one rate, and this is rounding of times as files state them


def write_parquet(path: Path, estimate: Estimate) -> None:
    """A column each, 64-bit numbers, units in the metadata of its field. ConfigError: no pyarrow."""
    arrow, parquet = (optional(name, "parquet", path) for name in ("pyarrow", "pyarrow.parquet"))
    table = table_of(estimate)
    names, units = ("time", *table.name), ("s", *table.unit)
    fields = [
        arrow.field(n, arrow.float64(), metadata={"unit": u}) for n, u in zip(names, units, strict=True)
    ]
    columns = [arrow.array(np.ascontiguousarray(v)) for v in (table.time, *table.value.T)]
    with atomic(path) as partial:
        parquet.write_table(arrow.Table.from_arrays(columns, schema=arrow.schema(fields)), partial)


def write_mat(path: Path, estimate: Estimate) -> None:
    """A struct a group, as in the result: `estimate.force` (time, 3), `aero.CL`; attributes beside them."""
    from scipy.io import savemat

    content = {}
    for name, group in estimate_groups(estimate).items():
        values = {key: listed(item.data) for key, item in group.variables.items()}
        attrs = {key: value for key, value in group.attrs.items() if key not in values}
        content["file" if name == "/" else name.replace("/", "_")] = values | attrs
    with atomic(path) as partial:
        savemat(str(partial), content, appendmat=False, long_field_names=True)


def listed(data: Array) -> Any:
    """Numbers as they are, words as a cell array."""
    return data if data.dtype.kind == "f" else np.array([str(w) for w in data.ravel()], dtype=object)


def write_c3d(path: Path, estimate: Estimate) -> None:
    """Points: mass center and nodes, m, as smoothed; analog: force, moment and their deviations, N and N m.

    C3D holds single precision: of every analog channel `NAME` what rounding leaves stands in `NAME.rest`, and
    of every point in `NAME.rest`; the sum is the number. DataError: times that are not even.
    """
    ezc3d = optional("ezc3d", "c3d", path)
    step = np.diff(estimate.time)
    if len(step) < 1 or np.ptp(step) > UNEVEN * step.mean():
        what = f"has steps from {step.min():.4g} to {step.max():.4g} s, expected even ones for C3D"
        raise DataError(what, f"{path}: time", "resample the motion, or export another format")
    names, points = (
        ("center", *estimate.node),
        np.concatenate([estimate.center[:, None], nodes_of(estimate)], 1),
    )
    loads = {k: getattr(estimate, k) for k in ("force", "moment", "force_std", "moment_std")}
    channels = [f"{k}_{axis}" for k in loads for axis in "xyz"]
    units = ["N m" if k.startswith("moment") else "N" for k in loads for _ in "xyz"]
    whole, rest = parted(np.concatenate(list(loads.values()), 1))
    at, left = parted(points)
    c3d = ezc3d.c3d()
    place, analog = c3d["parameters"]["POINT"], c3d["parameters"]["ANALOG"]
    rate = [1.0 / float(step.mean())]
    place["UNITS"]["value"], place["RATE"]["value"], analog["RATE"]["value"] = ["m"], rate, rate
    place["LABELS"]["value"] = [*names, *(f"{n}.rest" for n in names)]
    analog["LABELS"]["value"] = [*channels, *(f"{n}.rest" for n in channels)]
    analog["UNITS"]["value"] = units * 2
    c3d["data"]["points"] = np.concatenate([homogeneous(at), homogeneous(left)], 1)
    c3d["data"]["analogs"] = np.concatenate([whole, rest], 1).T[None]
    with TemporaryDirectory() as folder:  # it gives names of its own to files that do not end in .c3d
        made = Path(folder, "made.c3d")
        c3d.write(str(made))
        with atomic(path) as partial:
            partial.write_bytes(made.read_bytes())


def parted(values: Array) -> tuple[Array, Array]:
    """Numbers in single precision, and what that leaves of them."""
    whole = values.astype(np.float32).astype(float)
    return whole, values - whole


def homogeneous(points: Array) -> Array:
    """Points (time, node, 3) as C3D holds them (4, node, time)."""
    return np.concatenate(
        [np.moveaxis(points, 2, 0).swapaxes(1, 2), np.ones((1, points.shape[1], len(points)))]
    )


def nodes_of(estimate: Estimate) -> Array:
    """Nodes (time, node, 3) m, world axes, as the estimate has them; none where no rotation is known."""
    from scipy.spatial.transform import Rotation

    q = estimate.orientation
    out = np.full((len(q), len(estimate.mean_shape), 3), np.nan)
    seen = np.isfinite(q).all(1)
    if seen.any() and out.shape[1]:
        R = Rotation.from_quat(q[seen]).as_matrix()
        shape = estimate.mean_shape + estimate.deformation[seen]
        out[seen] = estimate.center[seen, None] + np.einsum("tab,tnb->tna", R, shape)
    return out
