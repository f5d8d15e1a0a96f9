"""A flight that goes on: one frame after the other, and the wrench at those that have waited for the lag."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from forceid.estimation.live.loads import (
    NO_TURN,
    TICKS,
    begun_force,
    begun_moment,
    next_force,
    next_moment,
)
from forceid.estimation.live.model import LiveModel
from forceid.estimation.live.sight import Swing, look, moved
from forceid.flight.path.reference import COARSE
from forceid.kalman.recursions.fixed_lag import Course, without_first
from forceid.records import Array, Frame, LiveWrench

GAP = 1.5  # steps of the clock: a longer one has lost a frame
SPARED = 50  # frames from one that is left out to the next that may be: 2 %, as of a recording
UNTOLD = np.full(3, np.nan)  # of what no marker shows
MEMORY = 50  # frames over which the misfit is averaged: it is known to 6 %
MISFIT = 2.0  # mean squared innovation, in units of what is expected: one if the tuning fits
ASTRAY = 100.0  # the same, of a filter that is lost: ten standard deviations for many frames
YOUNG = 8  # frames after which a rotation that is uncertain has been lost, and not just begun
IN_TIME = 1e-6  # of a step: a frame that is due is not late by rounding


Pending = tuple[tuple[float, tuple[str, ...], float], ...]


class LiveFlight(NamedTuple):
    """A flight behind a frame: its time s, the two loads, the rotation, the amplitudes, and what is pending.

    origin (3,) m: from where places are counted; rotation None before the first pose; pending: of each frame
    whose wrench is not told yet the time, the reasons against it, and what its claimed variance is times;
    until s, why: up to when frames are degraded by what was lost before; spared: frames since one was left
    out; misfit: mean squared innovation of late, one where the tuning fits; age: frames so far.
    """

    time: float
    origin: Array
    force: Course
    moment: Course | None
    rotation: Array | None
    swing: Swing
    pending: Pending
    until: float
    why: str
    spared: int
    misfit: float
    age: int


def begun(model: LiveModel, frame: Frame, lag: float, momentum: Array, why: str = "") -> LiveFlight | None:
    """A flight at its first frame; None where that shows no pose.

    momentum (3,): a guess of the angular momentum, world axes; why: what the frames of the first lag suffer.
    """
    states = 0 if model.swings is None else len(model.swings.F)
    seen, swing, lacking = look(model, frame.position, moved(model, np.zeros(states)), 0)
    if seen is None:
        return None
    turn = seen.rotation, NO_TURN, seen.rotation
    force, _ = next_force(model, begun_force(model), 0, seen, seen.center, turn, False)
    moment = None
    if model.moment is not None:
        course = begun_moment(model, momentum)
        moment, _, _, _ = next_moment(model, course, seen.rotation, (0.0, 0), seen, (swing, swing), False)
    reasons = (*missing(model, lacking), *([why] if why else []))
    until = frame.time + lag if why else -np.inf
    return LiveFlight(
        frame.time, seen.center, force, moment, seen.rotation, swing, ((frame.time, reasons, 1.0),), until,
        why, SPARED, 1.0, 1,
    )  # fmt: skip


def behind(model: LiveModel, flight: LiveFlight, frame: Frame, lag: float) -> LiveFlight | None:
    """The flight behind one frame more; None where it is lost: unseen for long, or nowhere near them."""
    step = frame.time - flight.time
    ticks = max(1, round(step / model.step * TICKS))
    seen, swing, lacking = look(model, frame.position, flight.swing, max(1, round(step / model.step)))
    pending, until, why = flight.pending, flight.until, flight.why
    if step > GAP * model.step:
        pending, until, why = lost(flight, frame.time, lag, f"no frames for {step:.3g} s")
    wild = flight.spared >= SPARED
    moment, R, turn, off = flight.moment, flight.rotation, None, None
    if moment is not None and R is not None:
        before, swings = R, (flight.swing, swing)
        moment, R, by, off = next_moment(model, moment, R, (step, ticks), seen, swings, wild)
        turn = before, by, R
        P = moment.P
        if seen is not None and flight.age > YOUNG and P[0, 0] + P[1, 1] + P[2, 2] > COARSE**2:
            return None
    force, far = next_force(model, flight.force, ticks, seen, flight.origin, turn, wild)
    spoiled = ["place"] if not len(force.gain) and seen is not None else []
    if off is not None:
        assert moment is not None
        spoiled += ["turn"] if not len(moment.gain) and seen is not None else []
        far = 0.5 * (far + off)
    told = missing(model, lacking)
    if seen is None:
        pending, until, why = lost(flight, frame.time, lag, "frames without a pose")
        told = (f"{told[0]}: no pose",) if told else ("no pose",)
    if spoiled:
        told = (*told, f"its {' and '.join(spoiled)} left out: far off what is expected")
    if frame.time <= until and why not in told:
        told = (*told, why)
    misfit = flight.misfit
    if seen is not None and not spoiled:
        misfit += (far / 3 - misfit) / MEMORY
    if misfit > MISFIT:
        told = (*told, "late frames are far off what is expected: the tuning does not fit")
    if misfit > ASTRAY:
        return None
    pending = (*pending, (frame.time, told, misfit if misfit > MISFIT else 1.0))
    spared = 0 if spoiled else flight.spared + 1
    return LiveFlight(
        frame.time, flight.origin, force, moment, R, swing, pending, until, why, spared, misfit,
        flight.age + 1,
    )  # fmt: skip


def lost(flight: LiveFlight, time: float, lag: float, why: str) -> tuple[Pending, float, str]:
    """What is pending with a reason against all of it, up to when the reason holds, and the reason."""
    marked = tuple((t, r if why in r else (*r, why), times) for t, r, times in flight.pending)
    return marked, time + lag, why


def missing(model: LiveModel, lacking: int) -> tuple[str, ...]:
    """What is wrong with a frame that lacks markers."""
    return (f"{lacking} of {int(model.seen.sum())} markers missing",) if lacking else ()


def told(model: LiveModel, flight: LiveFlight, up_to: float) -> tuple[LiveFlight, tuple[LiveWrench, ...]]:
    """The wrenches at the pending frames up to a time, and the flight without them."""
    n = 0
    for time, _, _ in flight.pending:
        if time > up_to + IN_TIME * model.step:
            break
        n += 1
    if not n:
        return flight, ()
    found = tuple(wrench_at(model, flight, i) for i in range(n))
    moment = None if flight.moment is None else without_first(flight.moment, n)
    rest = flight._replace(force=without_first(flight.force, n), moment=moment, pending=flight.pending[n:])
    return rest, found


def wrench_at(model: LiveModel, flight: LiveFlight, i: int) -> LiveWrench:
    """The wrench at a pending frame."""
    own, (time, reasons, times) = slice(3 * i, 3 * i + 3), flight.pending[i]
    var = np.zeros(6)
    var[:3] = flight.force.var[own]
    if flight.moment is not None:
        var[3:] = flight.moment.var[own]
    std, force = (
        np.sqrt(times * (np.maximum(model.spread @ var, 0.0) + model.allowance)),
        flight.force.y[own].copy(),
    )
    if flight.moment is None:
        return LiveWrench(time, force, UNTOLD, std[:3], UNTOLD, reasons)
    return LiveWrench(time, force, flight.moment.y[own].copy(), std[:3], std[3:], reasons)
