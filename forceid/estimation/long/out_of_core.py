"""Recordings too large to hold, reduced in one pass over blocks of the positions to four markers.

Mean motion and affine deformation of a frame follow from sums over its nodes that are linear in the
positions, sum m x [1, X]^T (the resultants S^T M x of the nodal masses, and the first moments), so they are
taken block by block, in time and in nodes, and kept on disk on the way. Four markers carry the same sums: the
estimator sees a small recording. What nodes do beside an affine motion is left out, and told. Source:
principal equations 2.5, 4b, item 2.
"""

from __future__ import annotations

import time as clock
from dataclasses import replace
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from forceid import __version__
from forceid.config import Settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.body.inertia import inertia_of
from forceid.estimation.body.tetrahedron import Sums, affine_maps, four_nodes, tetrahedron, whitening_basis
from forceid.estimation.long.windows import LONG, Progress, estimate_of_any_length, made, unwatched
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import judge
from forceid.estimation.verdict.innovations import NIS_BAND
from forceid.estimation.verdict.leakage import LOOKED
from forceid.files import stamp
from forceid.files.schema import TRUTH
from forceid.files.stored.atomic import atomic
from forceid.files.stored.blocks import Positions, is_large, opened
from forceid.files.stored.hdf5 import read_checked
from forceid.files.stored.heap import GIGABYTE, fingerprint
from forceid.flight.channels import FLIGHT_SAMPLES
from forceid.motion import noise_variance
from forceid.records import SENSED, Array, Estimate, Finding, Recording
from forceid.timing import in_order, recorded, stage

REDUCED = "first moments of"  # in the history of a recording that was reduced here
SUMS = "sums.npz"
KEEP = 20.0  # s of work between two checkpoints
ABSURD = 1e20  # kg m: a sum beyond holds something that is no position


def estimate_source(
    path: Path, settings: Settings, kept: Path | None = None, progress: Progress = unwatched
) -> tuple[Estimate, Recording]:
    """The estimate of a motion file of any size, and its recording as it was used: see read_recording.

    kept: a folder for what is done of one that takes long, removed in the end; one that was stopped goes on
    from there.
    """
    with recorded() as spent:
        recording, left_out = read_recording(path, settings, kept, progress)
    estimate = estimate_of_any_length(recording, settings, kept, progress)
    if left_out:
        estimate = replace(estimate, verdict=judge([*estimate.verdict.findings, *left_out]))
    return replace(estimate, timing=in_order(spent, estimate.timing)), recording


@stage("reading")
def read_recording(
    path: Path, settings: Settings, kept: Path | None = None, progress: Progress = unwatched
) -> tuple[Recording, tuple[Finding, ...]]:
    """The recording in a motion file, and what is left out of it, if that matters.

    One too large to hold comes as four markers; the pass over it goes on from what an earlier one left in
    the folder `kept`. DataError: see read_motion. ConfigError: settings that need every node.
    """
    before = stamp(path)
    gigabytes = before[1] // GIGABYTE
    with (progress if gigabytes else unwatched)(gigabytes, "GB checked") as advance:
        sha256 = fingerprint(path, advance)
    if not is_large(path, LONG):
        return read_checked(path, before, sha256, settings.gravity), ()
    if settings.model == "modal" or settings.part or settings.joint:
        what = "is too large to be held as single nodes, expected model auto, rigid or affine, and no parts"
        raise ConfigError(what, str(path), "leave out nodes or frames")
    return reduced(path, before, sha256, settings, made(kept), progress)


def reduced(
    path: Path,
    before: tuple[int, int, int],
    sha256: str,
    settings: Settings,
    kept: Path | None = None,
    progress: Progress = unwatched,
) -> tuple[Recording, tuple[Finding, ...]]:
    """A motion file of that stamp and fingerprint as four markers, and what its nodes do beside them."""
    with opened(path, settings.gravity) as (recording, positions):
        body, inertia = recording.body, inertia_of(recording.body)
        assert body.position is not None
        w = inertia.weight if inertia.weight.any() else np.ones(len(body.node))
        Z = np.hstack([np.ones((len(w), 1)), body.position - inertia.center])
        checkpoint = None if kept is None else kept / SUMS
        sums = summed(positions, w, Z, checkpoint, f"{before} {__version__}", progress)
        S = (w[:, None] * Z).T @ Z
        maps = affine_maps(sums, S)
        if not np.isfinite(maps).any():
            raise DataError("shows no frame whole enough for a mean motion", positions.where, "check it")
        noise, beside = compared(positions, recording.motion.time, maps, Z)
    if stamp(path) != before:
        raise DataError("changed while it was read", str(path), "wait until it is complete and try again")
    corners, Q = np.hstack([np.ones((4, 1)), tetrahedron(S)]), whitening_basis(S)
    stated = {k: v for k, v in recording.motion.noise_std.items() if k in SENSED and k != "strain"}
    if positions.noise_std is not None:
        spread = w[:, None] * (Z @ Q @ (Q.T @ corners.T))  # of every node in every corner
        stated["position"] = positions.noise_std * float(np.sqrt((spread**2).sum() / 4))
    motion = replace(
        recording.motion, position=np.einsum("tai,ka->tki", maps, corners), center=None, orientation=None,
        strain=None, noise_std=stated,
    )  # fmt: skip
    truth = {k: v for k, v in recording.truth.items() if "node" not in TRUTH[k].dims}
    line = f"forceid {__version__} {REDUCED} {positions.shape[1]} nodes, in blocks"
    history = "\n".join(filter(None, (recording.history, line)))
    four = four_nodes(body, inertia, corners[:, 1:])
    found = replace(recording, body=four, motion=motion, truth=truth, sha256=sha256, history=history)
    noise, left = positions.noise_std or noise, []
    if positions.posed:
        left.append(note("pose-not-compared"))
    if beside**2 > NIS_BAND[1] * noise**2:  # nodes do more than an affine body and noise
        left.append(note("modes-left-out", beside_mm=1e3 * beside, noise_mm=1e3 * noise))
    return found, tuple(left)


