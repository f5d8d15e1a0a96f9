"""Air: how dense it is, and how it moves where a body is."""

from __future__ import annotations

import numpy as np

from forceid.config import AeroSetting
from forceid.errors import ConfigError, DataError
from forceid.records import Array

# the standard atmosphere (ISO 2533): at sea level, its lapse up to the tropopause, and gas and weight there
SEA_PRESSURE, SEA_TEMPERATURE = 101325.0, 288.15  # Pa, K
LAPSE, TROPOPAUSE = 0.0065, 11000.0  # K/m; m
GAS, WEIGHT = 287.05287, 9.80665  # J/(kg K); m/s2


def standard_density(altitude: float) -> float:
    """Density (kg/m3) of the standard atmosphere at an altitude (m), up to 20 km. Source: ISO 2533.

    >>> round(standard_density(0.0), 4), round(standard_density(11000.0), 5), round(standard_density(2e4), 5)
    (1.225, 0.36392, 0.08803)
    """
    lower = min(altitude, TROPOPAUSE)
    temperature = SEA_TEMPERATURE - LAPSE * lower
    pressure = SEA_PRESSURE * (temperature / SEA_TEMPERATURE) ** (WEIGHT / (GAS * LAPSE))
    pressure *= np.exp(-WEIGHT * (altitude - lower) / (GAS * temperature))
    return float(pressure / (GAS * temperature))


def density_of(setting: AeroSetting) -> float:
    """Density (kg/m3) that the settings state, of the standard atmosphere where they name an altitude."""
    return setting.density or standard_density(setting.altitude or 0.0)


def wind_at(setting: AeroSetting, center: Array, gravity: Array, measured: Array | None = None) -> Array:
    """Wind (..., 3) m/s, world axes, at places center (..., 3) m; measured: of a file, at the same times.

    Heights are along gravity (3,), from the origin. ConfigError, DataError: none there is to be had.
    """
    if setting.wind_profile is not None:
        if not np.any(gravity):
            what = "goes by height, and gravity is zero"
            raise ConfigError(what, "aero.wind_profile", "state gravity, or a constant wind")
        height = -(center @ gravity) / np.linalg.norm(gravity)
        velocity = np.array(setting.wind_profile.velocity)
        return np.stack([np.interp(height, setting.wind_profile.height, v) for v in velocity.T], -1)
    if setting.wind == "measured":
        if measured is None:
            what = "is missing, which aero.wind = 'measured' asks for"
            raise DataError(what, "/motion/wind", "add wind (time, axis) in m/s, or state a constant one")
        return measured
    return np.broadcast_to(np.array(setting.wind, float), center.shape)
