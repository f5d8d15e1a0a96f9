"""What ends or marks a motion: det F = 0, a collapse, a step over a barrier, tension; and when.

A step with a stage at det F <= 0 is not taken. The reference integrator then goes again from the last sample
before it and tells which of three it was: `inversion` (det F passes zero and F stays regular; materials
without a barrier), `collapse` (det F below 1e-9 of its start behind a barrier, or F'' without bound), or
`step` (neither: the step was too long for the barrier or did not converge). `tension` (multiplier < 0) marks
and does not stop.
Source: pseudo-rigid bodies, sections 8 and 10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from forceid.pseudorigid.motion.constrained import multiplier
from forceid.pseudorigid.motion.reference import TooLongError, reference
from forceid.pseudorigid.motion.system import AffineSystem
from forceid.records import Array, Flags

EventKinds = NDArray[np.str_]
EVENT_DTYPE = "<U9"
SEARCH = 20_000  # evaluations of the force spent on what stopped a body


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


def stop_of(
    system: AffineSystem, F: Array, V: Array, begin: float, end: float, constrained: bool
) -> tuple[str, float]:
    """Kind and time of what stopped one body after the sample F, V (3, 3) at `begin`, by `end`."""
    try:
        found = reference(system, F, V, np.array([begin, end]), constrained, most=SEARCH)
    except TooLongError:
        return "step", begin
    return ("step", begin) if found.kind == "" else (found.kind, found.stop)


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
