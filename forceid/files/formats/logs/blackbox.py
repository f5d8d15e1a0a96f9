"""Blackbox logs of Betaflight and its kin, as blackbox_decode writes them: a table with units in its names.

`--unit-rotation deg/s --unit-acceleration g` make it write units; without them gyroADC and accSmooth are
counts, of which the settings have to say the unit.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.channels import Channels
from forceid.files.formats.clocks import MICROSECOND
from forceid.files.formats.csv import CsvTable, read_csv

UNIT = re.compile(r"(?P<name>.+?) \((?P<unit>[^)]*)\)")
READS = {"specific_force": "accSmooth", "angular_velocity": "gyroADC"}


def is_blackbox(head: str) -> bool:
    """Whether the first row is that of a decoded log."""
    return head.startswith("loopIteration, time (us)") or head.startswith("loopIteration,time (us)")


def read_blackbox(path: Path) -> Channels:
    """The columns of a decoded log by their names without units; times (s) from its first row."""
    table = read_csv(path)
    named = {name: (m["name"], m["unit"]) if (m := UNIT.fullmatch(name)) else (name, "") for name in table}
    values = CsvTable({named[name][0]: cells for name, cells in table.items()}, str(path))
    time = values["time"]
    if not np.isfinite(time).all():
        raise DataError("holds a row without a time", f"{path}:time (us)", "decode the log again")
    clock = MICROSECOND * (time - time[0])
    unit = dict(named.values())
    sensor = {
        variable: {"imu": tuple(f"{column}[{k}]" for k in range(3))}
        for variable, column in READS.items()
        if f"{column}[2]" in values
    }
    return Channels(str(path), "column", values, unit, dict.fromkeys(values, clock), sensor=sensor)
