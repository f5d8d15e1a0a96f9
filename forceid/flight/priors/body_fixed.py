"""A load that keeps to axes of the body: its states in world axes, turned from sample to sample.

A thrust, a leak, a fin is slow in the axes of the body only. Source: principal equations 4f.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss

from forceid.compiled import engine as compiled
from forceid.flight.attitude import between, turned
from forceid.records import Array, Indices

GAUSS = 0.5 + 0.5 * np.array(leggauss(3)[0]), 0.5 * np.array(leggauss(3)[1])  # points, weights on 0 to 1


@dataclass(frozen=True)
class Turning:
    """How fast axes of a body turn, in the mean over a record: what that does to noise seen along them.

    across (3,) 1/s2: mean square of the spin across each axis; fourth (3,) 1/s4: mean of that times the whole
    spin squared. A load in body axes is (d/dt + [omega]x)^2 of a position there, whose noise is as white as
    in the world: of density 1 it makes w^4 + 6 across w^2 + fourth along an axis, and white noise of the
    momentum w^2 + across. Exact for a steady spin.
    """

    across: Array
    fourth: Array

    @classmethod
    def of(cls, time: Array, along: Array) -> Turning:
        """The turning of axes (time, 3, 3), columns in world axes, at times (time,) s."""
        turn = between(along[1:], along[:-1]) / np.diff(time)[:, None]
        own = np.einsum("tba,tb->ta", along[:-1], turn)
        whole = (own**2).sum(1, keepdims=True)
        across = whole - own**2
        return cls(across.mean(0), (whole * across).mean(0))

    def of_position(self, w: Array) -> Array:
        """Density (axis, frequency) of white noise of a position, as a load over that in the world, at w
        rad/s.
        """
        return np.asarray(1 + (6 * self.across[:, None] + self.fourth[:, None] / w**2) / w**2)

    def of_momentum(self, w: Array) -> Array:
        """The same of a noise that adds up in the position, and is white in the momentum."""
        return np.asarray(1 + self.across[:, None] / w**2)


def fix_to_body(
    F: Array, Q: Array, which: Indices, n: int, step: Array, rotation: Array, axes: Array
) -> tuple[Array, Array]:
    """Steps (time - 1, state, state) of a chain whose load keeps to axes (3, 3) of a body, in world axes.

    F, Q (kind, state, state) of kinds of step along these axes, n states of them in threes; which (time -
    1,): the kind of each step. The load's states turn with the body; what they add to the integrals Y and H
    over a step is turned by the mean rotation of the step, weighted for Y as a push early in it counts more.
    Compiled where a compiler was.
    """
    at = rotation @ axes
    early, mean = (turn @ axes for turn in swept(step, rotation))
    fixed = fixed_in_numpy if compiled is None else compiled.fixed_to_body
    return fixed(F, Q, which, early, mean, at, n)


def fixed_in_numpy(
    F: Array, Q: Array, which: Indices, early: Array, mean: Array, at: Array, n: int
) -> tuple[Array, Array]:
    """`fix_to_body`, all steps at once, by axes at (time, 3, 3) and their means (time - 1, 3, 3)."""
    begin, end = (np.tile(np.eye(F.shape[1]), (len(which), 1, 1)) for _ in range(2))
    for i in range(6, n, 3):
        load = slice(i, i + 3)
        begin[:, load, load], end[:, load, load] = at[:-1], at[1:]
    end[:, :3, :3], end[:, 3:6, 3:6] = early, mean
    moved = end @ F[which] @ begin.swapaxes(1, 2)
    moved[:, :6, :6] = F[which, :6, :6]
    return moved, end @ Q[which] @ end.swapaxes(1, 2)


def start_in_body(P0: Array, n: int, axes: Array) -> Array:
    """Start covariance of a chain of n states whose load is along axes (3, 3) at the first sample."""
    start = np.eye(len(P0))
    for i in range(6, n, 3):
        start[i : i + 3, i : i + 3] = axes
    return np.asarray(start @ P0 @ start.T)


def swept(step: Array, rotation: Array) -> tuple[Array, Array]:
    """Mean rotations (time - 1, 3, 3) over each step (s), weighted as a push counts for Y, and for H.

    A spin that changes evenly from step to step bends the way between two rotations.
    """
    turn = between(rotation[1:], rotation[:-1])
    bend = np.zeros_like(turn)
    if len(step) > 1:
        middle = np.cumsum(step) - 0.5 * step
        bend = 0.5 * step[:, None] ** 2 * np.gradient(turn / step[:, None], middle, axis=0)
    by = np.stack([turned(u * turn - u * (1 - u) * bend, rotation[:-1]) for u in GAUSS[0]])
    weights = 2 * (1 - GAUSS[0]) * GAUSS[1], GAUSS[1]
    early, mean = (np.tensordot(w, by, 1) for w in weights)
    return early, mean
