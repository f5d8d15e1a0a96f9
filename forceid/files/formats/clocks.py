"""Clocks of channels that are read at rates of their own, and one for all: NaN where one is not read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forceid.records import Array

MICROSECOND = 1e-6  # s, in which loggers count
SAME = 1e-3  # of a sampling interval, by which clocks may differ: UFF keeps six digits of a time


def agree(clock: Array, other: Array | None) -> bool:
    """Whether two clocks (time,) s are the same.

    >>> agree(np.arange(3.0), np.arange(3) + 1e-5), agree(np.arange(3.0), np.arange(4.0))
    (True, False)
    """
    if other is None or len(other) != len(clock):
        return False
    slack = SAME * float(np.ptp(clock)) / max(len(clock) - 1, 1)
    return bool(np.allclose(other, clock, rtol=0, atol=slack))


def joined(clocks: Sequence[Array]) -> Array:
    """The times (time,) s at which any of the clocks reads, those as good as the same once.

    >>> joined([np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 1.0 + 1e-6])]).tolist()
    [0.0, 0.5, 1.0, 2.0]
    """
    time = np.sort(np.concatenate(clocks))
    step = min(float(np.ptp(clock)) / max(len(clock) - 1, 1) for clock in clocks)
    return time[np.diff(time, prepend=-np.inf) > SAME * step]


def spread(values: Array, own: Array, time: Array) -> Array:
    """Values (sample, ...) of a clock `own` on one that holds its times: (time, ...), NaN in between.

    >>> spread(np.array([1.0, 2.0]), np.array([0.0, 1.0]), np.array([0.0, 0.5, 1.0])).tolist()
    [1.0, nan, 2.0]
    """
    found = np.full((len(time), *values.shape[1:]), np.nan)
    found[np.clip(np.searchsorted(0.5 * (time[1:] + time[:-1]), own), 0, len(time) - 1)] = values
    return found
