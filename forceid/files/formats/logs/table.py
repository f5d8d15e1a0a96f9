"""The formats of logs, each recognized by how its files begin: a line here for a new one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from forceid.files.formats.captures.capture import head_of
from forceid.files.formats.channels import Channels
from forceid.files.formats.logs.blackbox import is_blackbox, read_blackbox
from forceid.files.formats.logs.ulog import is_ulog, read_ulog


@dataclass(frozen=True)
class Log:
    """A format of logs: its name, whether a file that begins so is one, and its reader."""

    name: str
    begins: Callable[[str], bool]
    read: Callable[[Path], Channels]


LOGS = (Log("ULog", is_ulog, read_ulog), Log("Blackbox CSV", is_blackbox, read_blackbox))


def log_of(path: Path) -> Log | None:
    """The format of a log, by how the file begins; None for any other file."""
    head = head_of(path)
    return next((one for one in LOGS if one.begins(head)), None)
