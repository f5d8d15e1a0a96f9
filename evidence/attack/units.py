"""One flight by other units, and by other scales of length, mass and time: the same result, or refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from evidence.attack.bodies import write
from evidence.attack.watched import End, forked

SAME = 1e-6  # of the claimed sigma
# powers of length, mass and time in a variable, and the units that stand for m, kg and s
POWERS: Mapping[str, tuple[int, int, int]] = {
    "motion/time": (0, 0, 1),
    "motion/position": (1, 0, 0),
    "motion/center": (1, 0, 0),
    "motion/specific_force": (1, 0, -2),
    "motion/angular_velocity": (0, 0, -1),
    "body/position": (1, 0, 0),
    "body/mass": (0, 1, 0),
    "body/total_mass": (0, 1, 0),
    "body/mass_center": (1, 0, 0),
    "body/inertia": (2, 1, 0),
    "body/sensor_position": (1, 0, 0),
    "body/mode_frequency": (0, 0, -1),
}
UNITS = {  # of the same quantity: name of the unit and how many of it make one of SI
    "mm": {"motion/position": ("mm", 1e3), "body/position": ("mm", 1e3), "motion/center": ("mm", 1e3)},
    "ms": {"motion/time": ("ms", 1e3)},
    "g": {"body/mass": ("g", 1e3), "body/total_mass": ("g", 1e3)},
}
SCALES = (1e-6, 1e-3, 1e3, 1e6)
FLIGHT_BASES = ("markers", "pose")


@dataclass(frozen=True)
class Change:
    """Another way to tell one flight: units, or scales (length, mass, time) of flights that are alike."""

    name: str
    units: Mapping[str, tuple[str, float]]
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


CHANGES = [Change(name, units) for name, units in UNITS.items()]
CHANGES.append(Change("mm, ms, g", {k: v for units in UNITS.values() for k, v in units.items()}))
for place, what in enumerate(("length", "mass", "time")):
    CHANGES += [
        Change(f"{what} x {s:g}", {}, tuple(s if k == place else 1.0 for k in range(3)))  # type: ignore[arg-type]
        for s in SCALES
    ]


def scale_factor(powers: tuple[int, int, int], scale: tuple[float, float, float]) -> float:
    """The factor of a quantity with those powers of length, mass and time."""
    return float(np.prod(np.power(scale, powers)))


def told(change: Change, file: Any) -> None:
    """Tell the flight of an open file in that way."""
    for name, powers in POWERS.items():
        if name not in file:
            continue
        factor = scale_factor(powers, change.scale)
        unit, many = change.units.get(name, ("", 1.0))
        file[name][...] = file[name][...] * factor * many
        if unit:
            file[name].attrs["units"] = unit
        if "noise_std" in file[name].attrs:
            file[name].attrs["noise_std"] = file[name].attrs["noise_std"] * factor * many
    file["motion"].attrs["gravity"] = file["motion"].attrs["gravity"] * scale_factor((1, 0, -2), change.scale)


def flights_compared(folder: Path) -> Iterator[tuple[str, str, End, list[str]]]:
    """Base and change, how it ended, and whether the result is another."""
    for base in FLIGHT_BASES:
        plain = None
        for change in (Change("SI", {}), *CHANGES):
            path = write(folder / "u.h5", base, lambda file, change=change: told(change, file))
            end = forked(["estimate", path.name, "--force"], folder)
            faults = end.faults(path.name if end.code == 3 else "")
            if end.code == 0:
                found = wrench(folder / "u.result.h5", change)
                plain = found if plain is None else plain
                told_of = "those of the plain route" in " ".join(end.out.split())  # degraded, and says why
                faults += ["another result"] * (furthest_apart(found, plain) > SAME and not told_of)
            yield base, change.name, end, faults
            (folder / "u.result.h5").unlink(missing_ok=True)


def wrench(path: Path, change: Change) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment (time, 6) of a result, and their sigma, by the scales of the plain flight."""
    force, moment = scale_factor((1, 1, -2), change.scale), scale_factor((2, 1, -2), change.scale)
    with h5py.File(path) as f:
        values = [
            np.hstack([f[f"estimate/force{end}"][...] / force, f[f"estimate/moment{end}"][...] / moment])
            for end in ("", "_std")
        ]
    return values[0], values[1]


def furthest_apart(found: tuple[np.ndarray, np.ndarray], plain: tuple[np.ndarray, np.ndarray]) -> float:
    """The most by which two results differ, in claimed sigma; endless where one knows more."""
    known = [np.isfinite(value).all(1) for value, _ in (found, plain)]
    if (known[0] != known[1]).any() or not known[0].any():
        return np.inf
    off = np.abs(found[0] - plain[0])[known[0]] / plain[1][known[0]]
    return float(off.max())
