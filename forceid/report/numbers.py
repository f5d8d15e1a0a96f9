"""The numbers one quotes of an estimate: means, claims, errors against truth, momentum closure."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from forceid.records import Array, Estimate

INTERVAL = 1.959964  # standard deviations either way that hold 95 % of a normal


@dataclass(frozen=True)
class Numbers:
    """One number per axis, NaN where nothing is known. Force N, moment N m, world axes.

    mean and rms over time; `std` is the mean claimed standard deviation; `error` is the rms error
    against truth and `score` the rms of error over claimed deviation, about 1 when the claim is honest.
    force_closure N s: change of momentum minus the time integral of force and weight; moment_closure
    N m s: change of angular momentum minus that of the moment. `closure_limit` is the largest standard
    deviation that the impulse can have by the claim: a closure far beyond it contradicts the claim.
    """

    samples: int
    duration_s: float
    force_mean: Array
    force_rms: Array
    force_std: Array
    force_error: Array
    force_score: Array
    force_closure: Array
    force_closure_limit: Array
    moment_mean: Array
    moment_rms: Array
    moment_std: Array
    moment_error: Array
    moment_score: Array
    moment_closure: Array
    moment_closure_limit: Array

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers and lists, NaN kept."""
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in asdict(self).items()}


def wrench_numbers(estimate: Estimate, truth: Mapping[str, Array] | None = None) -> Numbers:
    """What to quote of `estimate`; errors are NaN without `truth`."""
    e, found = estimate, dict[str, Any]()
    # the angular momentum is about the mass center, and closes no other moment
    moment = e.moment if e.moment_about == "mass_center" else np.full_like(e.moment, np.nan)
    # where mass changes, what of the loads moves one that does not
    part = (
        1.0 if e.flown is None or e.flown.current_mass is None else (e.mass / e.flown.current_mass)[:, None]
    )
    changes = {
        "force": (e.mass * e.velocity, part * e.force + e.mass * e.gravity),
        "moment": (part * e.angular_momentum, part * moment),
    }
    for name, (momentum, whole) in changes.items():
        load, std = getattr(e, name), getattr(e, f"{name}_std")
        gap, limit = closure(e.time, momentum, whole, part * std)
        error = load - truth_at(e, truth or {}, name)
        found |= {f"{name}_mean": mean(load), f"{name}_rms": rms(load), f"{name}_std": mean(std)}
        found |= {f"{name}_error": rms(error), f"{name}_score": rms(error / positive_or_nan(std))}
        found |= {f"{name}_closure": gap, f"{name}_closure_limit": limit}
    return Numbers(samples=len(e.time), duration_s=float(e.time[-1] - e.time[0]), **found)


def truth_at(estimate: Estimate, truth: Mapping[str, Array], name: str) -> Array:
    """The true variable (time, ...) at the times of the estimate, NaN where unknown.

    The truth states its moment about the mass center, so another `moment_about` has no truth.
    """
    elsewhere = name == "moment" and estimate.moment_about != "mass_center"
    if name not in truth or elsewhere:
        return np.full_like(getattr(estimate, name), np.nan)
    return resampled(estimate.time, truth.get("time", estimate.time), truth[name])


def resampled(time: Array, clock: Array, values: Array) -> Array:
    """Values (clock, ...) at `time`, NaN outside the clock."""
    columns = values.reshape(len(clock), -1).T
    found = [np.interp(time, clock, column, left=np.nan, right=np.nan) for column in columns]
    return np.stack(found, -1).reshape(len(time), *values.shape[1:])


def closure(time: Array, momentum: Array, load: Array, std: Array) -> tuple[Array, Array]:
    """Change of momentum (time, 3) minus the impulse of the load (time, 3), and its limit; each (3,).

    Over the intervals known. The limit is the integral of the deviation `std`: that of the impulse can be
    no larger, and is reached where errors never change.
    """
    gap = np.diff(momentum, axis=0) - impulses(time, load)
    return total(gap), total(np.where(np.isfinite(gap), impulses(time, std), np.nan))


def impulses(time: Array, load: Array) -> Array:
    """Impulse of each interval (time - 1, 3), by the trapezoid rule."""
    return 0.5 * (load[1:] + load[:-1]) * np.diff(time)[:, None]


def total(values: Array) -> Array:
    """Sum over time of what is known, NaN where nothing is."""
    known = np.isfinite(values)
    return np.where(known.any(axis=0), np.sum(values, axis=0, where=known), np.nan)


def mean(values: Array) -> Array:
    """Mean over time of what is known, NaN where nothing is.

    >>> mean(np.array([[1.0, np.nan], [3.0, np.nan]]))
    array([ 2., nan])
    """
    known = np.isfinite(values)
    count = known.sum(axis=0)
    return np.where(count > 0, total(values) / np.maximum(count, 1), np.nan)


def rms(values: Array) -> Array:
    """Root mean square over time of what is known, NaN where nothing is."""
    return np.sqrt(mean(values**2))


def positive_or_nan(std: Array) -> Array:
    """A claimed deviation to divide by: NaN where nothing was claimed."""
    return np.where(std > 0, std, np.nan)


def plain(value: float, count: int) -> str:
    """A number at `count` significant digits, with an exponent only where it is far from one.

    >>> plain(441.7, 2), plain(1963.0, 3), plain(2.7e-6, 2)
    ('440', '1960', '2.7e-06')
    """
    rounded = float(f"{value:.{count}g}")
    return f"{rounded:.0f}" if 10**count <= abs(rounded) < 1e6 else f"{rounded:.{count}g}"


def digits(value: float, count: int = 4) -> str:
    """A number at `count` significant digits, a dash for what is not known."""
    return typeset(plain(value, count)) if np.isfinite(value) else "–"


def typeset(number: str) -> str:
    """A number in plain ASCII with a true minus sign and its exponent raised.

    >>> typeset("-6.5e-08 N")
    '−6.5×10⁻⁸ N'
    """
    raised = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
    text = re.sub(r"e([+-]\d+)", lambda m: "×10" + str(int(m[1])).translate(raised), number)
    return text.replace("-", "−")


def plus_minus(values: Array, std: Array, unit: str) -> str:
    """The length of a vector with its claimed deviation, or that it is not known.

    >>> plus_minus(np.array([3.0, 0.0, 4.0]), np.array([0.03, 0.0, 0.04]), "N")
    '5 ± 0.05 N'
    >>> plus_minus(np.full(3, np.nan), np.zeros(3), "N m")
    'not identifiable'
    """
    size, spread = float(np.linalg.norm(values)), float(np.linalg.norm(std))
    if not np.isfinite(size):
        return "not identifiable"
    claim = f" ± {plain(spread, 2)}" if np.isfinite(spread) else ""
    return f"{plain(size, 3)}{claim} {unit}"
