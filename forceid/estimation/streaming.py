"""Recordings too large to hold, reduced to their mean motion in one pass over blocks of the positions.

Center and rotation of a frame follow from sums over its nodes that are linear in the positions, sum w x and
sum w x X^T (the resultants S^T M x of the nodal masses, and the attitude profile of the weighted fit), so
they are taken block by block, in time and in nodes, and kept on disk on the way. What the smoother then sees
is the mean motion; the body is the rigid whole. Source: principal equations 2.5, 4b, item 2.
"""

from __future__ import annotations

import time as clock
from dataclasses import dataclass, replace
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from scipy.spatial.transform import Rotation

from forceid import __version__
from forceid.config import Settings
from forceid.errors import ConfigError, DataError
from forceid.estimation.inertia import Inertia, inertia_of
from forceid.estimation.run import estimate_recording
from forceid.estimation.stretches import Progress, estimate_stretches, unwatched
from forceid.files.atomic import atomic
from forceid.files.blocks import Positions, is_large, opened
from forceid.files.hdf5 import read_checked, stamp
from forceid.files.heap import fingerprint
from forceid.motion.window import noise_variance
from forceid.records import Array, Body, Estimate, Level, Recording, Verdict

REDUCED = "mean motion of"  # in the history of a recording that was reduced here
SUMS = "sums.npz"
LONG = 50_000  # frames: an estimate of all at once takes 45 kB a frame
KEEP = 20.0  # s of work between two checkpoints
FEW = 256  # frames at the start that the noise is told from
LOOKED = 64  # frames among them of which every node is compared with the rigid body
SEEN = 1e-6  # second singular value of the attitude profile over the first, below which no turn is seen
ABSURD = 1e20  # kg m: a sum beyond holds something that is no position
BESIDE = 1.5  # times the noise, above which a body is said to deform


@dataclass(frozen=True)
class Sums:
    """Over the nodes a frame sees: moved (time, 4, 3) = sum w [1, X] x, rest (time, 4) = sum w [1, X]."""

    moved: Array
    rest: Array


def estimate_source(
    path: Path, settings: Settings, kept: Path | None = None, progress: Progress = unwatched
) -> tuple[Estimate, Recording]:
    """The estimate of a motion file of any size, and its recording as it was used: see read_recording.

    kept: a folder for what is done of one that takes long, removed in the end; one that was stopped goes on
    from there.
    """
    recording, left_out = read_recording(path, settings, kept, progress)
    whole = len(recording.motion.time) <= LONG or bool(settings.part or settings.joint)
    if whole and REDUCED not in recording.history:
        return estimate_recording(recording, settings), recording
    estimate = estimate_stretches(recording, settings, made(kept), progress)
    return with_left_out(estimate, left_out), recording


def read_recording(
    path: Path, settings: Settings, kept: Path | None = None, progress: Progress = unwatched
) -> tuple[Recording, str | None]:
    """The recording in a motion file, and what is left out of it, if that matters.

    One too large to hold comes as its mean motion, of a rigid body; the pass over it goes on from what an
    earlier one left in the folder `kept`. DataError: see read_motion. ConfigError: settings that need every
    node.
    """
    before, sha256 = stamp(path), fingerprint(path)
    if not is_large(path):
        return read_checked(path, before, sha256, settings.gravity), None
    if settings.model in ("affine", "modal") or settings.part or settings.joint:
        what = "is too large to be held, and only its mean motion is estimated, expected model auto or rigid"
        raise ConfigError(what, str(path), "leave out nodes or frames for a model that deforms")
    return reduced(path, before, sha256, settings, made(kept), progress)


def made(kept: Path | None) -> Path | None:
    """The folder for what is done, made where there is one to be."""
    try:
        if kept is not None:
            kept.mkdir(exist_ok=True)
    except OSError as e:
        what = f"cannot be made ({e.strerror})"
        raise ConfigError(what, str(kept), "give an existing folder with room and write permission") from e
    return kept


