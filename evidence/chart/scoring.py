"""What an answer is worth: errors by axis, coverage, and what the job cost in time and memory.

Time is process CPU time; contestants take turns in rounds, in an order that reverses from round to round, and
the median counts. Memory is the peak of what Python and numpy allocate during the job (tracemalloc), in a run
of its own; what the compiled passes keep for themselves is not in it.
"""

from __future__ import annotations

import gc
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from evidence.subjects.flights.cases import LOADS, Case
from evidence.subjects.flights.contestant import Answer
from forceid.records import Array

QUANTILE = 1.959964  # of the normal distribution: 95 % lie within


@dataclass(frozen=True)
class Score:
    """Mean squares over the judged part, by axis (6,), NaN where there is no truth or no claim.

    error: of the answer; claimed: its variance; inside: share in the 95 % interval; load: of the truth.
    """

    error: tuple[float, ...]
    claimed: tuple[float, ...]
    inside: tuple[float, ...]
    load: tuple[float, ...]


def score(case: Case, answer: Answer) -> Score:
    """An answer against the truth, over the central three quarters."""
    at, truth = case.judged, case.wrench[case.judged]
    error = answer.wrench[at] - truth
    if answer.std is None:
        claimed = inside = np.full(6, np.nan)
    else:
        var = answer.std[at] ** 2
        known = np.isfinite(error) & np.isfinite(var)
        inside = np.where(known, error**2 <= QUANTILE**2 * var, np.nan).mean(0)
        claimed = var.mean(0)
    return Score(*(tuple(map(float, a)) for a in ((error**2).mean(0), claimed, inside, (truth**2).mean(0))))


def rms(squares: Any) -> Array:
    """Rms per axis of force and of moment (2,), of mean squares by axis (..., 6); over all that lead.

    >>> rms([[1.0, 4.0, 4.0, 0.0, 0.0, float("nan")]]).round(3).tolist()
    [1.732, nan]
    """
    squares = np.asarray(squares, float).reshape(-1, 6)
    return np.sqrt([squares[:, part].mean() for part in LOADS.values()])


def share(inside: Any) -> Array:
    """Mean of force and of moment (2,), of shares by axis (..., 6)."""
    inside = np.asarray(inside, float).reshape(-1, 6)
    return np.array([inside[:, part].mean() for part in LOADS.values()])


def seconds_of(job: Callable[[], Any]) -> tuple[Any, float]:
    """What a job gives, and its CPU seconds; the garbage of others is collected before."""
    gc.collect()
    gc.disable()
    try:
        start = time.process_time()
        found = job()
        return found, time.process_time() - start
    finally:
        gc.enable()


def peak_of(job: Callable[[], Any]) -> float:
    """Peak of allocations during a job, MB."""
    gc.collect()
    tracemalloc.start()
    try:
        job()
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def mean_seconds(job: Callable[[], Any], first: float) -> float:
    """CPU seconds of a job; one that is over within a hundredth of a second runs until that has passed."""
    repeats = int(np.clip(0.01 / max(first, 1e-9), 1, 20))

    def all_of_them() -> None:
        for _ in range(repeats):
            job()

    return seconds_of(all_of_them)[1] / repeats
