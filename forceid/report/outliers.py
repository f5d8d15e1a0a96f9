"""Files of a batch that stand far from the others, by numbers that all of them have.

Distances are of logarithms from the median, in deviations by the median absolute deviation (Huber, Robust
Statistics, 2nd ed., 5.1), since a few odd files must not widen the measure they are judged by.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from forceid.records import Array
from forceid.report.numbers import plain

NORMAL_PER_MAD = 1.4826  # deviations of a normal in a median absolute deviation
OUTLYING = 5.0  # deviations
LEAST_DEVIATION = np.log(1.1)  # the deviation that is taken at least: files so near each other are alike
FEW_FILES = 8  # files below which nobody stands out
QUANTITIES = {
    "nis_mean": ("NIS", ""),
    "force_rms": ("force, rms", " N"),
    "moment_rms": ("moment, rms", " N m"),
    "force_std": ("sigma of the force", " N"),
    "moment_std": ("sigma of the moment", " N m"),
    "runtime_s": ("run time", " s"),
}


@dataclass(frozen=True)
class Outlier:
    """One number of one file, the median of all files, and how many deviations (of logarithms) it is off."""

    file: str
    quantity: str
    value: float
    median: float
    off: float

    def __str__(self) -> str:
        name, unit = QUANTITIES[self.quantity]
        return f"{name} {plain(self.value, 3)}{unit} where the median is {plain(self.median, 3)}{unit}"


def find_outliers(records: Sequence[Mapping[str, Any]]) -> list[Outlier]:
    """What stands out among the records of a batch, farthest first.

    >>> records = [{"file": f"{k}.h5", "nis_mean": 1 + 0.01 * k} for k in range(9)]
    >>> print(*find_outliers([*records, {"file": "odd.h5", "nis_mean": 30.0}]))
    NIS 30 where the median is 1.04
    """
    found = []
    for quantity in QUANTITIES:
        values = np.array([magnitude(record.get(quantity)) for record in records])
        off = distances(values)
        found += [
            Outlier(
                str(records[k]["file"]),
                quantity,
                float(values[k]),
                float(np.nanmedian(values)),
                float(off[k]),
            )
            for k in np.flatnonzero(np.abs(off) > OUTLYING).tolist()
        ]
    return sorted(found, key=lambda outlier: -abs(outlier.off))


def magnitude(value: Any) -> float:
    """A number, or the length of a vector; NaN where it is not known or not positive."""
    length = float(np.linalg.norm(np.asarray(value, float)))
    return length if np.isfinite(length) and length > 0 else np.nan


def distances(values: Array) -> Array:
    """How many deviations the logarithm of each value (file,) is from the median; zero where unknown."""
    known = np.isfinite(values)
    off = np.zeros(len(values))
    if known.sum() < FEW_FILES:
        return off
    scale = np.log(values[known])
    from_median = scale - np.median(scale)
    off[known] = from_median / max(NORMAL_PER_MAD * float(np.median(np.abs(from_median))), LEAST_DEVIATION)
    return off
