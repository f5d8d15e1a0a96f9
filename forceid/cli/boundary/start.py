"""The command as the system starts it: an interrupt at any moment ends it with one line and exit code 130."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import NoReturn

from forceid.cli.boundary.endings import ASKED, INTERRUPTED, fail


def start() -> NoReturn:
    """Run the command line and leave with its exit code."""
    signal.signal(signal.SIGINT, at_once)
    from forceid.cli.app import main

    sys.unraisablehook = lambda _: None  # an interrupt that fell where nothing can be raised
    try:
        signal.signal(signal.SIGINT, ask)
        code = main()
    except KeyboardInterrupt:  # before the command began, or after it ended
        code = fail("interrupted", INTERRUPTED)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done and told
    sys.exit(code)


def at_once(_number: int, _frame: FrameType | None) -> NoReturn:
    """Nothing is loaded yet, and nothing begun."""
    os.write(2, b"forceid: error: interrupted\n")
    os._exit(INTERRUPTED)


def ask(_number: int, _frame: FrameType | None) -> NoReturn:
    """Remember the interrupt, and raise it."""
    ASKED.append(1)
    raise KeyboardInterrupt
