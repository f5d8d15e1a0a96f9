"""One batch at a time in a folder: two would do every file twice, and each count the other's results."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from forceid.errors import ConfigError

try:
    import fcntl
except ImportError:  # not on Windows: nothing is lost there, but files may be done twice
    fcntl = None  # type: ignore[assignment]

NAME = ".forceid.lock"


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """The folder, made if need be and held by this process; the system lets go of it when the process ends.

    ConfigError: it cannot be made or written to, or another batch is at work in it.
    """
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
    except OSError as e:
        what = "is not a folder" if isinstance(e, FileExistsError | NotADirectoryError) else e.strerror
        raise ConfigError(f"cannot hold results ({what})", str(folder), "give another folder with -o") from e
    try:
        hold(file, path, folder)
        try:
            yield
        finally:
            path.unlink(missing_ok=True)
    finally:
        os.close(file)


def hold(file: int, path: Path, folder: Path) -> None:
    """Take the lock and write down whose it is; ConfigError where somebody else has it."""
    try:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        same = path.exists() and os.fstat(file).st_ino == os.stat(path).st_ino
    except BlockingIOError:
        same = False
    except OSError:  # a file system without locks
        return
    if not same:  # held, or given up a moment ago
        holder = os.pread(file, 200, 0).decode("utf-8", "replace").strip() or "unknown"
        what = f"is in use by another batch ({holder})"
        raise ConfigError(what, str(folder), "wait until it has ended, or give another folder with -o")
    try:
        os.ftruncate(file, 0)
        os.pwrite(file, f"process {os.getpid()} on {socket.gethostname()}\n".encode(), 0)
    except OSError:  # a full disk still lets nothing be done twice
        pass
