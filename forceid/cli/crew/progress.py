"""How far a batch is: a bar where people look on, plain lines now and then where a log is kept."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from forceid.cli.boundary.terminal import tell

STEPS = 10  # lines at least, over a whole batch
SILENCE = 60.0  # s without a line at most, while files finish


@contextmanager
def progress(total: int, unit: str = "files") -> Iterator[Callable[[], None]]:
    """What to call after every file, or other unit; stderr then shows count, rate and time left."""
    if sys.stderr.isatty() and os.environ.get("TERM") != "dumb":
        with progress_bar(total, unit) as advance:
            yield advance
    else:
        yield plain_lines(total, unit=unit)


def plain_lines(
    total: int,
    write: Callable[[str], None] = lambda line: tell(line, sys.stderr),
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


def duration(seconds: float) -> str:
    """A time in the unit that one would say it in."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


@contextmanager
def progress_bar(total: int, unit: str) -> Iterator[Callable[[], None]]:
    """The same as a bar; without color where NO_COLOR is set."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{task.speed or 0:.2g} {unit}/s")

    columns = BarColumn(), MofNCompleteColumn(), Rate(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        task = shown.add_task("estimate", total=total)
        yield lambda: shown.advance(task)
