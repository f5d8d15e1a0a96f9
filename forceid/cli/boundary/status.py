"""One line on the terminal while a command works: what it does, how much is done, how long it may take.

It is on stderr, and only where that is a terminal. Others may print between: `terminal.tell` wipes it first.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from math import exp
from threading import Event, Thread

from forceid.cli.boundary.terminal import LOUDNESS, draw, tell, wipe
from forceid.timing import watched

FIRST, EVERY = 0.5, 0.25  # s: until the line is there, and between two looks at it
SHARES = {  # of an estimate that are done as a stage begins, about: by --profile on the shipped motions
    "loading": 0.0, "reading": 0.05, "kinematics": 0.08, "level": 0.12, "deformation": 0.2, "noise": 0.24,
    "force": 0.25, "moment": 0.3, "instruments": 0.34, "flight": 0.35, "flight_tuning": 0.4, "joints": 0.2,
    "frames": 0.55, "lines": 0.6, "axes": 0.75, "claims": 0.9, "witness": 0.94, "verdict": 0.97,
    "writing": 0.99,
}  # fmt: skip
CREEP = 0.5  # of the time so far: how fast the share goes on within a stage
SURE_SHARE = 0.15  # done, before a time left is told
OWN_LINES = ("live", "chart")  # commands that show how far they are by themselves


class Status:
    """What is known of the work: the stage it is in, and units done where these can be counted."""

    def __init__(self, command: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.command, self.clock, self.began = command, clock, clock()
        self.stage, self.entered, self.share, self.next = "", self.began, 0.0, 0.05
        self.told = 0.0
        self.unit, self.done, self.total, self.counted = "", 0, 0, self.began

    def enter(self, stage: str) -> None:
        """A stage begins, or goes on after one within it; what belongs to none is told as what it follows."""
        if stage == "rest":
            return
        if stage == "joints" and self.next < 1:  # of all parts together: the body as one was the smaller part
            self.share, self.next, self.told = SHARES["joints"], 1.0, 0.0
        elif self.next < 1 and SHARES.get(stage, 0.0) > self.share:
            self.share = SHARES[stage]
            self.next = min((s for s in SHARES.values() if s > self.share), default=0.999)
        if stage != self.stage:
            self.stage, self.entered = stage, self.clock()

    def count(self, total: int, unit: str) -> Callable[[], None]:
        """Count units from now on; what to call after every one."""
        self.total, self.unit, self.done, self.counted = total, unit, 0, self.clock()

        def advance() -> None:
            self.done += 1

        return advance

    def text(self, width: int = 1000) -> str:
        """The line as it is now; where it is too narrow for all, without what the stage does.

        >>> seconds = iter([0.0, 8.0, 8.0, 8.0, 8.0])
        >>> status = Status("batch", lambda: next(seconds))
        >>> advance = status.count(4, "files")
        >>> advance()
        >>> status.text()
        'forceid batch: 1 of 4 files, 25 %, 0 s left'
        """
        now = self.clock()
        if self.total:
            share, spent = self.done / self.total, now - self.counted
            what = f"{self.done} of {self.total} {self.unit}"
        else:
            spent, inside = now - self.began, now - self.entered
            found = self.share + (self.next - self.share) * (1 - exp(-inside / (CREEP * spent + 1e-9)))
            share = self.told = max(self.told, found)
            what = self.stage.replace("_", " ")
        parts = [what] if what else []
        if self.done or self.stage:
            parts.append(f"{100 * share:.0f} %")
        if share >= SURE_SHARE or self.done:
            parts.append(f"{duration(spent * (1 - share) / share)} left")
        else:
            parts.append(f"{duration(now - self.began)} so far")
        said = "" if self.total else words().get(self.stage, "")
        line = f"forceid {self.command}: {', '.join(parts)}"
        full = line.replace(what, f"{what} ({said})", 1) if what and said else line
        return full if len(full) < width else line[: width - 1]


_words: dict[str, str] = {}


def words() -> dict[str, str]:
    """What every stage does, as the table of times says it."""
    if not _words:
        import tomllib
        from importlib.resources import files

        _words.update(tomllib.loads((files("forceid.report") / "stages.toml").read_text("utf-8")))
    return _words


def duration(seconds: float) -> str:
    """A time in the unit that one would say it in."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


CURRENT: list[Status] = []  # the one that is shown, if any


@contextmanager
def shown(command: str) -> Iterator[None]:
    """Show the work within on the terminal; the loudest says on stderr when each stage was first met."""
    met = {"rest"}
    verbose = LOUDNESS[0] > 1
    status, over = Status(command), Event()
    looked_at = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
    line = None
    if looked_at and LOUDNESS[0] and command and command not in OWN_LINES:
        CURRENT.append(status)
        line = Thread(target=redraw, args=(status, over), daemon=True)
        line.start()

    def follow(stage: str) -> None:
        status.enter(stage)
        if verbose and stage not in met:
            met.add(stage)
            at, said = status.clock() - status.began, words().get(stage, "")
            tell(f"{at:8.2f} s  {stage.replace('_', ' '):14}{said}".rstrip(), sys.stderr)

    try:
        with watched(follow) if line or verbose else nullcontext():
            yield
    finally:
        over.set()
        CURRENT.clear()
        if line:
            line.join()
            wipe()


def redraw(status: Status, over: Event) -> None:
    """Draw the line now and then until the work is over."""
    wait = FIRST
    while not over.wait(wait):
        draw(status.text(shutil.get_terminal_size().columns))
        wait = EVERY
