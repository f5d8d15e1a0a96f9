"""ULog files of PX4, through pyulog: fields of topics, each on its clock, in axes forward, right, down."""

from __future__ import annotations

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np

from forceid.files.formats.channels import Channels, optional, reading
from forceid.files.formats.clocks import MICROSECOND
from forceid.records import Array

UNITS = {  # of topics, where their messages name none
    "sensor_accel": "m/s^2", "sensor_gyro": "rad/s", "sensor_mag": "gauss", "vehicle_acceleration": "m/s^2",
    "vehicle_angular_velocity": "rad/s", "vehicle_local_position": "m",
}  # fmt: skip
NAMED = {"gyro_rad": "rad/s", "accelerometer_m_s2": "m/s^2", "magnetometer_ga": "gauss"}  # by their field
READS = {  # what each variable is read from, the best first
    "specific_force": ("sensor_combined/accelerometer_m_s2[{}]", "sensor_accel/{}"),
    "angular_velocity": ("sensor_combined/gyro_rad[{}]", "sensor_gyro/{}"),
}


def is_ulog(head: str) -> bool:
    """Whether a file begins as a ULog does."""
    return head.startswith("ULog\x01")


def read_ulog(path: Path) -> Channels:
    """Numbers named `topic/field`, `topic.1/field` of a second instance; times (s) from the start of the log.

    ConfigError: pyulog is not installed. DataError: not a whole ULog file.
    """
    pyulog = optional("pyulog", "ulog", path)
    values: dict[str, Array] = {}
    unit: dict[str, str] = {}
    time: dict[str, Array] = {}
    # opened here: pyulog leaves a damaged file open; what it repairs it says on stdout
    with reading(path, "ULog"), open(path, "rb") as stream, redirect_stdout(StringIO()):
        log = pyulog.ULog(stream)
        for topic in log.data_list:
            prefix = topic.name + (f".{topic.multi_id}" if topic.multi_id else "")
            stamp = topic.data["timestamp"].astype(np.int64) - int(log.start_timestamp)
            clock = MICROSECOND * stamp.astype(float)
            for field, numbers in topic.data.items():
                if field != "timestamp" and np.asarray(numbers).dtype.kind in "fiu":
                    name = f"{prefix}/{field}"
                    values[name], time[name] = np.asarray(numbers, float), clock
                    unit[name] = NAMED.get(field.partition("[")[0], UNITS.get(topic.name, ""))
    sensor = {}
    for variable, patterns in READS.items():
        for pattern in patterns:
            three = tuple(pattern.format(axis) for axis in ("012" if "[" in pattern else "xyz"))
            if variable not in sensor and all(name in values for name in three):
                sensor[variable] = {"imu": three}
    return Channels(str(path), "field", values, unit, time, sensor=sensor)
