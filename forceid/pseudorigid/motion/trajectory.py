"""What a simulation gives: F and F' over time, what should stay constant, and the first event.

Source: pseudo-rigid bodies, section 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.pseudorigid.factors.cofactors import EYE
from forceid.pseudorigid.motion.constrained import multiplier
from forceid.pseudorigid.motion.events import Event, EventKinds, tension_times
from forceid.pseudorigid.motion.invariants import angular_momentum, circulation
from forceid.pseudorigid.motion.invariants import energy as energy_of
from forceid.pseudorigid.motion.system import AffineSystem
from forceid.records import Array


@dataclass(frozen=True)
class Trajectory:
    """Motion x = F(t) X of one body, or of many at once, at the samples asked for.

    time (time,) s; F, dF (time, ..., 3, 3); energy (time, ...); angular_momentum (time, ..., 3), world axes,
    constant where W(QF) = W(F); circulation (time, ..., 3), body axes, constant where E = mu I and
    W(FQ) = W(F); pressure (time, ...): the multiplier Lambda of det F = 1, negative in tension, None for
    compressible bodies; event: None where nothing happened; method; step: the longest step taken, s. Units of
    the second moment. NaN after a body stopped.

    Of a driven body also center m and velocity m/s (time, ..., 3), applied force N (time, ..., 3), without
    weight, and applied first moment N m (time, ..., 3, 3), rows in world, columns in body axes; None of a
    free one. energy is that about the mass center, and changes by the power of what drives it.
    Source: pseudo-rigid bodies, section 1.
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
    center: Array | None = None
    velocity: Array | None = None
    force: Array | None = None
    first_moment: Array | None = None


def trajectory_of(
    system: AffineSystem,
    constrained: bool,
    time: Array,
    path: tuple[Array, Array, EventKinds, Array],
    lead: tuple[int, ...],
    method: str,
    step: float = float("nan"),
    pull: Array | None = None,
) -> Trajectory:
    """Invariants, multiplier and events of bodies of the leading axes `lead`.

    path: F and V (time, body, 3, 3), kinds and times of stops (body,); pull (time, body, 3, 3): what loads
    add to F''.
    """
    F, V, kind, when = path
    ended = np.isnan(F[..., 0, 0])
    known = F if not ended.any() else np.where(ended[..., None, None], EYE, F)
    energy = np.where(ended, np.nan, energy_of(known, V, system.E, system.material))
    pressure = None
    stopped = kind != ""
    if constrained:
        pull = np.zeros_like(F) if pull is None else pull
        pressure = np.where(ended, np.nan, multiplier(system, known, V, pull))
        tension = tension_times(time, F, V, pressure, system, pull)
        tense = ~np.isnan(tension) & ~stopped
        kind, when = np.where(tense, "tension", kind), np.where(tense, tension, when)
    event = None
    if (kind != "").any():
        event = Event(kind.reshape(lead), when.reshape(lead), stopped.reshape(lead))
    shape = (len(time), *lead)
    return Trajectory(
        time,
        F.reshape(*shape, 3, 3),
        V.reshape(*shape, 3, 3),
        energy.reshape(shape),
        angular_momentum(F, V, system.E).reshape(*shape, 3),
        circulation(F, V, system.E).reshape(*shape, 3),
        None if pressure is None else pressure.reshape(shape),
        event,
        method,
        step,
    )
