"""How far a batch is: in the line of the command where people look on, plain lines where a log is kept."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from forceid.cli.boundary.status import CURRENT, duration
from forceid.cli.boundary.terminal import note

STEPS = 10  # lines at least, over a whole batch
SILENCE = 60.0  # s without a line at most, while files finish


@contextmanager
def progress(total: int, unit: str = "files") -> Iterator[Callable[[], None]]:
    """What to call after every file, or other unit; stderr then shows count and time left."""
    yield CURRENT[-1].count(total, unit) if CURRENT else plain_lines(total, unit=unit)


def plain_lines(
    total: int,
    write: Callable[[str], None] = lambda line: note(line, sys.stderr),
    clock: Callable[[], float] = time.monotonic,
    unit: str = "files",
) -> Callable[[], None]:
    """What to call after every file; a line at every tenth of them, and after a minute without one.

    >>> seconds = iter(range(100))
    >>> advance = plain_lines(20, print, lambda: next(seconds))
    >>> for _ in range(5):
    ...     advance()
    forceid: 2 of 20 files, 1 files/s, 18 s left
    forceid: 4 of 20 files, 1 files/s, 16 s left
    """
    began = said = clock()
    done = 0

    def advance() -> None:
        nonlocal done, said
        done, now = done + 1, clock()
        if done == total or (done * STEPS // total == (done - 1) * STEPS // total and now - said < SILENCE):
            return
        said, rate = now, done / max(now - began, 1e-9)
        write(
            f"forceid: {done} of {total} {unit}, {rate:.2g} {unit}/s, {duration((total - done) / rate)} left"
        )

    return advance
