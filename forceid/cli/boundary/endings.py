"""Every way in which a command ends, as one line and an exit code."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence
from contextlib import suppress

from forceid.cli.boundary.terminal import printable
from forceid.errors import EstimationError, ForceIdError

INTERRUPTED = 130
ROOM = 500 << 20  # bytes of address space that numpy and scipy take as they load, and a small file then
SHORT = ("Too many open files", "annot allocate memory", "failed to map segment")
ASKED: list[int] = []  # interrupts so far: some libraries make another error of one


def ending(error: BaseException, words: Sequence[str], debug: bool) -> tuple[str, int]:
    """The line and the exit code for whatever ended a command; words: its arguments."""
    said = " ".join(str(error).split()) or type(error).__name__
    if isinstance(error, KeyboardInterrupt) or type(error).__name__ == "Abort" or ASKED:
        return "interrupted", INTERRUPTED
    if isinstance(error, ForceIdError):
        return str(error), error.exit_code
    if hasattr(error, "format_message"):  # wrong usage, as typer reports it
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "forceid"
        return f"{error.format_message()} See {command} --help.", 2
    named = next((f"{word}: " for word in words if os.path.lexists(word) and not os.path.isdir(word)), "")
    if isinstance(error, MemoryError):
        return f"{named}there is not enough memory ({said}); give more, or fewer nodes, sensors or frames", 1
    if isinstance(error, ImportError) and any(short in said for short in SHORT):
        return f"{named}a library cannot be loaded ({said}); raise the limits of ulimit -n and -v", 1
    if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
        return f"{named}too many files are open; raise the limit with ulimit -n", 1
    if isinstance(error, OSError) and error.strerror:
        file = f"{os.fsdecode(error.filename)} " if isinstance(error.filename, str | bytes) else named
        return f"{file}cannot be used ({error.strerror}); give another path", 2
    if isinstance(error, UnicodeError):
        return f"{named}holds a name that cannot be written ({said}); rename it", 2
    hint = "" if debug else " (add --debug for the traceback)"
    return f"{named}unexpected {type(error).__name__}: {said}{hint}", 1


def fail(message: str, code: int) -> int:
    """Print the error as one line on stderr and return the exit code."""
    with suppress(OSError):  # where nobody can be told
        print("forceid: error:", printable(" ".join(message.split())), file=sys.stderr, flush=True)
    return code


def check_room() -> None:
    """An EstimationError where the libraries would stand still for want of address space as they load."""
    with suppress(ImportError):
        import resource  # not on every system

        space = resource.getrlimit(resource.RLIMIT_AS)[0]
        if 0 < space < ROOM:
            what = f"has {space >> 20} MB of address space, expected {ROOM >> 20} MB or more"
            raise EstimationError(what, "the process", "raise the limit with ulimit -v")
