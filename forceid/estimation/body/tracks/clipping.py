"""Readings that a limit cut off: one extreme value, again and again, never passed."""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.tracks.noise_axes import at_rest
from forceid.flight.channels import CHANNEL_SAMPLES
from forceid.records import Array, Flags

STUCK, STUCK_PART = 5, 0.002  # samples, and part of them, at one edge that chance does not bring there
GRID = 0.5  # different values, as a part of the readings, below which these are on a grid, and meet anyway


def grid_step(position: Array) -> float:
    """The step of the grid (m) that coordinates (time, node, 3) are on; zero where they are on none.

    >>> grid_step(np.round(np.linspace(0, 1, 300), 1).reshape(-1, 1, 3)).__round__(9)
    0.1
    """
    x = position[:: max(1, len(position) // CHANNEL_SAMPLES)]
    values = np.unique(x[np.isfinite(x)])
    if len(values) < 2 or len(values) > GRID * x.size:
        return 0.0
    return float(np.diff(values).min())


def clipped(position: Array) -> tuple[Flags, str, float]:
    """Readings (time, node) of tracks (time, node, 3) that stick to an edge; axis and edge of the worst.

    Where a limit, of the volume or of a sensor, cut them off, the markers were elsewhere.

    >>> x = np.random.default_rng(0).standard_normal((90, 4, 3)).cumsum(0)
    >>> flags, axis, edge = clipped(np.minimum(x, [2.5, np.inf, np.inf]))
    >>> bool((flags == (x[..., 0] >= 2.5)).all()), axis, edge
    (True, 'x', 2.5)
    """
    found, most, where, at = np.zeros(position.shape[:2], bool), 0, "", np.nan
    if grid_step(position):
        return found, where, at
    rest = at_rest(position)
    for axis, name in enumerate("xyz"):
        values = position[..., axis]
        seen = np.isfinite(values)
        for edge in (np.nanmin(values, initial=np.inf), np.nanmax(values, initial=-np.inf)):
            stuck = (values == edge) & ~rest[:, axis]
            if stuck.sum() > max(STUCK, STUCK_PART * seen.sum()):
                found |= stuck
                if stuck.sum() > most:
                    most, where, at = int(stuck.sum()), name, float(edge)
    return found, where, at
