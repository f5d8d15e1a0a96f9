"""Recordings of many frames, estimated a stretch at a time: time grows as they do, memory stays.

Each stretch is smoothed with a margin of its neighbors on either side, and then cut off; its priors are tuned
on it alone, so that a load which changes its character on the way is followed. Of a load so slow that a
smoother remembers more than the margin, neighbors differ within their claims.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from forceid import __version__
from forceid.config import Settings, load_settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.long.joined import cut, joined_windows
from forceid.estimation.run import estimate_recording
from forceid.files import read_result, write_result
from forceid.files.result import read_version
from forceid.flight.channels import CHANNEL_SAMPLES
from forceid.records import Estimate, Recording
from forceid.sections import to_toml

if TYPE_CHECKING:
    import xarray

LONG = CHANNEL_SAMPLES  # frames that are estimated at once: so many at most does tuning look at throughout
MARGIN = LONG // 8  # frames that are smoothed on either side of those of a stretch that are kept
Progress: TypeAlias = "Callable[[int, str], AbstractContextManager[Callable[[], None]]]"


@contextmanager
def unwatched(total: int, unit: str) -> Iterator[Callable[[], None]]:
    """Nobody looks on: what to call after every one of `total` units does nothing."""
    yield lambda: None


def estimate(tree: xarray.DataTree, config: Any = None, **settings: Any) -> xarray.DataTree:
    """Applied force and moment of a motion, with everything that stands behind them.

    tree: from `open_motion`, or built alike; config: a TOML file; settings: single keys that override it.
    Returns a DataTree with /estimate (and /load where loads are asked for), as in a result file. Raises
    DataError, ConfigError; an estimate that cannot be defended comes back as NaN with verdict "refused".
    """
    from forceid.files import recording_from_tree, tree_from_estimate

    merged = load_settings(config, **settings)
    recording = recording_from_tree(tree, merged.gravity)
    return tree_from_estimate(estimate_of_any_length(recording, merged), recording)


def estimate_of_any_length(
    recording: Recording, settings: Settings, kept: Path | None = None, progress: Progress = unwatched
) -> Estimate:
    """The estimate of a recording, in stretches where it is LONG. Raises as estimate_recording.

    kept: a folder for the results of stretches that are done, from which an estimate that was stopped goes
    on; they are of use for the same input, settings and version.
    """
    frames = len(recording.motion.time)
    if frames <= LONG or settings.part or settings.joint or settings.joint_loads:  # of no stretch's own
        return estimate_recording(recording, settings)
    kept = made(kept)
    edges = np.linspace(0, frames, -(-frames // (LONG - 2 * MARGIN)) + 1).astype(int).tolist()
    pieces = []
    with progress(len(edges) - 1, "stretches") as advance:
        for a, b in pairwise(edges):
            first, last = max(0, a - MARGIN), min(frames, b + MARGIN)
            path = None if kept is None else kept / f"{a}-{b}.h5"
            piece = None if path is None else restored_window(path, recording, settings)
            if piece is None:
                part = replace(recording, motion=cut(recording.motion, first, last, frames), truth={})
                piece = cut(estimate_recording(part, settings), a - first, b - first, last - first)
                if path is not None:
                    write_result(path, piece)
            pieces.append(piece)
            advance()
    return joined_windows(pieces)


def made(kept: Path | None) -> Path | None:
    """The folder for what is done, made where there is one to be."""
    try:
        if kept is not None:
            kept.mkdir(exist_ok=True)
    except OSError as e:
        what = f"cannot be made ({e.strerror})"
        raise ConfigError(what, str(kept), "give an existing folder with room and write permission") from e
    return kept


def restored_window(path: Path, recording: Recording, settings: Settings) -> Estimate | None:
    """What an earlier run found in a stretch of the same recording, with the same settings and version."""
    try:
        piece, by = read_result(path), read_version(path)
    except DataError:
        return None
    same = (piece.settings, piece.input_sha256, by) == (to_toml(settings), recording.sha256, __version__)
    return piece if same else None
