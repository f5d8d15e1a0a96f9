"""What an output may take the place of: nothing, what this program made, and with --force any other file."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from pathlib import Path

from forceid.errors import ConfigError, DataError
from forceid.files.stored.hdf5 import open_hdf5
from forceid.files.stored.links import holds

HEAD = 600  # bytes of a text within which it says who made it
MARKS = {"page": b'name="generator" content="forceid', "settings": b"# made by forceid"}
EXPORT = "export"
KINDS = {
    "result": "a result of forceid",
    "motion": "a motion file that forceid made",
    "live": "a result of forceid live",
    "page": "a page of forceid",
    "settings": "settings that forceid made",
    "model": "coefficients that forceid made",
}


def check_output(path: Path, kind: str, inputs: Iterable[str | Path] = (), force: bool = False) -> None:
    """A ConfigError where writing a file of that kind would lose something; nothing is touched.

    kind: one of KINDS, which it may replace, or EXPORT. Never an input of the same command, a folder, a
    device or the like; another file, or a link, only by `force`: a link is replaced, what it names is not.
    """
    if not os.path.lexists(path):
        return
    if any(same(path, Path(source)) for source in inputs):
        raise ConfigError("is both input and output", str(path), "name another output with -o")
    mode = os.lstat(path).st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode)):
        what = "folder" if stat.S_ISDIR(mode) else "device, a pipe or a socket"
        raise ConfigError(
            f"is a {what}, expected a file, or nothing", str(path), "name another output with -o"
        )
    if force:
        return
    if kind == EXPORT:  # of another program, which says nothing of who made it
        raise ConfigError(
            "exists already", str(path), "name another output with -o, or replace it with --force"
        )
    found = "a link" if stat.S_ISLNK(mode) else "another file"
    if found == "a link" or kind_of_file(path) != kind:
        what = f"exists already and is {found}, expected {KINDS[kind]}, or nothing"
        raise ConfigError(what, str(path), "name another output with -o, or replace it with --force")


def same(path: Path, other: Path) -> bool:
    """Whether both are one file, by whatever name."""
    try:
        return os.path.samefile(path, other)
    except OSError:
        return False


def kind_of_file(path: Path) -> str:
    """Which of KINDS a regular file is, by what it holds; nothing where it is none."""
    try:
        with open(path, "rb") as f:
            head = f.read(HEAD)
        for kind, mark in MARKS.items():
            if mark in head:
                return kind
        if not head.startswith(b"\x89HDF"):
            return ""
        with open_hdf5(path) as h:
            there = {
                name: holds(h, name, f"{path}:")
                for name in ("estimate", "motion", "live", "body", "coefficients")
            }
            if there["estimate"] and not there["motion"] and "forceid_version" in h.attrs:
                return "result"
            if there["motion"] and b"forceid=" in bytes(h.attrs.get("_NCProperties", b"")):
                return "motion"
            if there["coefficients"] and "forceid_version" in h.attrs:
                return "model"
            return "live" if there["live"] and not there["body"] and not there["motion"] else ""
    except (DataError, OSError, TypeError, ValueError):
        return ""
