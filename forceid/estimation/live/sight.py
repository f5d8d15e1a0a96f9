"""What one frame shows: mass center, rotation and amplitudes, from the markers that are seen in it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from forceid.compiled import engine as compiled
from forceid.estimation.live.model import LiveModel
from forceid.flight.attitude import turned
from forceid.motion import FrameFit, beyond_pose, fit_one, frame_fit
from forceid.principal import summation_operator
from forceid.records import Array, Flags

NO_SHARE = np.zeros(0)  # of the mass that nodes carry, where not all of it is seen
ONE = np.ones(1)  # the amplitude of the mean shape
PATTERNS = 256  # sets of markers that are remembered: what a frame with another one costs is paid again
STEPS_AHEAD = 512  # of the clock, at most, that an amplitude swings on unseen: by then it has been forgotten


class Swing(NamedTuple):
    """States of all amplitudes after a frame, with the inertia J (3, 3) and momentum h (3,) they make."""

    x: Array
    J: Array
    h: Array


@dataclass(frozen=True, eq=False)
class Sight:
    """What the frames that see one set of markers take: prepared once.

    fit: of the pose; share (node,): of the mean that is the mass center, None where not all mass is seen;
    cov (6, 6): of the pose with the amplitudes taken out, body axes; of the states of the amplitudes, onward
    (state, state): what becomes of those before a frame one step of the clock later, gain (state, channel):
    what its residual adds; leak (6, state): what they take off the pose.
    """

    fit: FrameFit
    share: Array | None
    cov: Array
    onward: Array
    gain: Array
    leak: Array


class Seen(NamedTuple):
    """What a frame shows: center (3,), rotation (3, 3), body to world, and how such frames are read."""

    center: Array
    rotation: Array
    sight: Sight


@lru_cache(PATTERNS)
def sight(model: LiveModel, pattern: bytes) -> Sight | None:
    """How frames that see a pattern of markers (node,) of bytes are read; None where they fix no pose."""
    flags: Flags = np.frombuffer(pattern, bool)
    fit = frame_fit(model.shape, model.weight, flags, model.noise)
    if fit is None:
        return None
    share = model.share
    if share is not None and not flags[share != 0].all():
        share = None
    cov, swings = fit.cov * model.slow, model.swings
    back = onward = gain = np.zeros((0, 0))
    if swings is not None:
        channels, m = np.repeat(flags, 3), len(swings.shapes)
        flat = swings.shapes.reshape(m, -1).T[channels]
        leak, rows, read = beyond_pose(fit.gain, flat, summation_operator(model.shape)[channels])
        PH = swings.P[:, :: swings.each] @ rows.T
        K_q = np.linalg.solve(rows @ PH[:: swings.each] + np.eye(len(rows)), PH.T).T
        back, wide = np.zeros((6, len(swings.F))), np.zeros((len(rows), len(swings.F)))
        back[:, :: swings.each], wide[:, :: swings.each] = -leak, rows
        onward, gain = swings.F - K_q @ (wide @ swings.F), K_q @ read.T
        spread = leak * np.sqrt(swings.lasting)
        cov = cov + spread @ spread.T
    if share is not None:
        cov[:3], cov[:, :3] = 0.0, 0.0
        cov[:3, :3] = model.slow * model.noise_var * (share**2).sum() * np.eye(3)
    return Sight(fit, share, cov, onward, gain, back)


def look(model: LiveModel, position: Array, swing: Swing, ticks: int) -> tuple[Seen | None, Swing, int]:
    """What a frame (node, 3) shows, the amplitudes after it, and how many markers it lacks.

    ticks: steps of the clock since the frame before.
    """
    finite, flags, lacking = np.isfinite(position), model.seen, 0
    if not finite.all():
        flags = finite.all(1) & model.seen
        lacking = int(model.seen.sum() - flags.sum())
    s, swings, x = sight(model, flags.tobytes()), model.swings, swing.x
    if swings is not None and (s is None or ticks > 1):
        for _ in range(min(ticks if s is None else ticks - 1, STEPS_AHEAD)):
            x = swings.F @ x
    if s is None:
        return None, moved(model, x), lacking
    if SEE is not None:
        (A, C, _), share = s.fit.gain, NO_SHARE if s.share is None else s.share
        center, R, x_seen, J, h, arrived = SEE(
            position, s.fit.nodes, s.fit.shape, s.fit.start[s.fit.nodes], A, C, share, x, s.onward, s.gain,
            s.leak, model.products.inertia, model.products.momentum, model.inside,
            0 if swings is None else swings.each,
        )  # fmt: skip
        if arrived:
            return Seen(center, R, s), swing if swings is None else Swing(x_seen, J, h), lacking
    return *look_in_numpy(model, s, position, x), lacking


def look_in_numpy(model: LiveModel, s: Sight, position: Array, x: Array) -> tuple[Seen, Swing]:
    """What a frame shows that a sight is for, and the amplitudes after it, of states x before it."""
    center, R, residual = fit_one(s.fit, position)
    if s.share is not None:
        carries = s.share != 0
        center = s.share[carries] @ position[carries]
    if model.swings is None:
        return Seen(center, R, s), moved(model, x)
    x = s.onward @ x + s.gain @ residual[s.fit.nodes].ravel()
    off = s.leak @ x
    if s.share is None:
        center = center + R @ off[:3]
    return Seen(center, turned((R @ off[3:])[None], R[None])[0], s), moved(model, x)


def moved(model: LiveModel, x: Array) -> Swing:
    """The states of the amplitudes with the inertia and the momentum that they make."""
    swings = model.swings
    if swings is None:
        return Swing(x, model.products.inertia[0, 0], model.inside)
    each = swings.each
    a = np.concatenate([ONE, x[::each]])
    wide = a[:, None]
    J = ((wide * a).ravel() @ model.products.inertia.reshape(-1, 9)).reshape(3, 3)
    return Swing(x, J, (wide * x[1::each]).ravel() @ model.products.momentum.reshape(-1, 3) + model.inside)


SEE: Any = getattr(compiled, "look", None)  # None where nothing was compiled, or before it was there
