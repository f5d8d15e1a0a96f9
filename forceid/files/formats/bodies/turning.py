"""Rotors of the import settings: axes and inertias of the body, and their speeds over the motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from forceid.errors import ConfigError
from forceid.import_settings import ImportSettings
from forceid.records import Array


def with_turning(
    settings: ImportSettings, values: dict[str, Array]
) -> tuple[dict[str, Any], dict[str, Array]]:
    """The fields of a Body that say what turns inside, and the variables of /motion with all speeds.

    A rotor of no stated speed has the next column of rotor_speed. ConfigError: fewer columns, or more.
    """
    rotors, read = settings.rotor, values.get("rotor_speed")
    columns = [] if read is None else list(read.T)
    open_ = [one.name for one in rotors if one.speed is None]
    if len(open_) != len(columns):
        what = f"has {len(columns)} channels of rotor_speed for {len(open_)} rotors without speed"
        raise ConfigError(what, "[import.rotor]:", "name a channel for each, in their order, or give speed")
    if not rotors:
        return {}, values
    speeds = [
        columns.pop(0) if one.speed is None else np.full(len(values["time"]), one.speed) for one in rotors
    ]
    body = {
        "rotor": tuple(one.name for one in rotors),
        "rotor_axis": np.array([one.axis for one in rotors], float),
        "rotor_inertia": np.array([one.inertia for one in rotors]),
    }
    return body, values | {"rotor_speed": np.stack(speeds, 1)}
