"""A result file that grows while others read it: HDF5 with a single writer and many readers (SWMR)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any

import h5py
import numpy as np

from forceid.errors import ConfigError
from forceid.files.schema import variables
from forceid.records import LiveWrench

EVERY = 0.2  # s, at least, from one write to the next: five a second are as many as a reader follows
AT_ONCE = 1024  # frames that are held back at most: a chunk of the file
NOTES_AT_ONCE = 16  # notes in a chunk
REASON = 160  # bytes of the reasons of a frame: those of three things that go wrong at once
NOTE = 480  # bytes of a note: six lines of a terminal
LIVE = variables("live")
VECTORS = ("force", "moment", "force_std", "moment_std")
TYPES = {"degraded": np.uint8, "reasons": f"S{REASON}", "note": f"S{NOTE}", "note_at": np.int64}


@dataclass
class GrowingFile:
    """An open file with what waits to be written to it: wrenches, and notes with the time they came at.

    place: gives the file its name, once it holds a wrench.
    """

    group: Any
    place: Callable[[], None]
    waiting: list[LiveWrench] = field(default_factory=list)
    written: float = 0.0

    def add(self, wrench: LiveWrench) -> None:
        """Write a wrench, or hold it back for a while with those before it."""
        self.waiting.append(wrench)
        if len(self.waiting) >= AT_ONCE or monotonic() - self.written >= EVERY:
            self.write()

    def note(self, text: str) -> None:
        """Write a line of text beside, with the number of wrenches so far."""
        for name, value in (("note", text.encode()[:NOTE]), ("note_at", self.frames + len(self.waiting))):
            data = self.group[name]
            data.resize((len(data) + 1,))
            data[-1] = value
            data.flush()

    @property
    def frames(self) -> int:
        """Wrenches that are written."""
        return len(self.group["time"])

    def write(self) -> None:
        """Write what waits; time last, so that whoever reads up to its length finds all the rest."""
        new, self.waiting, self.written = self.waiting, [], monotonic()
        if not new:
            return
        first, end = self.frames, self.frames + len(new)
        columns = {name: [getattr(w, name) for w in new] for name in VECTORS}
        columns |= {
            "degraded": [bool(w.reasons) for w in new],
            "reasons": [", ".join(w.reasons).encode()[:REASON] for w in new],
            "time": [w.time for w in new],
        }
        for name, values in columns.items():
            data = self.group[name]
            data.resize((end, *data.shape[1:]))
            data[first:end] = values
            data.flush()
        if not first:
            self.place()


@contextmanager
def growing_file(path: Path, about: Mapping[str, str | float]) -> Iterator[GrowingFile]:
    """A file with the group /live, open for wrenches to come and for readers at the same time.

    about: attributes of the group. It has its name from the first wrench on: what stands by that name is kept
    till then, and nothing is left where none comes. ConfigError: it cannot be written.
    """
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        file = h5py.File(beside, "w", libver="latest")
    except OSError as e:
        raise ConfigError(
            f"cannot be written ({' '.join(str(e).split())[:120]})", str(path), "give another place"
        ) from e
    with file:
        file.attrs["Conventions"] = "CF-1.11"
        group = file.create_group("live")
        for name, value in about.items():
            group.attrs[name] = value
        axis = group.create_dataset("axis", data=np.array([b"x", b"y", b"z"]))
        axis.make_scale("axis")
        for name, spec in LIVE.items():
            framed = spec.dims[0] == "time"
            wide, rows = (3,) * (len(spec.dims) - 1), AT_ONCE if framed else NOTES_AT_ONCE
            data = group.create_dataset(
                name, (0, *wide), TYPES.get(name, float), maxshape=(None, *wide), chunks=(rows, *wide),
                compression="gzip" if name == "reasons" else None,
            )  # fmt: skip
            data.attrs.update({key: said for key in ("units", "long_name") if (said := getattr(spec, key))})
            if name == "time":
                data.make_scale("time")
            elif framed:
                for k, dim in enumerate(spec.dims):
                    data.dims[k].attach_scale(group[dim])
        file.swmr_mode = True  # from here on nothing new is made, all may be read
        growing = GrowingFile(group, lambda: os.replace(beside, path))
        try:
            yield growing
        finally:
            growing.write()
            beside.unlink(missing_ok=True)
