"""Claims that allow for the orders of a prior that a record does not tell apart.

The smoothest likely order of a load's prior claims the least error. Rougher ones that are about as likely
claim more, and their loads differ: the deviation is the mean one of all, each weighed by its likelihood.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.kalman.channels import Channel
from forceid.kalman.engines import Engine
from forceid.kalman.flight import FlightState
from forceid.kalman.prior import LoadPrior, channel_model, load_rows
from forceid.kalman.tuning import Tuned
from forceid.records import Array

LONGEST = 2048  # samples that are looked at: the middle of a longer record
FEW = 1e-3  # weight below which an order does not count


def allow_for_orders(
    state: FlightState, channels: dict[str, Channel], priors: dict[str, LoadPrior], engine: Engine
) -> FlightState:
    """The same state, whose claims are those of the mixture of likely orders where these are wider.

    channels: that force and moment drive, by name, with their priors. The load stays that of its own prior:
    what the loads of the others differ from it counts as error.
    """
    grown = np.eye(6)
    for name, prior in priors.items():
        first = 0 if name == "force" else 3
        axes = prior.axes if prior.carried is None else np.eye(3)
        grown[first : first + 3, first : first + 3] = axes * growth(channels[name], prior, engine) @ axes.T
    return replace(state, wrench_cov=grown @ state.wrench_cov @ grown.T)


def growth(channel: Channel, prior: LoadPrior, engine: Engine) -> Array:
    """Factors (3,), one at least, on the claimed error of a load along the axes of its prior."""
    own = prior.tuned
    # smoother ones would only narrow the claim; a load without a derivative is none that acts
    orders = (own, *(t for t in own.rivals if 1 < t.order < own.order))
    weight = np.exp([t.log_likelihood - max(o.log_likelihood for o in orders) for t in orders])
    weight /= weight.sum()
    likely = [(w, t) for w, t in zip(weight, orders, strict=True) if w > FEW or t is own]
    if len(likely) == 1:
        return np.ones(3)
    first = max(0, (len(channel.time) - LONGEST) // 2)
    part = cut(channel, slice(first, first + LONGEST))
    found = [smoothed(part, prior, t, engine) for _, t in likely]
    loads, var = np.stack([load for load, _ in found]), np.stack([v for _, v in found])
    w = np.array([w for w, _ in likely]) / sum(w for w, _ in likely)
    apart = ((loads - loads[0]) ** 2).mean(1)
    return np.asarray(np.maximum(w @ np.sqrt(var + apart) / np.sqrt(var[0]), 1.0))


def smoothed(channel: Channel, prior: LoadPrior, tuned: Tuned, engine: Engine) -> tuple[Array, Array]:
    """Load (time, 3) along the axes of a prior of another order, and its mean variance (3,)."""
    still = prior.tuned.std <= 0
    own = replace(tuned, std=np.where(still, prior.tuned.std, tuned.std))
    model = channel_model(channel, replace(prior, tuned=own))
    path = engine.smooth(model, channel.moved)
    rows = prior.axes.T @ load_rows(len(model.x0), prior.axes, prior.lines)
    middle = slice(len(channel.time) // 8, -(len(channel.time) // 8) or None)
    var = np.einsum("as,tsr,ar->ta", rows, path.P, rows)[middle]
    return (path.x @ rows.T)[middle], var.mean(0)


def cut(channel: Channel, run: slice) -> Channel:
    """A stretch of a channel."""
    cov = channel.noise_cov
    return replace(
        channel, time=channel.time[run], z=channel.z[run], noise_cov=cov[run] if cov.ndim == 3 else cov
    )
