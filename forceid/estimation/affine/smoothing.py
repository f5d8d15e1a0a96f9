"""The channels of an affine motion, smoothed under priors of the loads that drive them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.errors import EstimationError
from forceid.estimation.affine.channels import AffineChannels
from forceid.flight.priors.protocol import LoadPrior, channel_model
from forceid.kalman.building.process import block_diagonal
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.rounding import SINGLE


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


def smooth_channels(channels: AffineChannels, priors: list[LoadPrior], chosen: Engine) -> SmoothedChannels:
    """The channels smoothed, each group by itself where no error links them, else all in one model."""
    models = [
        channel_model(channel, prior, channels.rotation)
        for channel, prior in zip(channels.groups, priors, strict=True)
    ]
    T, n = len(channels.time), len(models)
    offset = np.stack([g.z[np.isfinite(g.z).all(1)][0] for g in channels.groups])  # (group, 3)
    if channels.linked < SINGLE:
        paths = [chosen.smooth(m, g.moved) for m, g in zip(models, channels.groups, strict=True)]
        total = sum(p.filtered.log_likelihood for p in paths)
    else:
        joint = block_model(models, channels.noise)
        paths = [chosen.smooth(joint, np.concatenate([g.moved for g in channels.groups], 1))]
        total = paths[0].filtered.log_likelihood
    if not all(np.isfinite(p.x).all() for p in paths):
        raise EstimationError("does not smooth", "the affine motion", "look at the markers for wild samples")
    x, P = np.concatenate([p.x for p in paths], 1), [p.P for p in paths]
    sizes = [m.F.shape[-1] for m in models]
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    turning = channels.rotation if any(line.turns for prior in priors for line in prior.lines) else None
    read = np.zeros((1 if turning is None else T, 3, 3, n, sum(sizes)))  # load, channel, rate: axis and group
    for B, (at, size, prior) in enumerate(zip(starts, sizes, priors, strict=True)):
        # the center's chain runs along the axes of its prior, those of the columns in world axes
        read[:, 0, :, B, at : at + size] = prior.rows_along(turning)
        for first, which in ((0, 1), (3, 2)):
            read[:, which, :, B, at + first : at + first + 3] = channels.groups[B].gain * prior.axes
    k, z, rate = np.einsum("tmaBs,ts->mtaB", np.broadcast_to(read, (T, *read.shape[1:])), x)
    rows = read[:, :2].reshape(len(read), 6 * n, -1)
    cov = np.zeros((T, 6 * n, 6 * n))
    for at, size, part in zip(starts, sizes, P, strict=False) if len(P) > 1 else [(0, sum(sizes), P[0])]:
        own = rows[:, :, at : at + size]
        cov += own @ part @ own.mT
    return SmoothedChannels(z + offset.T, rate, k, cov, float(total))


def block_model(models: list[StateSpace], noise: Array) -> StateSpace:
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
