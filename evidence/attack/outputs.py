"""Odd outputs: whatever stands where a command would write is whole afterwards, or was ours to replace."""

from __future__ import annotations

import os
import shutil
import socket
from collections.abc import Callable, Iterator
from contextlib import chdir
from pathlib import Path

from evidence.attack.bodies import write
from evidence.attack.surroundings import COMMANDS, QUICK, furnish
from evidence.attack.watched import End, forked

Place = Callable[[Path], None]


def bound_socket(path: Path) -> None:
    """A socket by that name."""
    with socket.socket(socket.AF_UNIX) as s, chdir(path.parent):  # the name of a socket is short
        s.bind(path.name)


def cut_short(path: Path) -> None:
    """A result that breaks off."""
    path.write_bytes((path.parent / "old.result.h5").read_bytes()[:4000])


def a_folder(path: Path) -> None:
    """A folder with something in it."""
    path.mkdir()
    (path / "kept.txt").write_text("kept")


PLACES: dict[str, Place] = {
    "a text": lambda path: path.write_text("hours of work") and None,
    "an empty file": Path.touch,
    "a motion file by hand": lambda path: write(path, seed=9) and None,
    "an input": lambda path: os.link(path.parent / "m.h5", path),
    "a link to an input": lambda path: path.symlink_to("m.h5"),
    "a dangling link": lambda path: path.symlink_to("nowhere"),
    "a link to a text": lambda path: path.symlink_to("kept.txt"),
    "a folder": a_folder,
    "a fifo": os.mkfifo,
    "a socket": bound_socket,
    "a device": lambda path: path.symlink_to("/dev/null"),
    "a half result": lambda path: cut_short(path),
}
OUTPUTS = {
    "estimate": "r.h5",
    "json": "r.h5",
    "report": "page.html",
    "simulate": "s.h5",
    "import": "i.h5",
    "identify": "r.toml",
    "batch": "out/m.result.h5",
    "resume": "out/m.result.h5",
}


def looks(path: Path) -> tuple[object, ...]:
    """What a path is and holds."""
    if not os.path.lexists(path):
        return ("nothing",)
    status = os.lstat(path)
    link = os.readlink(path) if path.is_symlink() else ""
    held = path.read_bytes() if path.is_file() else b""
    inside = sorted(p.name for p in path.iterdir()) if path.is_dir() else []
    return status.st_mode, link, held, inside


def odd_outputs(folder: Path) -> Iterator[tuple[str, str, End, list[str]]]:
    """Name of what is there and of the command, end and faults, for each of all pairs."""
    furnish(folder)
    (folder / "kept.txt").write_text("kept")
    forked(["estimate", "m.h5", "-o", "old.result.h5", *QUICK], folder)
    for place, make in PLACES.items():
        for command, output in OUTPUTS.items():
            words = list(COMMANDS["batch" if command == "resume" else command])
            if command == "resume":
                words[words.index("--force")] = "--resume"
            if command == "batch":
                words.remove("--force")
            if command in ("estimate", "json", "identify"):
                words += ["-o", output]
            shutil.rmtree(folder / "out", ignore_errors=True)
            (folder / "out").mkdir()
            path = folder / output
            make(path if path.parent == folder else folder / "x")
            if path.parent != folder:
                os.rename(folder / "x", path)
                if path.is_symlink():  # which led elsewhere from there
                    path.unlink()
                    path.symlink_to(Path("..", "m.h5" if "input" in place else "kept.txt"))
            watched = [path, folder / "m.h5", folder / "kept.txt", folder / "n.h5"]
            before = [looks(p) for p in watched]
            end = forked(words, folder)
            faults = end.faults(output if command != "resume" else "")
            faults += ["overwritten"] * ([looks(p) for p in watched] != before)
            yield place, command, end, faults
            for left in (path, folder / "r.toml"):
                if left.is_dir() and not left.is_symlink():
                    shutil.rmtree(left)
                elif os.path.lexists(left):
                    left.unlink()
