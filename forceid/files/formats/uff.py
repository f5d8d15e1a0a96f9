"""Universal files: time responses (datasets 58, 58b) with units (164) and nodes (15, 2411), through pyuff."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.channels import Channels, optional, reading
from forceid.records import Array

_TIME_RESPONSE = 1
_QUANTITY = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 2: "stress", 3: "strain"}
_POWER = {
    "displacement": "m",
    "velocity": "m s-1",
    "acceleration": "m s-2",
}  # lengths, by the specific data type
_DIRECTION = {1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}


def read_uff(path: str | Path) -> Channels:
    """Time responses of a universal file, named by quantity, node and direction: `acceleration.7Z`.

    One along a negative direction changes its sign. ConfigError: pyuff is not installed. DataError: not a
    whole universal file, no time response, or two of one name.
    """
    pyuff = optional("pyuff", "uff", path)
    with reading(path, "UFF"):
        check_end(path)
        file = pyuff.UFF(str(path))
        types = [int(kind) for kind in file.get_set_types()]
        sets = [file.read_sets(k) for k, kind in enumerate(types) if kind in (15, 58, 164, 2411)]
        return dataset_channels(sets, str(path))


def check_end(path: str | Path) -> None:
    """The last line is the -1 that ends a dataset: pyuff takes what comes before a missing one for whole."""
    with open(path, "rb") as stream:
        stream.seek(max(Path(path).stat().st_size - 400, 0))
        tail = stream.read().decode("latin-1").split()
    if tail[-1:] != ["-1"]:
        what = "does not end in a line -1, expected datasets between such lines"
        raise DataError(what, str(path), "it is cut short, or no UFF file: export or copy it again")


def dataset_channels(sets: list[Mapping[str, Any]], where: str) -> Channels:
    """The channels of the datasets of one file."""
    values: dict[str, Array] = {}
    unit: dict[str, str] = {}
    time: dict[str, Array] = {}
    geometry: dict[str, Array] = {}
    length = next((f"{1 / float(s['length']):.12g} m" for s in sets if s["type"] == 164), "")
    functions = [s for s in sets if s["type"] == 58]
    responses = [s for s in functions if s["func_type"] == _TIME_RESPONSE]
    if not responses:
        other = sorted({int(s["func_type"]) for s in functions})
        what = f"holds no time response (function type 1), found {len(functions)} functions of type {other}"
        raise DataError(
            what if functions else "holds no function (dataset 58)", where, "export time histories"
        )
    for s in responses:
        name, sign = response_name(s)
        if name in values:
            what = f"holds {name!r} twice, expected one time response of a node and direction"
            raise DataError(what, where, "export each run to a file of its own")
        if len(s["data"]) != s["num_pts"] or np.iscomplexobj(s["data"]):
            what = f"holds {len(s['data'])} real samples, expected {s['num_pts']}"
            raise DataError(what, f"{where}:{name}", "it is cut short: export or copy it again")
        values[name], time[name] = sign * np.asarray(s["data"], float), np.asarray(s["x"], float)
        unit[name] = unit_of(s, length)
    for s in sets:
        if s["type"] in (15, 2411):
            xyz = np.stack([s["x"], s["y"], s["z"]], -1)
            geometry |= {str(int(n)): p for n, p in zip(s["node_nums"], xyz, strict=True)}
    return Channels(where, "time response", values, unit, time, geometry, length)


def response_name(s: Mapping[str, Any]) -> tuple[str, float]:
    """Quantity, node and direction of a response, and its sign.

    >>> response_name({"ordinate_spec_data_type": 12, "rsp_node": 7, "rsp_dir": -3})
    ('acceleration.7Z', -1.0)
    """
    quantity, direction = _QUANTITY.get(s["ordinate_spec_data_type"], "general"), int(s["rsp_dir"])
    name = f"{quantity}.{int(s['rsp_node'])}{_DIRECTION.get(abs(direction), '')}"
    return name, -1.0 if direction < 0 else 1.0


def unit_of(s: Mapping[str, Any], length: str) -> str:
    """The unit by the label of the ordinate, else by the length of dataset 164; empty without either."""
    label = str(s["ordinate_axis_units_lab"]).strip()
    if label and label.upper() != "NONE":
        return label
    power = _POWER.get(_QUANTITY.get(s["ordinate_spec_data_type"], ""), "")
    return f"{length.split()[0]} {power}" if length and power else ""
