"""The prior of a load in space: a Matern load along each of three axes, and lines along their directions.

The axes stand still in the laboratory, or turn with the body. A load that does (a thrust, a leak, a fin) is
slow only there: its states are kept in world axes all the same, and turned from sample to sample. Source:
principal equations 4e, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.spatial.transform import Rotation

from forceid.flight.channels import Channel, Start, load_chain
from forceid.flight.tuning import Tuned
from forceid.kalman.lines import Line
from forceid.kalman.model import StateSpace
from forceid.kalman.process import Process, discretize, integrate
from forceid.records import Array

GAUSS = 0.5 + 0.5 * np.array(leggauss(3)[0]), 0.5 * np.array(leggauss(3)[1])  # points, weights on 0 to 1


@dataclass(frozen=True)
class LoadPrior:
    """A tuned Matern prior along three axes (columns of `axes`, world), and how unknown its start is.

    lines: that the load holds beside, with directions in world axes, or in those of the body for lines that
    turn with it. carried: axes (3, 3) of the body, as columns, along which the load is Matern instead and
    with which it turns; `axes` are then the world's. The states are those of `chain_along`, whatever turns.
    """

    tuned: Tuned
    axes: Array
    start: Start
    lines: tuple[Line, ...] = ()
    carried: Array | None = None

    @property
    def states(self) -> int:
        """Of its chain: Y, H, mean, the load and its derivatives along three axes, and two a line."""
        return 3 * (self.tuned.order + 3) + 2 * len(self.lines)

    @property
    def noise(self) -> Array:
        """The factor (3, 3) on the noise of the channel that was found with it, world axes."""
        return np.asarray(self.axes * self.tuned.noise @ self.axes.T)


def any_force(prior: LoadPrior) -> LoadPrior:
    """The force prior of fewest states, for a rotation whose errors nothing links to those of the center."""
    return replace(prior, tuned=replace(prior.tuned, order=1), lines=())


def chain_along(prior: LoadPrior, step: Array, rotation: Array | None = None) -> tuple[Array, Array, Array]:
    """F, Q (time - 1, state, state) and P0 of the chain of one load: three components an order, on its axes.

    Not in world axes: turned together, a strong and a weak axis would lose the weak one to rounding. Behind
    them two states a line, which drives all three axes as its direction says, where that turns by the mean of
    a step. rotation (time, 3, 3): of the body, for a load or a line that turns with it.
    """
    tuned, start = prior.tuned, prior.start
    unique, which = np.unique(np.round(step, 12), return_inverse=True)
    smooth = load_chain(tuned.order, tuned.std, tuned.rate, start)
    F, Q = discretize(Process(smooth.A[None], smooth.Qc[None], smooth.P0, smooth.output), unique[:, None])
    n = 3 * len(smooth.output)
    size = n + 2 * len(prior.lines)

    def interleave(a: Array) -> Array:
        wide = np.einsum("...ijl,ab,bi->...jalb", a, np.eye(3), np.eye(3))
        out = np.zeros((*a.shape[:-3], size, size))
        out[..., :n, :n] = wide.reshape(*a.shape[:-3], n, n)
        return out

    F, Q, P0 = interleave(F), interleave(Q), interleave(smooth.P0)
    if rotation is not None and (prior.carried is not None or any(line.turns for line in prior.lines)):
        F, Q, unique, which = F[which], Q[which], step, np.arange(len(step))
        if prior.carried is not None:
            F, Q, P0 = carry(F, Q, P0, n, step, rotation, prior.carried)
    for i, line in enumerate(prior.lines):
        own = slice(n + 2 * i, n + 2 * i + 2)
        F_line, Q_line = discretize(integrate(integrate(line.process, 0.0), 0.0), unique)
        spread = np.zeros(
            (len(unique), size, 4)
        )  # its Y and H along its direction, its two states as they are
        early, mean = swept(step, rotation) if line.turns and rotation is not None else (np.eye(3), np.eye(3))
        spread[:, :3, 0], spread[:, 3:6, 1] = (turn @ line.direction @ prior.axes for turn in (early, mean))
        spread[:, own, 2:] = np.eye(2)
        F[:, :, own] = spread @ F_line[:, :, 2:]
        Q += spread @ Q_line @ spread.swapaxes(1, 2)
        P0[own, own] = line.process.P0
    return F[which], Q[which], P0


def pushes(F: Array, step: Array, axes: Array) -> tuple[Array, Array]:
    """Rows (step, 3, state), world axes, that read a load over a step, and its rate, out of the chain before
    it.

    Of the load that changes evenly over the step and does as much to Y and H as the chain's own: a load that
    oscillates between two samples is not known by its value and rate at the first. F: of the chain, along
    axes.
    """
    s = step[:, None, None]
    Y, H = F[:, :3].copy(), F[:, 3:6].copy()
    Y[:, :, :6] = H[:, :, :6] = 0.0
    return axes @ (6 * Y / s**2 - 2 * H / s), axes @ (6 * H / s**2 - 12 * Y / s**3)


def carry(
    F: Array, Q: Array, P0: Array, n: int, step: Array, rotation: Array, axes: Array
) -> tuple[Array, Array, Array]:
    """A chain of n states whose load keeps to axes (3, 3) of a body, with all of its states in world axes.

    The load's states turn with the body; what they add to the integrals Y and H over a step is turned by the
    mean rotation of the step, weighted for Y as a push early in it counts more.
    """
    at = rotation @ axes
    early, mean = (turn @ axes for turn in swept(step, rotation))
    begin, end = (np.tile(np.eye(F.shape[1]), (len(F), 1, 1)) for _ in range(2))
    start = np.eye(F.shape[1])
    for i in range(6, n, 3):
        load = slice(i, i + 3)
        begin[:, load, load], end[:, load, load], start[load, load] = at[:-1], at[1:], at[0]
    free = F[:, :6, :6].copy()
    end[:, :3, :3], end[:, 3:6, 3:6] = early, mean
    F = end @ F @ begin.swapaxes(1, 2)
    F[:, :6, :6] = free
    return F, end @ Q @ end.swapaxes(1, 2), start @ P0 @ start.T


def swept(step: Array, rotation: Array) -> tuple[Array, Array]:
    """Mean rotations (time - 1, 3, 3) over each step (s), weighted as a push counts for Y, and for H.

    A spin that changes evenly from step to step bends the way between two rotations.
    """
    turn = Rotation.from_matrix(rotation[1:] @ rotation[:-1].swapaxes(1, 2)).as_rotvec()
    bend = np.zeros_like(turn)
    if len(step) > 1:
        middle = np.cumsum(step) - 0.5 * step
        bend = 0.5 * step[:, None] ** 2 * np.gradient(turn / step[:, None], middle, axis=0)
    by = np.stack([Rotation.from_rotvec(u * turn - u * (1 - u) * bend).as_matrix() for u in GAUSS[0]])
    weights = 2 * (1 - GAUSS[0]) * GAUSS[1], GAUSS[1]
    early, mean = (np.einsum("u,utab->tab", w, by) @ rotation[:-1] for w in weights)
    return early, mean


def channel_model(channel: Channel, prior: LoadPrior, rotation: Array | None = None) -> StateSpace:
    """Linear model of three measured channels, z'' = gain * load, about their first sample.

    rotation (time, 3, 3): of the body, for a load that turns with it.
    """
    step = np.diff(channel.time)
    F, Q, P0 = chain_along(prior, step, rotation)
    Q[:, :3, :3] += step[:, None, None] * (prior.axes.T @ channel.drift @ prior.axes)
    H = np.zeros((3, len(P0)))
    H[:, :3] = channel.gain * prior.axes
    return StateSpace(F, Q, H, channel.noise_cov, np.zeros(len(P0)), P0)


def load_rows(states: int, axes: Array, lines: tuple[Line, ...], rotation: Array | None = None) -> Array:
    """Rows (3, state) that read the load, world axes, out of the states of a chain.

    rotation (time, 3, 3): of the body, for lines that turn with it; the rows are (time, 3, state) then.
    """
    rows = np.zeros((3, states))
    rows[:, 6:12] = np.tile(axes, 2)
    if rotation is not None:
        rows = np.tile(rows, (len(rotation), 1, 1))
    for i, line in enumerate(lines):
        direction = line.direction
        if line.turns:
            assert rotation is not None
            direction = rotation @ direction
        rows[..., states - 2 * (len(lines) - i)] = direction
    return rows


def along_world(chain: Array, axes: Array, lines: tuple[Line, ...] = ()) -> tuple[Array, Array, Array]:
    """Momentum, load and rate of the load (time, 3), world axes, in the states of a chain (time, state)."""
    smooth = chain.shape[1] - 2 * len(lines)
    rate = chain[:, 12:15] @ axes.T if smooth > 12 else np.zeros((len(chain), 3))
    for i, line in enumerate(lines):
        phasor = chain[:, smooth + 2 * i : smooth + 2 * i + 2]
        rate += (phasor @ line.process.A[0])[:, None] * line.direction
    return chain[:, 3:6] @ axes.T, chain @ load_rows(chain.shape[1], axes, lines).T, rate
