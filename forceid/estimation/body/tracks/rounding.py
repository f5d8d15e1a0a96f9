"""Coordinates that are rounded: the grid they are on, and what errors that makes."""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.tracks.noise_axes import at_rest
from forceid.flight.channels import CHANNEL_SAMPLES
from forceid.records import Array

READ = 1 << 14  # readings along an axis: by chance two are a grid step of 1e-8 of their range apart
FEW_VALUES = 10  # that chance puts on a grid: of more, eight would have to
OFF_GRID = 0.01  # of a step: numbers of single precision that are rounded to it are nearer
NO_STEP = 0.25  # of a step: by so much no number is off that a step told by nearer ones leads to
STEPS_IN_LEAST = range(1, 9)  # of a grid, in the least distance of two readings, where hardly two are near


def grid_step(position: Array) -> float:
    """The widest step of the grids (m) that coordinates (time, node, 3) are on; zero where they are on none.

    All that change along an axis are whole steps apart, as those that were not rounded nowhere are but in an
    even motion, whose steps from frame to frame are alike.

    >>> grid_step(np.round(np.linspace(0, 1, 300), 1).reshape(-1, 1, 3)).__round__(9)
    0.1
    """
    x = position[:: max(1, len(position) // CHANNEL_SAMPLES)]
    x = x[:, :: max(1, x.shape[0] * x.shape[1] // READ)]
    moves, found = ~at_rest(x), 0.0
    for axis in range(3):
        read = x[:, moves[:, axis], axis]
        values = np.unique(read[np.isfinite(read)])
        if len(values) < FEW_VALUES:
            continue
        step = next((one for part in STEPS_IN_LEAST if (one := fitted_step(values, part))), 0.0)
        if step and np.nanmax(np.abs(np.diff(read, 2, axis=0)), initial=0.0) > 0.5 * step:
            found = max(found, step)
    return found


def fitted_step(values: Array, part: int) -> float:
    """The step of the grid that sorted values are on, about a part of their least distance; zero for none."""
    off = values - values[0]
    step, reach = float(np.diff(values).min()) / part, 10.0
    if not step > np.finfo(float).eps * off[-1]:  # nearer to each other than numbers of this size can be
        return 0.0
    while True:  # what is farther away tells it to more digits
        near = off[: np.searchsorted(off, reach * step, "right")]
        count = np.rint(near / step)
        if np.abs(near / step - count).max() > NO_STEP:
            return 0.0
        step = float(near @ count / (count @ count)) if count.any() else step
        if len(near) == len(off):
            break
        reach *= 10
    return step if np.abs(off / step - np.rint(off / step)).max() < OFF_GRID else 0.0


def rounding_line(step: float, noise: float) -> float:
    """Amplitude (m) that rounding to a step (m) gives to one frequency of a track at most; noise m with it.

    Rounded, a steady motion errs by a saw tooth, whose first harmonic noise beside it washes out. Source:
    Widrow and Kollar (2008), Quantization noise, 4.

    >>> rounding_line(0.1, 0.1 / np.sqrt(12)).__round__(6) == round(0.1 / np.pi, 6)
    True
    """
    if not step:
        return 0.0
    white = max(noise**2 - step**2 / 12, 0.0)
    return float(step / np.pi * np.exp(-2 * np.pi**2 * white / step**2))


def beside_rounding(std: float, step: float) -> float:
    """A noise (m) stated of coordinates, with that of rounding to a step (m) where it cannot hold it.

    >>> round(beside_rounding(0.01, 0.1), 4), beside_rounding(0.05, 0.1)
    (0.0306, 0.05)
    """
    rounded = step / np.sqrt(12)
    return float(np.hypot(std, rounded)) if std < rounded else std
