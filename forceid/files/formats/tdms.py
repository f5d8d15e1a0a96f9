"""TDMS files of LabVIEW and other National Instruments software, through npTDMS."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np

from forceid.errors import DataError
from forceid.files.formats.channels import Channels, optional, reading
from forceid.records import Array

_UNIT = ("unit_string", "NI_UnitDescription")


def read_tdms(path: str | Path) -> Channels:
    """Numeric channels of a TDMS file, named `group/channel`, scaled as the file says.

    The clock is wf_start_offset + k wf_increment; a channel of time stamps counts seconds from its first.
    ConfigError: npTDMS is not installed. DataError: not a whole TDMS file.
    """
    nptdms = optional("nptdms", "tdms", path)
    nptdms.log.log_manager.set_level(logging.CRITICAL)  # what it repairs in a damaged file it says on stderr
    values: dict[str, Array] = {}
    unit: dict[str, str] = {}
    time: dict[str, Array] = {}
    clocks: dict[tuple[float, float, int], Array] = {}
    # opened here: npTDMS would prefer an index file beside it, which may belong to another
    with reading(path, "TDMS"), open(path, "rb") as stream, nptdms.TdmsFile.open(stream) as file:
        if file.file_status.incomplete_final_segment:
            what = "ends in the middle of a segment, expected a whole TDMS file"
            raise DataError(what, str(path), "close it in the program that writes it, or copy it again")
        size = Path(path).stat().st_size
        for channel in (channel for group in file.groups() for channel in group.channels()):
            name = f"{channel.group_name}/{channel.name}"
            if len(channel) > size:
                what = f"declares {len(channel)} samples, more than the file can hold"
                raise DataError(what, f"{path}:{name}", "export or copy it again")
            if (data := channel_samples(channel)) is None:
                continue
            values[name] = data
            unit[name] = next((str(channel.properties[k]) for k in _UNIT if k in channel.properties), "")
            if step := float(channel.properties.get("wf_increment", 0.0)):
                offset = float(channel.properties.get("wf_start_offset", 0.0))
                key = (offset, step, len(data))
                time[name] = clocks.setdefault(key, np.asarray(offset + step * np.arange(len(data))))
    return Channels(str(path), "channel", values, unit, time)


def channel_samples(channel: Any) -> Array | None:
    """The samples of a channel, time stamps as seconds from the first; None for text and for nothing."""
    kind = np.dtype(channel.dtype).kind if channel.dtype is not None else "V"
    if not len(channel) or kind not in "biufM":
        return None
    data = np.asarray(channel[:])
    if kind == "M":
        return np.asarray((data - data[0]) / np.timedelta64(1, "ns") * 1e-9, float)
    return data.astype(float)
