"""The channels of an affine motion, smoothed under priors of the loads that drive them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.errors import EstimationError
from forceid.estimation.affine_channels import AffineChannels
from forceid.kalman.channels import Channel, load_chain
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.kalman.prior import LoadPrior, carry, channel_model
from forceid.kalman.process import Process, block_diagonal, discretize, resonator
from forceid.records import Array

APART = 1e-6  # correlation of two groups of channels that is none


@dataclass(frozen=True)
class SmoothedChannels:
    """Channels z, rates, loads k (time, 3, group), as the groups come; cov (time, 6 group, 6 group) of k,
    then z, row by row.
    """

    z: Array
    rate: Array
    k: Array
    cov: Array
    log_likelihood: float


def smoothed(channels: AffineChannels, priors: list[LoadPrior], chosen: Engine) -> SmoothedChannels:
    """The channels smoothed, each group by itself where no error links them, else all in one model."""
    models = [
        carried_model(channel, prior, channels.rotation)
        if prior.lines
        else channel_model(channel, prior, channels.rotation)
        for channel, prior in zip(channels.groups, priors, strict=True)
    ]
    T, n = len(channels.time), len(models)
    offset = np.stack([g.z[np.isfinite(g.z).all(1)][0] for g in channels.groups])  # (group, 3)
    if channels.linked < APART:
        paths = [chosen.smooth(m, g.moved) for m, g in zip(models, channels.groups, strict=True)]
        total = sum(p.filtered.log_likelihood for p in paths)
    else:
        joint = together(models, channels.noise)
        paths = [chosen.smooth(joint, np.concatenate([g.moved for g in channels.groups], 1))]
        total = paths[0].filtered.log_likelihood
    if not all(np.isfinite(p.x).all() for p in paths):
        raise EstimationError("does not smooth", "the affine motion", "look at the markers for wild samples")
    x, P = np.concatenate([p.x for p in paths], 1), [p.P for p in paths]
    sizes = [m.F.shape[-1] for m in models]
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    read = np.zeros((3, 3, n, sum(sizes)))  # load, channel and rate of every axis and group
    for B, (at, prior) in enumerate(zip(starts, priors, strict=True)):
        for a in range(3):
            # the center's chain runs along the axes of its prior, those of the columns in world axes
            loads = (6, 9, *lines_at(prior))
            for first, which in ((0, 1), (3, 2), *((at_load, 0) for at_load in loads)):
                read[which, a, B, at + first : at + first + 3] += prior.axes[a]
        read[1, :, B] *= channels.groups[B].gain
        read[2, :, B] *= channels.groups[B].gain
    k, z, rate = np.einsum("maBs,ts->mtaB", read, x)
    rows = read[:2].reshape(6 * n, -1)
    cov = np.zeros((T, 6 * n, 6 * n))
    for at, size, part in zip(starts, sizes, P, strict=False) if len(P) > 1 else [(0, sum(sizes), P[0])]:
        own = rows[:, at : at + size]
        cov += own @ part @ own.T
    return SmoothedChannels(z + offset.T, rate, k, cov, float(total))


def lines_at(prior: LoadPrior) -> list[int]:
    """Where the loads of the lines of a carried prior begin among its states, three lines a time."""
    return [3 * (3 + prior.tuned.order + 2 * j) for j in range(len(prior.lines) // 3)]


def carried_model(channel: Channel, prior: LoadPrior, rotation: Array) -> StateSpace:
    """A channel whose load turns with the body, lines and all: three of them in turn along its axes."""
    assert prior.carried is not None
    tuned, step = prior.tuned, np.diff(channel.time)
    beside = [
        resonator(three[0].frequency, [line.std for line in three], three[0].bandwidth)
        for three in (prior.lines[i : i + 3] for i in range(0, len(prior.lines), 3))
    ]
    chain = load_chain(tuned.order, tuned.std, tuned.rate, prior.start, beside)
    unique, which = np.unique(np.round(step, 12), return_inverse=True)
    F, Q = discretize(Process(chain.A[None], chain.Qc[None], chain.P0, chain.output), unique[:, None])
    n, eye = 3 * len(chain.output), np.eye(3)
    F, Q, P0 = (
        np.einsum("...ijl,ab,bi->...jalb", a, eye, eye).reshape(*a.shape[:-3], n, n) for a in (F, Q, chain.P0)
    )
    F, Q, P0 = carry(F[which], Q[which], P0, n, rotation, prior.carried)
    Q[:, :3, :3] += step[:, None, None] * channel.drift
    H = channel.gain * np.eye(3, n)
    return StateSpace(F, Q, H, channel.noise_cov, np.zeros(n), P0)


def together(models: list[StateSpace], noise: Array) -> StateSpace:
    """One model of all groups, whose errors noise (time, channel, channel) links."""
    T = len(noise)
    F, Q = (
        block_diagonal(
            *(np.broadcast_to(getattr(m, name), (T - 1, *getattr(m, name).shape[-2:])) for m in models)
        )
        for name in ("F", "Q")
    )
    H = np.zeros((3 * len(models), F.shape[-1]))
    at = 0
    for i, m in enumerate(models):
        H[3 * i : 3 * i + 3, at : at + m.H.shape[1]] = m.H
        at += m.H.shape[1]
    return StateSpace(F, Q, H, noise, np.zeros(at), block_diagonal(*(m.P0 for m in models)))
