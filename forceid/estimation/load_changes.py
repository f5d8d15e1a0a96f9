"""How far force and moment move from one level of a model to another, in standard errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.estimation.deformation import smooth_deformation
from forceid.estimation.flight_smoother import Solution
from forceid.estimation.kinematics import Kinematics
from forceid.estimation.load_channels import force_channel, moment_channel, tune_channel
from forceid.kalman.channels import Channel
from forceid.kalman.engines import Engine
from forceid.kalman.prior import LoadPrior, channel_model, load_rows
from forceid.records import Array


@dataclass(frozen=True)
class Seen:
    """A load as one of its channels shows it: the prior tuned on it, load and its std (time, axis)."""

    channel: Channel
    prior: LoadPrior
    load: Array
    std: Array


def channels_of(kin: Kinematics, gravity: Array, engine: Engine) -> tuple[Channel, Channel]:
    """The channels that force and moment drive, as a level sees them."""
    return force_channel(kin, gravity), moment_channel(kin, smooth_deformation(kin, engine))


def own_prior(channel: Channel, engine: Engine) -> LoadPrior:
    """The prior that a flight would tune on a channel, without lines."""
    return tune_channel(channel, (1.0, 1.0), (), engine=engine)


def loads_seen(kin: Kinematics, gravity: Array, engine: Engine) -> list[Seen]:
    """Force and moment as the channels of a level show them."""
    found = []
    for channel in channels_of(kin, gravity, engine):
        prior = own_prior(channel, engine)
        model = channel_model(channel, prior)
        path = engine.smooth(model, channel.moved)
        rows = load_rows(len(model.x0), prior.axes, ())
        std = np.sqrt(np.einsum("ai,tij,aj->ta", rows, path.P, rows))
        found.append(Seen(channel, prior, path.x @ rows.T, std))
    return found


def load_under(prior: LoadPrior, channel: Channel, best: Seen, engine: Engine) -> Array:
    """The load (time, axis) that a channel shows under a prior, at the times of the best level."""
    model = channel_model(channel, prior)
    path = engine.smooth(model, channel.moved).x @ load_rows(len(model.x0), prior.axes, ()).T
    _, own, other = np.intersect1d(channel.time, best.channel.time, return_indices=True)
    load = np.full_like(best.load, np.nan)
    load[other] = path[own]
    return load


def changes(one: Solution, other: Solution) -> tuple[float, float]:
    """How far force and moment of two solutions are apart, in standard errors of the other."""
    a, b = one.state, other.state
    std = np.sqrt(np.diagonal(b.wrench_cov, axis1=1, axis2=2))
    return distance(a.force, b.force, std[:, :3]), distance(a.moment, b.moment, std[:, 3:])


def distance(a: Array, b: Array, std: Array) -> float:
    """Rms of (a - b) / std over the central three quarters; a, b, std (time, axis). Zero where none is known.

    >>> distance(np.ones((8, 3)), np.zeros((8, 3)), np.full((8, 3), 0.5))
    2.0
    """
    edge = len(a) // 8
    inner = slice(edge, len(a) - edge)
    square = ((a - b)[inner] / std[inner]) ** 2
    return float(np.sqrt(np.nanmean(square))) if np.isfinite(square).any() else 0.0
