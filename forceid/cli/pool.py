"""A pool of processes over motion files: each result or failure as it comes, whatever a file does."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from forceid.cli.estimate import estimate_file
from forceid.errors import ForceIdError

if TYPE_CHECKING:
    from forceid.config import Settings

Job: TypeAlias = tuple[Path, Path]
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def run_jobs(jobs: Sequence[Job], settings: Settings, workers: int) -> Iterator[dict[str, Any]]:
    """The record of each job as it finishes.

    A file that kills its process takes the pool with it: the jobs lost then run again one at a time, so
    that only the guilty one fails. Processes are spawned, with one BLAS thread each.
    """
    if not jobs:
        return
    os.environ.update(dict.fromkeys(THREADS, "1"))  # read by BLAS when the spawned process imports numpy
    lost: list[Job] = []
    asked: list[int] = []  # an interrupt that falls into a destructor raises nothing: it is remembered
    before = signal.signal(signal.SIGINT, lambda number, frame: interrupt(asked, number))
    pool = ProcessPoolExecutor(min(workers, len(jobs)), get_context("spawn"), initializer=ignore_interrupt)
    try:
        pending = {pool.submit(run_job, *job, settings): job for job in jobs}
        for done in as_completed(pending):
            if asked:
                raise KeyboardInterrupt
            try:
                yield done.result()
            except BrokenProcessPool:
                lost.append(pending[done])
    except KeyboardInterrupt:
        print("forceid: finishing the files under way", file=sys.stderr)
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        signal.signal(signal.SIGINT, before)
    if lost == list(jobs) and len(jobs) == 1:
        yield failure(*jobs[0], "its process died, perhaps for want of memory")
        return
    for job in lost:
        yield from run_jobs([job], settings, 1)


def run_job(source: Path, output: Path, settings: Settings) -> dict[str, Any]:
    """Estimate one file; every failure becomes a record that says why."""
    try:
        record = estimate_file(source, output, settings)
        return {"status": record["verdict"], **record}
    except ForceIdError as error:
        return failure(source, output, str(error))
    except Exception as error:
        hint = f"forceid estimate {source} --debug shows where"
        return failure(source, output, f"unexpected {type(error).__name__}: {error} ({hint})")


def failure(source: Path, output: Path, error: str) -> dict[str, Any]:
    """The record of a file that has no result."""
    return {"status": "failed", "file": str(source), "output": str(output), "error": " ".join(error.split())}


def interrupt(asked: list[int], number: int) -> None:
    """Remember that the user asked to stop, and stop."""
    asked.append(number)
    raise KeyboardInterrupt


def ignore_interrupt() -> None:
    """Leave the interrupt to the parent: it hands out no more files, and those under way are finished."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