def reduced(
    path: Path,
    before: tuple[int, int, int],
    sha256: str,
    settings: Settings,
    kept: Path | None = None,
    progress: Progress = unwatched,
) -> tuple[Recording, str | None]:
    """The mean motion in a motion file as a recording of a rigid body, and what the nodes do beside it.

    The file is that of the stamp `before`, and of the fingerprint.
    """
    with opened(path, settings.gravity) as (recording, positions):
        inertia = inertia_of(recording.body)
        assert recording.body.position is not None
        X = recording.body.position - inertia.center
        w = inertia.weight if inertia.weight.any() else np.ones(len(X))
        checkpoint = None if kept is None else kept / SUMS
        sums = summed(positions, w, X, checkpoint, f"{before} {__version__}", progress)
        center, R = mean_motion(sums)
        if not np.isfinite(center).any():
            raise DataError("shows no frame whole enough for a mean motion", positions.where, "check it")
        noise, beside = compared(positions, recording.motion.time, center, R, X)
    if stamp(path) != before:
        raise DataError("changed while it was read", str(path), "wait until it is complete and try again")
    stated = {} if positions.noise_std is None else fit_noise(positions.noise_std, w, X)
    orientation = np.full((len(R), 4), np.nan)
    whole = np.isfinite(R).all((1, 2))
    orientation[whole] = Rotation.from_matrix(R[whole]).as_quat(canonical=True)
    motion = replace(recording.motion, center=center, orientation=orientation, noise_std=stated)
    line = f"forceid {__version__} {REDUCED} {positions.shape[1]} nodes, in blocks"
    history = "\n".join(filter(None, (recording.history, line)))
    found = replace(recording, body=whole_body(inertia), motion=motion, sha256=sha256, history=history)
    return found, said(positions.noise_std or noise, beside)


def summed(
    positions: Positions,
    w: Array,
    X: Array,
    checkpoint: Path | None = None,
    key: str = "",
    progress: Progress = unwatched,
) -> Sums:
    """The sums over all blocks, from where a checkpoint of the same key ends."""
    blocks = positions.blocks()
    first, sums = restored(checkpoint, key, positions.shape[0])
    weight = w[:, None] * np.concatenate([np.ones((len(X), 1)), X], axis=1)  # (node, 4)
    room = np.empty(3 * max((a.stop - a.start) * (b.stop - b.start) for a, b in blocks))
    kept = clock.monotonic()
    with progress(len(blocks) - first, "blocks") as advance:
        for k in range(first, len(blocks)):
            frames, nodes = blocks[k]
            add(sums, frames, positions.read(frames, nodes, room), weight[nodes], positions)
            if checkpoint is not None and clock.monotonic() - kept > KEEP:
                keep(checkpoint, key, k + 1, sums)
                kept = clock.monotonic()
            advance()
    if checkpoint is not None and first < len(blocks):
        keep(checkpoint, key, len(blocks), sums)
    return sums


def add(sums: Sums, frames: slice, x: Array, weight: Array, positions: Positions) -> None:
    """Add a block x (time, node, 3) of nodes with weight (node, 4); frames with gaps count what they see."""
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is looked at below
        moved = np.matmul(weight.T, x)
    rest = np.broadcast_to(weight.sum(0), (len(x), 4)).copy()
    gaps = np.flatnonzero(~(np.abs(moved[:, 0]) < ABSURD).all(1))
    for k in gaps:
        x[k][x[k] == positions.unwritten] = np.nan
        if np.isinf(x[k]).any():
            what = "holds infinite values, expected finite ones or NaN"
            raise DataError(what, positions.where, "write NaN where nothing was measured")
        seen = np.isfinite(x[k]).all(1)
        moved[k], rest[k] = weight[seen].T @ x[k][seen], weight[seen].sum(0)
    sums.moved[frames] += moved
    sums.rest[frames] += rest


