"""What a simulation gives: F and F' over time, what should stay constant, and the first event.

Source: pseudo-rigid bodies, section 1.
"""

from __future__ import annotations

from dataclasses import dataclass

from forceid.pseudorigid.motion.events import Event
from forceid.records import Array


@dataclass(frozen=True)
class Trajectory:
    """Motion x = F(t) X of one body, or of many at once, at the samples asked for.

    time (time,) s; F, dF (time, ..., 3, 3); energy (time, ...); angular_momentum (time, ..., 3), world axes,
    constant where W(QF) = W(F); circulation (time, ..., 3), body axes, constant where E = mu I and
    W(FQ) = W(F); pressure (time, ...): the multiplier Lambda of det F = 1, negative in tension, None for
    compressible bodies; event: None where nothing happened; method; step: the longest step taken, s. Units of
    the second moment. NaN after a body stopped. Source: pseudo-rigid bodies, section 1.
    """

    time: Array
    F: Array
    dF: Array
    energy: Array
    angular_momentum: Array
    circulation: Array
    pressure: Array | None
    event: Event | None
    method: str
    step: float
