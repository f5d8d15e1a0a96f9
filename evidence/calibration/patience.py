"""Work that is given a while of CPU and then stopped: one record of thousands must not hold up the others."""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType
from typing import TypeVar

T = TypeVar("T")


class TooLong(BaseException):
    """The while is over; no handler of errors takes it for one of its own."""


def within(seconds: float, work: Callable[[], T]) -> T | None:
    """What the work finds, None where it takes more CPU than that; in the first thread of a process alone.

    >>> within(10.0, lambda: 3)
    3
    """

    def stop(number: int, frame: FrameType | None) -> None:
        raise TooLong

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        return work()
    except TooLong:
        return None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
