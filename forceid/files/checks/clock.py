"""Clocks that an estimate can follow: times that increase, and steps that belong to one recording."""

from __future__ import annotations

import numpy as np

from forceid.errors import DataError
from forceid.records import Array

LATEST = 1e11  # s, three thousand years: Unix times in milliseconds or less lie beyond
CLOSE = 1e4  # of the usual step over another: second differences lose its square, eight digits of sixteen
GAP = 1e6  # of a step over the usual one: nothing of one side tells of the other
SHORTEST = 1e-12  # s: light goes a third of a millimeter


def check_clock(time: Array, where: str) -> None:
    """Times are finite, at least three, and strictly increasing."""
    if len(time) < 3:
        raise DataError(
            f"has {len(time)} samples, expected at least 3", where, "an acceleration needs three times"
        )
    if not np.isfinite(time).all():
        bad = np.flatnonzero(~np.isfinite(time))
        raise DataError(
            f"holds {len(bad)} times that are not finite, first at index {bad[0]}, expected none",
            where,
            "restore the clock or drop those rows",
        )
    if (far := float(np.abs(time).max())) > LATEST:
        raise DataError(
            f"goes to {far:.3g} s, expected at most {LATEST:g} s",
            where,
            "correct its units, for example ms or ns, or count from the first sample",
        )
    step = np.diff(time)
    if (step <= 0).any():
        k = int(np.argmax(step <= 0))
        raise DataError(
            f"goes from {time[k]:.9g} to {time[k + 1]:.9g} s at index {k + 1}, expected strictly "
            "increasing times",
            where,
            "sort the rows and drop repeated ones",
        )


def check_steps(time: Array, where: str) -> None:
    """No step so far from the usual one that the frames beside it are of no one recording."""
    step = np.diff(time)
    usual, short, long = float(np.median(step)), int(np.argmin(step)), int(np.argmax(step))
    if usual < SHORTEST:
        raise DataError(
            f"has steps of {usual:.3g} s, expected {SHORTEST:g} s or more", where, "give the times in s"
        )
    if step[short] * CLOSE < usual:
        raise DataError(
            f"has a step of {step[short]:.3g} s at index {short + 1} among steps of {usual:.3g} s, expected "
            f"none {CLOSE:g} times shorter",
            where,
            "drop one of these two frames",
        )
    if step[long] > GAP * usual:
        raise DataError(
            f"has a gap of {step[long]:.3g} s at index {long + 1} among steps of {usual:.3g} s, expected "
            f"none {GAP:g} times longer",
            where,
            "split the recording there",
        )
