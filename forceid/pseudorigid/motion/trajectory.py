"""What a simulation gives: F and F' over time, what should stay constant, and what ends or marks a motion.

A step with a stage at det F <= 0 is not taken. The reference integrator then goes again from the last sample
before it and tells which of three it was: `inversion` (det F passes zero and F stays regular; materials
without a barrier), `collapse` (det F below 1e-9 of its start behind a barrier, or F'' without bound), or
`step` (neither: the step was too long for the barrier). `tension` (multiplier < 0) marks and does not stop.
Source: pseudo-rigid bodies, sections 1, 8 and 10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from forceid.pseudorigid.factors.cofactors import EYE
from forceid.pseudorigid.motion.constrained import multiplier
from forceid.pseudorigid.motion.invariants import angular_momentum, circulation
from forceid.pseudorigid.motion.invariants import energy as energy_of
from forceid.pseudorigid.motion.reference import Drive, TooLongError, reference
from forceid.pseudorigid.motion.system import AffineSystem, EventKinds, Path
from forceid.records import Array, Flags

SEARCH = 20_000  # evaluations of the force spent on what stopped a body


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
    time: Array,
    path: Path,
    lead: tuple[int, ...],
    method: str,
    step: float = float("nan"),
    drive: Drive | None = None,
) -> Trajectory:
    """Invariants, multiplier and events of bodies of the leading axes `lead`, and what drives them."""
    F, V, kind, when, _ = path
    pull, driven, shape = np.zeros_like(F), {}, (len(time), *lead)
    if drive is not None:
        center, velocity = path.center[..., :3], path.center[..., 3:]
        force, N, pull = drive.sampled(time, F, V, center, velocity)
        pull, vectors = system.over_moment(pull), {"center": center, "velocity": velocity, "force": force}
        driven = {name: value.reshape(*shape, 3) for name, value in vectors.items()}
        driven["first_moment"] = N.reshape(*shape, 3, 3)
    ended = np.isnan(F[..., 0, 0])
    known = F if not ended.any() else np.where(ended[..., None, None], EYE, F)
    energy = np.where(ended, np.nan, energy_of(known, V, system.E, system.material))
    pressure = None
    stopped = kind != ""
    if system.constrained:
        pressure = np.where(ended, np.nan, multiplier(system, known, V, pull))
        tension = tension_times(time, F, V, pressure, system, pull)
        tense = ~np.isnan(tension) & ~stopped
        kind, when = np.where(tense, "tension", kind), np.where(tense, tension, when)
    event = None
    if (kind != "").any():
        event = Event(kind.reshape(lead), when.reshape(lead), stopped.reshape(lead))
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
        **driven,
    )


@dataclass(frozen=True)
class Event:
    """The first event of every body: kind (...,), "" where none; time (...,) s, NaN where none.

    stopped (...,): bodies that it ended. A stopped body is NaN from its event on. Where tension came first
    and something stopped the body later, `kind` tells what stopped it. A `step` has the time of the sample
    after which the step failed.
    """

    kind: EventKinds
    time: Array
    stopped: Flags

    def __str__(self) -> str:
        pairs = zip(self.kind.ravel(), self.time.ravel(), strict=True)
        return ", ".join(f"{kind} at t = {time:.6g} s" for kind, time in pairs if kind)


def stop_of(system: AffineSystem, F: Array, V: Array, begin: float, end: float) -> tuple[str, float]:
    """Kind and time of what stopped one body after the sample F, V (3, 3) at `begin`, by `end`."""
    try:
        found = reference(system, F, V, np.array([begin, end]), most=SEARCH)
    except TooLongError:
        return "step", begin
    return (found.kind[0], found.stop[0]) if found.kind[0] else ("step", begin)


def tension_times(
    time: Array, F: Array, V: Array, pressure: Array, system: AffineSystem, pull: Array
) -> Array:
    """First time (body,) of a negative multiplier (time, body), by cubics of F between samples; else NaN."""
    with np.errstate(invalid="ignore"):
        negative = pressure < 0
    out = np.full(pressure.shape[1], np.nan)
    for body in np.flatnonzero(negative.any(0)):
        k = int(negative[:, body].argmax())
        out[body] = time[0] if k == 0 else crossing(time, F[:, body], V[:, body], system, pull[:, body], k)
    return out


def crossing(time: Array, F: Array, V: Array, system: AffineSystem, pull: Array, k: int) -> float:
    """Where between samples k - 1 and k of one body (time, 3, 3) the multiplier changes sign."""
    ends = slice(k - 1, k + 1)
    path, (begin, end) = CubicHermiteSpline(time[ends], F[ends], V[ends]), time[ends]

    def value(t: float) -> float:
        straight = ((end - t) * pull[k - 1] + (t - begin) * pull[k]) / (end - begin)
        return float(multiplier(system, path(t), path(t, 1), straight))

    if value(time[k - 1]) * value(time[k]) > 0:  # rounding at the end
        return float(time[k])
    return float(brentq(value, time[k - 1], time[k], xtol=1e-13))
