"""Motion files too large to hold: what is in them beside the positions, and these block by block."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from forceid.errors import DataError
from forceid.files.parse import READ, parse_recording
from forceid.files.schema import MOTION
from forceid.files.stored.hdf5 import guarded, motion_file_groups, open_hdf5
from forceid.files.stored.links import holds
from forceid.files.units import si_factor
from forceid.files.values import NC_FILL, Stored, read_real, real_attr, text, unpack
from forceid.records import Array, Recording

LARGE = 1 << 30  # bytes of positions: an estimate that holds them takes some ten times as much
STRETCH_BYTES = 150_000_000  # of positions of a stretch: to look at each takes 2 GB and a quarter of a minute
BLOCK = 1 << 23  # bytes of positions that are looked at together: they stay in the cache


@dataclass(frozen=True)
class Positions:
    """The positions of an open file: (time, node, axis), not read yet. noise_std in m, if stated; posed: a
    measured pose stands beside them.
    """

    item: Any
    where: str
    factor: float
    attrs: dict[str, Any]
    noise_std: float | None
    posed: bool = False

    @property
    def shape(self) -> tuple[int, int]:
        """Frames and nodes."""
        return int(self.item.shape[0]), int(self.item.shape[1])

    @property
    def unwritten(self) -> float:
        """What netCDF leaves where nothing was written, as it is read here."""
        return NC_FILL * self.factor

    def blocks(self) -> list[tuple[slice, slice]]:
        """Frames and nodes of each block, whole chunks of the file where it has any."""
        frames, nodes = self.shape
        high, wide = self.item.chunks[:2] if self.item.chunks else (1, nodes)
        wide = min(nodes, wide * max(1, BLOCK // (24 * high * wide)))
        high = min(frames, high * max(1, BLOCK // (24 * high * wide)))
        return [
            (slice(a, min(a + high, frames)), slice(b, min(b + wide, nodes)))
            for a in range(0, frames, high)
            for b in range(0, nodes, wide)
        ]

    def read(self, frames: slice, nodes: slice, out: Array) -> Array:
        """One block (time, node, axis) m, NaN where not seen, or `unwritten`, in the room of `out`."""
        size = frames.stop - frames.start, nodes.stop - nodes.start, 3
        block = out[: math.prod(size)].reshape(size)
        try:
            self.item.read_direct(block, np.s_[frames, nodes, :])
        except (OSError, RuntimeError) as e:
            raise DataError(f"cannot be read ({e})", self.where, "restore the file: it is damaged") from e
        if self.attrs:
            block = unpack(block, self.attrs, self.where)
        if self.factor != 1.0:
            block *= self.factor
        return block


def is_large(path: str | Path, stretch: int) -> bool:
    """Whether the positions of a motion file, known to be whole, are too many for an estimate to hold.

    stretch: frames, at most, that it looks at together.
    """
    with open_hdf5(path, checked=True) as f:
        group = guarded(f, "motion", f"{path}:") if holds(f, "motion", f"{path}:") else None
        known = isinstance(group, h5py.Group) and holds(group, "position", f"{path}:/motion")
        item = guarded(group, "position", f"{path}:/motion") if known else None
        shape = getattr(item, "shape", None)
    if shape is None or len(shape) != 3:
        return False
    together = min(stretch, shape[0]), *shape[1:]
    return bool(8 * math.prod(shape) > LARGE or 8 * math.prod(together) > STRETCH_BYTES)


@contextmanager
def opened(path: str | Path, gravity: Sequence[float] | None = None) -> Iterator[tuple[Recording, Positions]]:
    """A motion file with its positions left in it, and these. DataError: see read_motion.

    The recording stands still at the origin: its center and orientation hold the place of what the positions
    tell.
    """
    with open_hdf5(path, checked=True) as f:
        found = motion_file_groups(f, path)
        motion = found["motion"]
        positions = positions_of(motion.variables["position"], found, f"{path}:/motion/position")
        positions = replace(positions, posed=any(k in motion.variables for k in ("center", "orientation")))
        frames = positions.shape[0]
        still = np.zeros((frames, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (frames, 1))
        left = {k: v for k, v in motion.variables.items() if k not in ("position", "node")}
        kept = Stored({**left, "center": still[0], "orientation": still[1]}, motion.attrs, motion.found)
        recording = parse_recording({**found, "motion": kept}, f.attrs, str(path), "", gravity)
        yield recording, positions


def positions_of(item: Any, found: dict[str, Stored], where: str) -> Positions:
    """The positions, their shape, type, units and noise judged by what is declared of them."""
    spec = MOTION["position"]
    attrs = {key: item.attrs[key] for key in item.attrs if key in READ}
    shape = getattr(found.get("body", found["motion"]).variables.get("position"), "shape", (None,))
    if item.dtype.kind not in "fiu" or item.ndim != 3 or item.shape[2] != 3 or item.shape[1] != shape[0]:
        read_real(item, spec, {"axis": 3, "node": int(shape[0] or 0)}, where)  # says what is wrong
    factor = si_factor(text(attrs.pop("units", spec.units)), spec.units, where)
    noise = None
    if "noise_std" in attrs:
        noise = factor * real_attr(attrs.pop("noise_std"), where, "noise_std")
        if not (np.isfinite(noise) and noise > 0):
            what = f"has noise_std {noise:g}, expected a positive number"
            raise DataError(what, where, "correct the attribute, or leave it out and it is estimated")
    return Positions(item, where, factor, attrs, noise)
