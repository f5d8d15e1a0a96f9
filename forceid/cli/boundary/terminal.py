"""What is printed, made such that the terminal can show it, and that nothing is lost where it cannot."""

from __future__ import annotations

import codecs
import os
import re
import sys
import unicodedata
from contextlib import suppress
from threading import RLock
from typing import TextIO

PLAIN = {
    "±": "+-",
    "²": "2",
    "³": "3",
    "·": "*",
    "×": "x",
    "µ": "u",
    "μ": "u",
    "→": "->",
    "°": "deg",
    "–": "-",
}
WIDEST = 1000  # columns: no terminal has more, and tables are as wide as they are told
HIDDEN = ("Cc", "Cf", "Cs", "Zl", "Zp")  # characters that move the cursor, or what is beside them
LOST: list[OSError] = []  # why a part of the output is not there
LOUDNESS = [1]  # 0: nothing is said but errors and what was asked for; 2: every stage, too
DRAWN: list[str] = []  # the line on the terminal that the next one takes the place of
ONE_AT_A_TIME = RLock()
COLORS = {"ok": 32, "degraded": 33, "refused": 31, "failed": 35}  # of the words of a verdict
WORD = re.compile(rf"^((?:verdict|joints) +)?({'|'.join(COLORS)})\b", re.MULTILINE)


def plain(error: UnicodeError) -> tuple[str, int]:
    """What stands for characters that an encoding lacks."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    taken = error.object[error.start : error.end]
    shown = [
        PLAIN.get(c) or unicodedata.normalize("NFKD", c).encode("ascii", "ignore").decode() for c in taken
    ]
    return "".join(s or escaped(c) for s, c in zip(shown, taken, strict=True)), error.end


def escaped(character: str) -> str:
    """A character by its number, in ASCII."""
    return character.encode("ascii", "backslashreplace").decode()


def printable(text: str) -> str:
    r"""The text with what could steer a terminal written out; lines and tabs stay.

    >>> printable("\x1b[31mred")
    '\\x1b[31mred'
    """
    if re.sub(r"[\n\t ]", "", text).isprintable():
        return text
    return "".join(
        repr(c)[1:-1] if c not in "\n\t" and unicodedata.category(c) in HIDDEN else c for c in text
    )


def settle(loudness: int = 1) -> None:
    """Prepare streams and environment for whatever runs: done once, as a command begins."""
    LOUDNESS[:] = [loudness]
    for number in range(3):  # or the next file that is opened gets what is meant for the terminal
        with suppress(OSError):
            if not is_open(number):
                os.open(os.devnull, os.O_RDWR)
    sys.stdout, sys.stderr = (s or open(os.devnull, "w") for s in (sys.stdout, sys.stderr))  # noqa: SIM115
    codecs.register_error("forceid", plain)
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="forceid")  # type: ignore[union-attr]
    columns = os.environ.get("COLUMNS", "")
    if columns and not (columns.isdecimal() and len(columns) < 5 and 0 < int(columns) <= WIDEST):
        del os.environ["COLUMNS"]
    os.environ["MPLBACKEND"] = "agg"  # a command opens no window


def is_open(number: int) -> bool:
    """Whether a file is open by that number."""
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def tell(text: str, stream: TextIO | None = None) -> None:
    """Print a text at once. Where nobody can take it any more, the work goes on all the same."""
    stream = sys.stdout if stream is None else stream
    with ONE_AT_A_TIME:
        wipe()
        try:
            print(colored(printable(text), stream), file=stream, flush=True)
        except OSError as error:
            give_up(stream, error)


def note(text: str, stream: TextIO | None = None) -> None:
    """Print what one may do without: nothing under --quiet."""
    if LOUDNESS[0] > 0:
        tell(text, stream)


def draw(line: str) -> None:
    """Put a line on the terminal, in place of the one drawn before."""
    with ONE_AT_A_TIME, suppress(OSError, ValueError):
        wipe()
        sys.stderr.write(printable(line))
        sys.stderr.flush()
        DRAWN.append(line)


def wipe() -> None:
    """Take the line away that was drawn last, if it is there."""
    with ONE_AT_A_TIME, suppress(OSError, ValueError):
        if DRAWN:
            DRAWN.clear()
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


def colored(text: str, stream: TextIO) -> str:
    """The text with the words of a verdict in their colors, where a terminal shows them and may."""
    plain_only = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    if plain_only or not stream.isatty():
        return text
    return WORD.sub(lambda m: f"{m[1] or ''}\x1b[1;{COLORS[m[2]]}m{m[2]}\x1b[0m", text)


def give_up(stream: TextIO, error: OSError) -> None:
    """Write nothing more to a stream; what it lost is remembered, unless its reader went away."""
    if not isinstance(error, BrokenPipeError):
        LOST.append(error)
    with suppress(AttributeError, ValueError, OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def flushed() -> OSError | None:
    """What kept standard output from being written whole, if anything."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:
        give_up(sys.stdout, error)
    except ValueError:  # closed
        pass
    return LOST.pop() if LOST else None
