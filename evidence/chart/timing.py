"""What a job costs in time and memory.

Time is process CPU time; contestants take turns in rounds, in an order that reverses from round to round, and
the median counts. Memory is the peak of what Python and numpy allocate during the job (tracemalloc), in a run
of its own; what the compiled passes keep for themselves is not in it.
"""

from __future__ import annotations

import gc
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np

COLD = 10.0  # s: of a first run that is shorter, imports are more than a tenth, and it is run again
REPEATED = 0.03  # s: a run that is shorter is timed once more, in repetitions
ENOUGH = 0.01  # s: so long repetitions last


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


def warm_seconds(job: Callable[[], Any]) -> tuple[Any, float]:
    """What a job gives, and its CPU seconds once libraries are imported."""
    found, spent = seconds_of(job)
    for limit in (COLD, REPEATED):
        if spent < limit:
            spent = mean_seconds(job, spent)
    return found, spent


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
    """CPU seconds of a job; one that is over within ENOUGH runs until that has passed."""
    repeats = int(np.clip(ENOUGH / max(first, 1e-9), 1, 20))

    def all_of_them() -> None:
        for _ in range(repeats):
            job()

    return seconds_of(all_of_them)[1] / repeats
