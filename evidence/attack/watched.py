"""One command under watch: a child process with limits of time and memory, and what is wrong with its end."""

from __future__ import annotations

import os
import resource
import select
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from pathlib import Path

PATIENCE = 30.0  # s of CPU that one command may take: what the clock says too, where nothing else runs
HUNG = 6 * PATIENCE  # s on the clock, after which it is ended: other work may run on the machine
SPACE = 3 << 30  # bytes of address space: an estimate of a small file takes a tenth of that
CODES = (0, 1, 2, 3, 130)  # of the contract
START = [sys.executable, "-c", "from forceid.cli.boundary.start import start; start()"]


@dataclass(frozen=True)
class End:
    """How a command ended: exit code, or minus the signal; what it printed; s of CPU; whether late."""

    words: tuple[str, ...]
    code: int
    out: str
    err: str
    seconds: float
    late: bool = False

    @property
    def last(self) -> str:
        """The line of the error."""
        return next((line for line in reversed(self.err.splitlines()) if "error:" in line), "")

    def faults(self, name: str = "") -> list[str]:
        """What is wrong with it. name: what a refusal has to name.

        >>> End(("estimate",), 3, "", "forceid: error: a.h5:/body is missing; add it", 0.1).faults("a.h5")
        []
        """
        if self.late:
            return ["late"]
        found = []
        if self.code not in CODES or "unexpected " in self.err + self.out:
            found.append("unexpected")
        if "Traceback" in self.err:
            found.append("traceback")
        lines = [line for line in self.err.splitlines() if line.strip() and not line.startswith("forceid")]
        if lines:
            found.append("noise on stderr")
        if self.code in (2, 3) and name and name not in self.last:
            found.append("unnamed")
        if self.code in (2, 3) and "; " not in self.last and " See " not in self.last:
            found.append("no next step")
        return found


def warm(folder: Path) -> None:
    """Load all that a command needs, so that forks need not: one estimate, and its report."""
    from contextlib import redirect_stdout

    from evidence.attack.bodies import write
    from forceid.cli.app import main

    source = write(folder / "warm.h5", "sensors")
    with open(os.devnull, "w") as silence, redirect_stdout(silence):
        for words in (["inspect"], ["estimate"], ["report", "-o", str(folder / "warm.html")]):
            name = "warm.result.h5" if words[0] == "report" else source.name
            main([words[0], str(folder / name), *words[1:]])
    for path in folder.glob("warm.*"):
        path.unlink()


def forked(words: Sequence[str], folder: Path, space: int = SPACE, patience: float = PATIENCE) -> End:
    """The end of a command in a fork of this process, which has loaded all that it needs."""
    from forceid.cli.app import main

    def work() -> int:
        sys.argv[1:] = words
        return main()

    return child_end(work, words, folder, space, patience)


def child_end(
    work: Callable[[], int],
    words: Sequence[str],
    folder: Path,
    space: int = SPACE,
    patience: float = PATIENCE,
) -> End:
    """The end of a piece of work in a fork of this process, in a folder."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = os.fork()
        if not process:
            begin(folder, out.fileno(), err.fileno(), space)
            code = 99
            try:
                code = work()
                sys.stdout.flush()
                sys.stderr.flush()
            except BaseException as error:
                os.write(2, f"Traceback: {type(error).__name__}: {error}\n".encode())
            finally:
                os._exit(code)
        status, seconds = waited(process, HUNG / PATIENCE * patience)
        said = [read(stream) for stream in (out, err)]
        return End(tuple(words), status, *said, seconds, seconds > patience)


def begin(folder: Path, out: int, err: int, space: int) -> None:
    """The child: its folder, its streams, its limits."""
    os.setpgid(0, 0)
    os.chdir(folder)
    os.dup2(out, 1)
    os.dup2(err, 2)
    sys.stdout = os.fdopen(1, "w", encoding="utf-8", errors="backslashreplace", closefd=False)
    sys.stderr = os.fdopen(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (space, space))


def waited(process: int, hung: float) -> tuple[int, float]:
    """Exit code of a process, minus the signal that ended it, and its s of CPU, endless where it hung."""
    handle = os.pidfd_open(process)
    try:
        ended = bool(select.select([handle], [], [], hung)[0])
    finally:
        os.close(handle)
    if not ended:
        for group in (os.killpg, os.kill):
            with suppress(ProcessLookupError):
                group(process, signal.SIGKILL)
    _, status, used = os.wait4(process, 0)
    return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime if ended else inf


def read(stream: object) -> str:
    """What a stream has got, as text."""
    stream.seek(0)  # type: ignore[attr-defined]
    return stream.read(1 << 20).decode("utf-8", "replace")  # type: ignore[attr-defined, no-any-return]
