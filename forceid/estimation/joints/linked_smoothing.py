"""All parts smoothed together, in windows where a record is long. Source: principal equations 4h."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from forceid.estimation.joints.bending import Bending
from forceid.estimation.joints.linked_flight import LinkedFlight
from forceid.estimation.joints.linked_model import linked_model
from forceid.flight.channels import FLIGHT_SAMPLES
from forceid.kalman.building.line_search import ROOM
from forceid.kalman.engines import Engine
from forceid.records import Array


def smooth_linked(flight: LinkedFlight, bending: Bending, engine: Engine) -> tuple[Array, Array]:
    """Wrenches (time, part, 6) about the mass centers, and their covariance (time, part * 6, part * 6)."""
    time, size = len(flight.constraints.gap), 6 * len(flight.parts)
    wrench, cov = np.empty((time, size)), np.empty((time, size, size))
    states = linked_model(flight, bending, slice(0, 2)).read.shape[-1]
    for run, kept in overlapping_windows(time, max(FLIGHT_SAMPLES, ROOM // 5 // states**2)):
        whole = linked_model(flight, bending, run)
        path = engine.smooth(whole.model, whole.z)
        inner = slice(kept.start - run.start, kept.stop - run.start)
        read = whole.read[inner]
        wrench[kept] = np.einsum("tws,ts->tw", read, path.x[inner])
        cov[kept] = read @ path.P[inner] @ read.mT
    return wrench.reshape(time, len(flight.parts), 6), cov


def overlapping_windows(time: int, longest: int) -> Iterator[tuple[slice, slice]]:
    """Stretches of a record to smooth by themselves, and the part of each that is kept.

    >>> [(run.start, run.stop, kept.start, kept.stop) for run, kept in overlapping_windows(500, 300)]
    [(0, 300, 0, 225), (150, 450, 225, 375), (300, 500, 375, 500)]
    """
    if time <= longest:
        yield slice(0, time), slice(0, time)
        return
    start, kept, margin = 0, 0, longest // 4
    while kept < time:
        stop = min(start + longest, time)
        until = stop if stop == time else stop - margin
        yield slice(start, stop), slice(kept, until)
        start, kept = until - margin, until
