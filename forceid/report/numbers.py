"""The numbers one quotes of an estimate: means, claims, errors against truth, momentum closure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from forceid.records import Array, Estimate


@dataclass(frozen=True)
class Numbers:
    """One number per axis, NaN where nothing is known. Force N, moment N m, world axes.

    mean and rms over time; `std` is the mean claimed standard deviation; `error` is the rms error
    against truth and `score` the rms of error over claimed deviation, about 1 when the claim is honest.
    moment_closure N m s: change of angular momentum minus the time integral of the moment.
    """

    samples: int
    duration_s: float
    force_mean: Array
    force_rms: Array
    force_std: Array
    force_error: Array
    force_score: Array
    moment_mean: Array
    moment_rms: Array
    moment_std: Array
    moment_error: Array
    moment_score: Array
    moment_closure: Array

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers and lists, NaN kept."""
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in asdict(self).items()}


def summarize(estimate: Estimate, truth: Mapping[str, Array] | None = None) -> Numbers:
    """What to quote of `estimate`; errors are NaN without `truth`."""
    e, truth = estimate, truth or {}
    force_error, moment_error = (wrench_error(e, truth, name) for name in ("force", "moment"))
    return Numbers(
        samples=len(e.time),
        duration_s=float(e.time[-1] - e.time[0]),
        force_mean=mean(e.force),
        force_rms=rms(e.force),
        force_std=mean(e.force_std),
        force_error=rms(force_error),
        force_score=rms(force_error / positive(e.force_std)),
        moment_mean=mean(e.moment),
        moment_rms=rms(e.moment),
        moment_std=mean(e.moment_std),
        moment_error=rms(moment_error),
        moment_score=rms(moment_error / positive(e.moment_std)),
        moment_closure=moment_closure(e),
    )


def wrench_error(estimate: Estimate, truth: Mapping[str, Array], name: str) -> Array:
    """Estimate minus truth of the `force` or the `moment` (time, 3), NaN where there is no truth."""
    found: Array = getattr(estimate, name)
    return found - truth_at(estimate, truth, name)


def truth_at(estimate: Estimate, truth: Mapping[str, Array], name: str) -> Array:
    """The true variable at the times of the estimate (time, 3), NaN where unknown.

    The truth states its moment about the mass center, so another `moment_about` has no truth.
    """
    elsewhere = name == "moment" and estimate.moment_about != "mass_center"
    if name not in truth or elsewhere:
        return np.full_like(getattr(estimate, name), np.nan)
    clock, values = truth.get("time", estimate.time), truth[name]
    columns = [np.interp(estimate.time, clock, c, left=np.nan, right=np.nan) for c in values.T]
    return np.stack(columns, axis=-1)


def moment_closure(estimate: Estimate) -> Array:
    """Change of angular momentum minus the integral of the moment (3,) N m s, over the intervals known."""
    if estimate.moment_about != "mass_center":
        return np.full(3, np.nan)
    impulse = 0.5 * (estimate.moment[1:] + estimate.moment[:-1]) * np.diff(estimate.time)[:, None]
    gap: Array = np.diff(estimate.angular_momentum, axis=0) - impulse
    known = np.isfinite(gap)
    return np.where(known.any(axis=0), np.sum(gap, axis=0, where=known), np.nan)


def mean(values: Array) -> Array:
    """Mean over time of what is known, NaN where nothing is.

    >>> mean(np.array([[1.0, np.nan], [3.0, np.nan]]))
    array([ 2., nan])
    """
    known = np.isfinite(values)
    count = known.sum(axis=0)
    total = np.sum(values, axis=0, where=known)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def rms(values: Array) -> Array:
    """Root mean square over time of what is known, NaN where nothing is."""
    return np.sqrt(mean(values**2))


def positive(std: Array) -> Array:
    """A claimed deviation to divide by: NaN where nothing was claimed."""
    return np.where(std > 0, std, np.nan)


def plus_minus(values: Array, std: Array, unit: str) -> str:
    """The length of a vector with its claimed deviation, or that it is not known.

    >>> plus_minus(np.array([3.0, 0.0, 4.0]), np.array([0.03, 0.0, 0.04]), "N")
    '5 ± 0.05 N'
    >>> plus_minus(np.full(3, np.nan), np.zeros(3), "N m")
    'not identifiable'
    """
    size, spread = np.linalg.norm(values), np.linalg.norm(std)
    if not np.isfinite(size):
        return "not identifiable"
    return f"{size:.3g} ± {spread:.2g} {unit}" if np.isfinite(spread) else f"{size:.3g} {unit}"
