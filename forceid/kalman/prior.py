"""The prior of a load in space: a Matern load along each of three axes, and lines along their directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.kalman.channels import Channel, Start, load_chain
from forceid.kalman.lines import Line
from forceid.kalman.model import StateSpace
from forceid.kalman.process import Process, discretize, integrate
from forceid.kalman.tuning import Tuned
from forceid.records import Array


@dataclass(frozen=True)
class LoadPrior:
    """A tuned Matern prior along three axes (columns of `axes`, world), and how unknown its start is.

    lines: that the load holds beside, with directions in world axes.
    """

    tuned: Tuned
    axes: Array
    start: Start
    lines: tuple[Line, ...] = ()


def chain_along(prior: LoadPrior, step: Array) -> tuple[Array, Array, Array]:
    """F, Q (time - 1, state, state) and P0 of the chain of one load: three components an order, on its axes.

    Not in world axes: turned together, a strong and a weak axis would lose the weak one to rounding. Behind
    them two states a line, which drives all three axes as its direction says.
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
    for i, line in enumerate(prior.lines):
        own = slice(n + 2 * i, n + 2 * i + 2)
        F_line, Q_line = discretize(integrate(integrate(line.process, 0.0), 0.0), unique)
        spread = np.zeros((size, 4))  # its Y and H along its direction, its own two states as they are
        spread[:3, 0] = spread[3:6, 1] = line.direction @ prior.axes
        spread[own, 2:] = np.eye(2)
        F[:, :, own] = spread @ F_line[:, :, 2:]
        Q += spread @ Q_line @ spread.T
        P0[own, own] = line.process.P0
    return F[which], Q[which], P0


def channel_model(channel: Channel, prior: LoadPrior) -> StateSpace:
    """Linear model of three measured channels, z'' = gain * load, about their first sample."""
    step = np.diff(channel.time)
    F, Q, P0 = chain_along(prior, step)
    Q[:, :3, :3] += step[:, None, None] * (prior.axes.T @ channel.drift @ prior.axes)
    H = np.zeros((3, len(P0)))
    H[:, :3] = channel.gain * prior.axes
    return StateSpace(F, Q, H, channel.noise_cov, np.zeros(len(P0)), P0)


def load_rows(states: int, axes: Array, lines: tuple[Line, ...]) -> Array:
    """Rows (3, state) that read the load, world axes, out of the states of a chain."""
    rows = np.zeros((3, states))
    rows[:, 6:12] = np.tile(axes, 2)
    for i, line in enumerate(lines):
        rows[:, states - 2 * (len(lines) - i)] = line.direction
    return rows


def along_world(chain: Array, axes: Array, lines: tuple[Line, ...] = ()) -> tuple[Array, Array, Array]:
    """Momentum, load and rate of the load (time, 3), world axes, in the states of a chain (time, state)."""
    smooth = chain.shape[1] - 2 * len(lines)
    rate = chain[:, 12:15] @ axes.T if smooth > 12 else np.zeros((len(chain), 3))
    for i, line in enumerate(lines):
        phasor = chain[:, smooth + 2 * i : smooth + 2 * i + 2]
        rate += (phasor @ line.process.A[0])[:, None] * line.direction
    return chain[:, 3:6] @ axes.T, chain @ load_rows(chain.shape[1], axes, lines).T, rate