def mean_motion(sums: Sums) -> tuple[Array, Array]:
    """Center (time, 3) m and rotation (time, 3, 3) of every frame, NaN where it does not fix them."""
    total = np.where(sums.rest[:, 0] > 0, sums.rest[:, 0], np.nan)[:, None]
    x, X = sums.moved[:, 0] / total, sums.rest[:, 1:] / total
    G = sums.moved[:, 1:].swapaxes(1, 2) - total[..., None] * x[:, :, None] * X[:, None]
    R = np.full_like(G, np.nan)
    whole = np.flatnonzero(np.isfinite(G).all((1, 2)))
    U, s, Vt = np.linalg.svd(G[whole])
    U[..., 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    fixed = s[:, 1] > SEEN * s[:, 0]
    R[whole[fixed]] = (U @ Vt)[fixed]
    return x - np.einsum("tab,tb->ta", R, X), R


def compared(positions: Positions, time: Array, center: Array, R: Array, X: Array) -> tuple[float, float]:
    """Noise of a marker (m) as differences of neighboring frames show it, and rms of what is beside (m)."""
    frames, nodes = slice(0, min(len(time), FEW)), positions.blocks()[0][1]
    x = positions.read(frames, nodes, np.empty(3 * (frames.stop - frames.start) * (nodes.stop - nodes.start)))
    pick = np.linspace(0, x.shape[1] - 1, min(x.shape[1], LOOKED)).astype(int)
    whole = pick[np.isfinite(x[:, pick]).all((0, 2))]
    noise = np.nan
    if len(x) > 8 and len(whole):
        noise = float(np.sqrt(noise_variance(time[frames], x[:, whole].reshape(len(x), -1))))
    at = np.linspace(0, len(x) - 1, min(len(x), LOOKED)).astype(int)
    turned = center[at, None] + np.einsum("tab,nb->tna", R[at], X[nodes])
    return noise, float(np.sqrt(np.nanmean((x[at] - turned) ** 2)))


def fit_noise(noise: float, w: Array, X: Array) -> dict[str, float]:
    """Deviation of center (m) and orientation (rad, mean over axes) that white noise of the nodes leaves."""
    arm = (X**2).sum(1)[:, None, None] * np.eye(3) - X[:, :, None] * X[:, None]
    J, spread = np.einsum("n,nab->ab", w, arm), np.einsum("n,nab->ab", w**2, arm)
    turn = np.linalg.solve(J, np.linalg.solve(J, spread).T)
    return {
        "center": noise * float(np.sqrt((w**2).sum()) / w.sum()),
        "orientation": noise * float(np.sqrt(np.trace(turn) / 3)),
    }


def whole_body(inertia: Inertia) -> Body:
    """The body as a rigid whole."""
    return Body(total_mass=inertia.mass, mass_center=inertia.center, inertia=inertia.tensor)


def said(noise: float, beside: float) -> str | None:
    """What the verdict says of nodes that do more than a rigid body and noise; nothing where they do not."""
    if not beside > BESIDE * noise:
        return None
    return (
        f"the nodes are {1e3 * beside:.2g} mm rms beside a rigid body, their noise is {1e3 * noise:.2g} mm: "
        "the momentum of the deformation is left out of so large a file; check with fewer frames"
    )


def with_left_out(estimate: Estimate, left_out: str | None) -> Estimate:
    """The estimate with what the reduction leaves out among its reasons, which degrades it."""
    if left_out is None:
        return estimate
    level: Level = "degraded" if estimate.verdict.level == "ok" else estimate.verdict.level
    return replace(estimate, verdict=Verdict(level, (*estimate.verdict.reasons, left_out)))


def keep(checkpoint: Path, key: str, done: int, sums: Sums) -> None:
    """Write down how far the pass has come."""
    with atomic(checkpoint) as partial, open(partial, "wb") as f:
        np.savez(f, key=np.array(key), done=done, moved=sums.moved, rest=sums.rest)


def restored(checkpoint: Path | None, key: str, frames: int) -> tuple[int, Sums]:
    """Where to begin, and the sums until there."""
    fresh = 0, Sums(np.zeros((frames, 4, 3)), np.zeros((frames, 4)))
    if checkpoint is None or not checkpoint.is_file():
        return fresh
    try:
        with np.load(checkpoint, allow_pickle=False) as f:
            if str(f["key"]) != key or f["moved"].shape != (frames, 4, 3):
                return fresh
            return int(f["done"]), Sums(f["moved"], f["rest"])
    except (OSError, ValueError, KeyError, BadZipFile):
        return fresh