def summed(
    positions: Positions,
    w: Array,
    Z: Array,
    checkpoint: Path | None = None,
    key: str = "",
    progress: Progress = unwatched,
) -> Sums:
    """The sums over all blocks, from where a checkpoint of the same key ends."""
    blocks = positions.blocks()
    first, sums = restored_sums(checkpoint, key, positions.shape[0])
    wZ = w[:, None] * Z
    room = np.empty(3 * max((a.stop - a.start) * (b.stop - b.start) for a, b in blocks))
    kept = clock.monotonic()
    with progress(len(blocks) - first, "blocks") as advance:
        for k in range(first, len(blocks)):
            frames, nodes = blocks[k]
            x = positions.read(frames, nodes, room)
            add(sums, frames, x, wZ[nodes], Z[nodes], positions)
            if checkpoint is not None and clock.monotonic() - kept > KEEP:
                keep(checkpoint, key, k + 1, sums)
                kept = clock.monotonic()
            advance()
    if checkpoint is not None and first < len(blocks):
        keep(checkpoint, key, len(blocks), sums)
    return sums


def add(sums: Sums, frames: slice, x: Array, wZ: Array, Z: Array, positions: Positions) -> None:
    """Add a block x (time, node, 3) of nodes with wZ and Z (node, 4); frames count what they see."""
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is looked at below
        moved = np.matmul(wZ.T, x)
    rest = np.broadcast_to(wZ.T @ Z, (len(x), 4, 4)).copy()
    gaps = np.flatnonzero(~(np.abs(moved[:, 0]) < ABSURD).all(1))
    for k in gaps:
        x[k][x[k] == positions.unwritten] = np.nan
        if np.isinf(x[k]).any():
            what = "holds infinite values, expected finite ones or NaN"
            raise DataError(what, positions.where, "write NaN where nothing was measured")
        seen = np.isfinite(x[k]).all(1)
        moved[k], rest[k] = wZ[seen].T @ x[k][seen], wZ[seen].T @ Z[seen]
    sums.moved[frames] += moved
    sums.rest[frames] += rest


def compared(positions: Positions, time: Array, maps: Array, Z: Array) -> tuple[float, float]:
    """Noise of a marker (m) as differences of neighboring frames show it, and rms of what is beside (m)."""
    frames, nodes = slice(0, min(len(time), FLIGHT_SAMPLES)), positions.blocks()[0][1]
    x = positions.read(frames, nodes, np.empty(3 * (frames.stop - frames.start) * (nodes.stop - nodes.start)))
    pick = np.linspace(0, x.shape[1] - 1, min(x.shape[1], LOOKED)).astype(int)
    whole = pick[np.isfinite(x[:, pick]).all((0, 2))]
    noise = np.nan
    if len(x) > 8 and len(whole):
        noise = float(np.sqrt(noise_variance(time[frames], x[:, whole].reshape(len(x), -1))))
    at = np.linspace(0, len(x) - 1, min(len(x), LOOKED)).astype(int)
    return noise, float(np.sqrt(np.nanmean((x[at] - Z[nodes] @ maps[at]) ** 2)))


def keep(checkpoint: Path, key: str, done: int, sums: Sums) -> None:
    """Write down how far the pass has come."""
    with atomic(checkpoint) as partial, open(partial, "wb") as f:
        np.savez(f, key=np.array(key), done=done, moved=sums.moved, rest=sums.rest)


def restored_sums(checkpoint: Path | None, key: str, frames: int) -> tuple[int, Sums]:
    """Where to begin, and the sums until there."""
    fresh = 0, Sums(np.zeros((frames, 4, 3)), np.zeros((frames, 4, 4)))
    if checkpoint is None or not checkpoint.is_file():
        return fresh
    try:
        with np.load(checkpoint, allow_pickle=False) as f:
            if str(f["key"]) != key or f["moved"].shape != (frames, 4, 3):
                return fresh
            return int(f["done"]), Sums(f["moved"], f["rest"])
    except (OSError, ValueError, KeyError, BadZipFile):
        return fresh
