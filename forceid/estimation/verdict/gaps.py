"""Frames that show no pose, and that nothing bridges."""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.flight.instruments import INSTRUMENTS
from forceid.motion import WIDE_STEP
from forceid.records import Array, Flags, Motion


def lost_frames(kin: Kinematics, motion: Motion | None = None) -> Flags:
    """Samples (time,) that show no pose, and that nothing bridges.

    Beside sensors on the body, what shows the pose may have a rate of its own: between two of its frames none
    is lost. Nor where sensors that tell of force and of moment read on.
    """
    time, seen = kin.time, np.asarray(np.isfinite(kin.pose.center).all(1))
    if motion is None or not any(one.name in motion.readings for one in INSTRUMENTS):
        return ~seen
    read = np.ones_like(seen)
    for name in (one.name for one in INSTRUMENTS if one.tells):
        reading = motion.readings.get(name)
        own = np.zeros_like(seen) if reading is None else np.asarray(np.isfinite(reading).any((1, 2)))
        read &= on_its_clock(time, own)
    return np.asarray(~(on_its_clock(time, seen) | read))


def on_its_clock(time: Array, seen: Flags) -> Flags:
    """Samples (time,) that are seen, or no farther from one seen than it usually is to the next.

    >>> on_its_clock(np.arange(9.0), np.array([1, 0, 1, 0, 1, 0, 0, 0, 1], bool)).astype(int)
    array([1, 1, 1, 1, 1, 0, 0, 0, 1])
    """
    at = time[seen]
    if len(at) < 2:
        return seen
    k = np.searchsorted(at, time, "right")
    before, after = np.append(-np.inf, at)[k], np.append(at, np.inf)[k]
    gap = np.where(
        np.isfinite(before) & np.isfinite(after), after - before, np.minimum(time - before, after - time)
    )
    return np.asarray(seen | (gap < WIDE_STEP * np.median(np.diff(at))))


def longest_run(flag: Flags) -> int:
    """Length of the longest run of true entries.

    >>> longest_run(np.array([0, 1, 1, 0, 1], bool))
    2
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flag.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
