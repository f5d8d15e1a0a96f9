"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from forceid.errors import ConfigError


@contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """A hidden path beside `path` to write to; it replaces `path` on success and is removed on any error.

    ConfigError: the folder is missing, full or not writable.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with atomic(Path(folder, "a.txt")) as partial:
    ...         _ = partial.write_text("whole")
    ...     Path(folder, "a.txt").read_text()
    'whole'
    """
    path = Path(path)
    partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial")
    try:
        yield partial
        os.replace(partial, path)
    except OSError as e:
        raise ConfigError(
            f"cannot be written ({e.strerror or e})",
            str(path),
            "give a file in an existing folder with room and write permission",
        ) from e
    finally:
        partial.unlink(missing_ok=True)
