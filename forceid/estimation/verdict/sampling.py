"""Times of frames as a file has them: with few digits they are off, and a moving body with them."""

from __future__ import annotations

import numpy as np

from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.catalogue import note
from forceid.records import Array, Finding
from forceid.significance import PATIENCE


def judge_times(kin: Kinematics) -> list[Finding]:
    """Times with so few digits that the record would be far likelier with the times of an even clock.

    A frame that is off by e in time shows the mass center off by its speed times e. The errors of rounding
    repeat, as a load does that swings, and are taken for one where they are as much likelier as that asks.
    """
    clock = rounded_clock(kin.time)
    if clock is None:
        return []
    step, rate, error = clock
    shift = error[:, None] * np.gradient(kin.pose.center, kin.time, axis=0)
    var = np.diagonal(kin.pose.cov, axis1=1, axis2=2)[:, :3]
    known = np.isfinite(shift) & (var > 0)
    if not known.any():
        return []
    # of a body at rest: its speed has half the variance of a frame, over the square of the period
    by_noise = np.broadcast_to(0.5 * (error[:, None] * rate) ** 2, shift.shape)
    gained = 0.5 * float(np.sum(shift[known] ** 2 / var[known] - by_noise[known]))
    if gained < PATIENCE:
        return []
    size = float(np.sqrt(np.nansum(shift**2) / known.any(1).sum()))
    return [note("rounded-times", step_ms=1e3 * step, shift_mm=1e3 * size, rate_hz=rate)]


def rounded_clock(time: Array) -> tuple[float, float, Array] | None:
    """Step (s) to which times of an even clock are rounded, its rate (Hz), and the errors (time,) s.

    Such times have intervals of two sizes, one step apart, and lie within half a step of a line. None where
    they do not, as of a clock that is even, or uneven by itself.
    """
    if len(time) < 3:
        return None
    # a difference of two intervals holds the roundings of four times
    interval, exact = np.diff(time), 4 * np.spacing(np.abs(time).max())
    low, high = interval.min(), interval.max()
    step = float(high - low)
    if step < 2 * exact or np.minimum(interval - low, high - interval).max() > exact:
        return None
    frame = np.arange(len(time))
    period, start = np.polyfit(frame, time, 1)
    error = time - start - period * frame
    return (step, float(1 / period), error) if np.mean(error**2) <= (step / 2) ** 2 else None
