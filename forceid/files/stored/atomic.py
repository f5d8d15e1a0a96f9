"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from forceid.errors import ConfigError


@contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """A hidden path beside `path` to write to; it replaces `path` on success and is removed on any error.

    On the disk before it has its name, so that a power cut leaves the old file or the new one; where `path`
    is a link, the link is replaced. ConfigError: the folder is missing, full or not writable, or `path` is
    a folder, a device or the like.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with atomic(Path(folder, "a.txt")) as partial:
    ...         _ = partial.write_text("whole")
    ...     Path(folder, "a.txt").read_text()
    'whole'
    """
    path = Path(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.partial")
    if os.path.lexists(path) and not (path.is_symlink() or path.is_file()):
        raise ConfigError("is no file that could be replaced", str(path), "give another name")
    try:
        yield partial
        with open(partial, "rb") as f:
            os.fsync(f.fileno())
        os.replace(partial, path)
    except OSError as e:
        raise ConfigError(
            f"cannot be written ({e.strerror or e})",
            str(path),
            "give a file in an existing folder with room and write permission",
        ) from e
    finally:
        with suppress(OSError):  # a name too long was never there
            partial.unlink(missing_ok=True)


def write_whole(path: str | Path, text: str) -> None:
    """A text file, UTF-8, which appears whole or not at all. ConfigError: see atomic."""
    with atomic(path) as partial:
        partial.write_text(text, encoding="utf-8")


def sweep(folder: Path, names: Collection[str]) -> None:
    """Remove what processes that were killed have left of the files of those names in the folder.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, ".a.h5.4194305.0a1b2c3d.partial").write_text("half")
    ...     sweep(Path(folder), {"a.h5"})
    ...     list(Path(folder).iterdir())
    []
    """
    for path in folder.glob(".*.partial"):
        name, process, *_ = [*path.name.removeprefix(".").rsplit(".", 3), ""]
        if name in names and process.isdecimal() and not is_alive(int(process)):
            path.unlink(missing_ok=True)


def is_alive(process: int) -> bool:
    """Whether a process of that number is alive on this machine.

    One that was killed keeps its number until its parent has asked how it ended; Linux tells it by a Z.
    """
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    with suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    return True
