"""The load at samples near an edge: its mean over the cell of a sample, from midpoint to midpoint.

What acts for a part of a step has no value at a sample that samples could show. What it gives, they do: the
change of momentum over a cell, by the length of the cell. For a load that varies little within a step, that
is its value. Cells next to each other give together what the load gives. Source: principal equations 4e.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from forceid.flight.channels import Channel
from forceid.flight.pieces import Pieces
from forceid.flight.priors.protocol import MOMENTUM, LoadPrior, channel_model
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array, Indices

OPEN = 4.0  # steps by which an edge is open at most: one that is more open is none


@dataclass(frozen=True)
class Cells:
    """A channel with the frames of its record and the ends of cells between its samples.

    at (time,): where the frames are in it; sample (cell,): the frames that have a cell; ends (cell, 2): where
    cells begin and end in the channel. A cell begins where one before it ends.
    """

    channel: Channel
    at: Indices
    sample: Indices
    ends: Indices

    @property
    def length(self) -> Array:
        """Length (cell, 1) s."""
        return np.diff(self.channel.time[self.ends])


def step_of(channel: Channel) -> float:
    """Time s between samples that a channel shows."""
    return float(np.median(np.diff(channel.time[np.isfinite(channel.z).all(1)])))


def cells_beside(channel: Channel, short: Sequence[tuple[float, float]], time: Array) -> Cells:
    """The cells of frames, at time (time,) s, within a few steps of an edge or a piece, (begin, end) s."""
    reach, near = OPEN * step_of(channel), np.zeros(len(time), bool)
    for begin, end in short:
        near |= (time > begin - reach) & (time < end + reach)
    sample = np.flatnonzero(near)
    middle = np.concatenate([time[:1], 0.5 * (time[1:] + time[:-1]), time[-1:]])
    ends = np.stack([middle[sample], middle[sample + 1]], 1)
    more = np.setdiff1d(np.concatenate([time, ends.ravel()]), channel.time)
    at = np.searchsorted(channel.time, more)
    cov = channel.noise_cov[np.minimum(at, len(channel.time) - 1)]
    finer = replace(
        channel,
        time=np.insert(channel.time, at, more),
        z=np.insert(channel.z, at, np.nan, axis=0),
        noise_cov=np.insert(channel.noise_cov, at, cov, axis=0),
    )
    return Cells(finer, np.searchsorted(finer.time, time), sample, np.searchsorted(finer.time, ends))


def motion_in(cells: Cells, prior: LoadPrior, pieces: Pieces, engine: Engine) -> Array:
    """Momentum and load (time, 6), world axes, that a channel shows in pieces."""
    model = model_in(cells, prior, pieces)
    return read(cells, prior, engine.smooth_states(model, cells.channel.moved))


def load_in(cells: Cells, prior: LoadPrior, pieces: Pieces, engine: Engine) -> tuple[Array, Array]:
    """The load (time, 3) that a channel shows in pieces, world axes, and its covariance (time, 3, 3)."""
    begin, end = cells.ends.T
    model, z = model_in(cells, prior, pieces), cells.channel.moved
    found = engine.smooth(with_copy(model, begin, len(z) - 1) if len(begin) else model, z)
    cov = prior.rows @ found.P[cells.at, : prior.states, : prior.states] @ prior.rows.T
    if len(begin):
        cov[cells.sample] = prior.axes @ change_of(found.P[end]) @ prior.axes.T / cells.length[..., None] ** 2
    return read(cells, prior, found.x)[:, 3:], np.asarray(cov)


def model_in(cells: Cells, prior: LoadPrior, pieces: Pieces) -> StateSpace:
    """The model of a channel whose load comes in pieces."""
    return channel_model(cells.channel, replace(prior, tuned=replace(prior.tuned, pieces=pieces)))


def read(cells: Cells, prior: LoadPrior, x: Array) -> Array:
    """Momentum and load (time, 6) of states x of the channel."""
    momentum, load = x[:, MOMENTUM] @ prior.axes.T, x[cells.at, : prior.states] @ prior.rows.T
    begin, end = cells.ends.T
    load[cells.sample] = (momentum[end] - momentum[begin]) / cells.length
    return np.concatenate([momentum[cells.at], load], 1)


def with_copy(model: StateSpace, at: Indices | int, steps: int) -> StateSpace:
    """A model of steps with a copy of the momentum as three states more, taken anew at some samples."""
    n = len(model.x0)
    F, Q = (np.zeros((steps, n + 3, n + 3)) for _ in range(2))
    F[:, :n, :n], Q[:, :n, :n], F[:, n:, n:] = model.F, model.Q, np.eye(3)
    F[at, n:, n:], F[at, n:, MOMENTUM] = 0.0, np.eye(3)
    return replace(
        model, F=F, Q=Q, H=np.pad(model.H, [*[(0, 0)] * (model.H.ndim - 1), (0, 3)]),
        x0=np.pad(model.x0, (0, 3)), P0=np.pad(model.P0, (0, 3)),
        u=None if model.u is None else np.pad(model.u, ((0, 0), (0, 3))),
    )  # fmt: skip


def change_of(P: Array) -> Array:
    """Covariance (..., 3, 3) of the momentum less its copy, which comes last, in that of the states."""
    change = np.zeros((3, P.shape[-1]))
    change[:, MOMENTUM], change[:, -3:] = np.eye(3), -np.eye(3)
    return np.asarray(change @ P @ change.T)
