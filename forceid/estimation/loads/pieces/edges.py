"""What a load is near its edges: the mean over all places that an edge may have, and claimed as their spread.

The place of an edge is known as well as the likelihood of the channel tells it from others. Each place has a
load of its own, before it, behind it and at some distance from it. Source: the law of total variance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from forceid.estimation.loads.pieces.evidence import Evidence, hiding, settled
from forceid.flight.channels import Channel
from forceid.flight.pieces import Pieces
from forceid.flight.priors.protocol import MOMENTUM, LoadPrior, channel_model
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.records import Array, Flags, Indices
from forceid.significance import CHANCE, PATIENCE

HASTES = np.exp([1.5, 3.0, 4.5])  # rates of a load between two edges over that of the record
STANDARD = np.array([-2.5, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.5])  # errors of a place that are tried
MOST_OPEN = 4.0  # steps by which an edge is open at most: one that is more open is none
BENT = 1 / 32  # of a step: over which the likelihood is differenced, far less than a place is open


@dataclass(frozen=True)
class Spread:
    """What the places of edges that are as likely add to momentum and load of a channel (time, 6).

    apart (alternative, time, 6): deviations of momentum and load, each weighed by the root of its share;
    unseen (time, 3, 3): variance of the load at samples that do not show it.
    """

    mean: Array
    apart: Array
    unseen: Array

    @property
    def cov(self) -> Array:
        """What is added to its covariance (time, 3, 3)."""
        load = self.apart[:, :, 3:]
        return np.asarray(np.einsum("kta,ktb->tab", load, load) + self.unseen)

    def at(self, samples: Indices) -> Spread:
        """The same at some samples (time,) of the channel."""
        return Spread(self.mean[samples], self.apart[:, samples], self.unseen[samples])

    def of_change(self, first: int, last: int) -> Array:
        """What is added to the covariance (3, 3) of the change of momentum between two samples."""
        change = self.apart[:, last, :3] - self.apart[:, first, :3]
        return np.asarray(change.T @ change)


def spread_of(channel: Channel, prior: LoadPrior, engine: Engine) -> Spread | None:
    """What is open of the places of the edges of a load, None where it has none.

    Along each direction in which the likelihood of all places bends by itself: those of a short piece are
    open together, for it gives as much in less time.
    """
    pieces = prior.tuned.pieces
    if pieces is None or not len(pieces.edges):
        return None
    evidence = Evidence(channel, prior, engine, pieces.edges)
    found = smoothed(channel, prior, pieces, engine)
    options = [pieces]
    if len(pieces.edges) > 1:  # what is between two edges may change more and faster than the record tells
        wide = as_large_as_it_is(channel.time, found[:, 3:] @ prior.axes, prior, pieces)
        for factor in HASTES:
            haste = pieces.haste.copy()
            haste[1:-1] *= factor
            options += [settled(evidence, replace(one, haste=haste)) for one in (pieces, wide)]
        options += [settled(evidence, one) for one in shortened(channel.time, pieces)]
    each = [placed(evidence, one) for one in options]
    likely = np.array([volume for _, volume in each])
    weight = np.exp(likely - likely.max())
    change = np.einsum("k,kta->ta", weight / weight.sum(), [one.mean for one, _ in each]) - found
    # those that the record does not tell apart from the best count alike in what is claimed
    alike = [one for one, volume in each if volume > likely.max() - PATIENCE]
    apart = [np.concatenate([(one.mean - found - change)[None], one.apart]) for one in alike]
    unseen = np.mean([one.unseen for one in alike], 0) + hiding(evidence, pieces)
    return Spread(change, np.concatenate(apart) / np.sqrt(len(alike)), unseen)


def as_large_as_it_is(time: Array, load: Array, prior: LoadPrior, pieces: Pieces) -> Pieces:
    """Pieces between two edges whose load (time, axis) may vary about its mean by as much as it is."""
    size = pieces.size.copy()
    for k, (begin, end) in enumerate(pairwise(pieces.edges), 1):
        inside = slice(*np.searchsorted(time, (begin, end)))
        level = np.sqrt((load[inside] ** 2).mean(0)) if load[inside].size else 0.0
        size[k] = np.maximum(size[k], level / np.maximum(prior.kernel.std, np.finfo(float).tiny))
    return replace(pieces, size=size)


def shortened(time: Array, pieces: Pieces) -> list[Pieces]:
    """The pieces, one of a few steps between edges as an impact within a step each, that gives as much."""
    found, step = [], float(np.median(np.diff(time)))
    for k, (begin, end) in enumerate(pairwise(pieces.edges)):
        if step / 2 < end - begin < MOST_OPEN * step:
            edges, size, haste = pieces.edges.copy(), pieces.size.copy(), pieces.haste.copy()
            edges[k : k + 2] = 0.5 * (begin + end) + step * np.array([-0.25, 0.25])
            size[k + 1] *= (end - begin) / (step / 2)
            haste[k + 1] = 1.0
            found.append(Pieces(edges, size, haste))
    return found


def placed(evidence: Evidence, pieces: Pieces) -> tuple[Spread, float]:
    """Momentum and load over all places of the edges, how far apart these are, and how likely.

    As a log-likelihood, over the volume of the places.
    """
    channel, prior, engine = evidence.channel, evidence.prior, evidence.engine
    found = smoothed(channel, prior, pieces, engine)
    total, away = found.copy(), [np.zeros((0, *found.shape))]
    volume = float(evidence.likelihood([pieces]).sum())
    for direction in directions(evidence, pieces):
        tried = [one for one in (shifted_by(channel.time, pieces, s * direction) for s in STANDARD) if one]
        likely = evidence.likelihood(tried).sum(1)
        share = np.exp(likely - likely.max())
        share /= share.sum()
        apart = np.array([smoothed(channel, prior, one, engine) - found for one in tried])
        mean = np.einsum("k,kta->ta", share, apart)
        total += mean
        away.append(np.sqrt(share)[:, None, None] * (apart - mean))
        volume += float(np.log(np.linalg.norm(direction)))
    return Spread(total, np.concatenate(away), unseen(channel, prior, pieces, engine)), volume


def unseen(channel: Channel, prior: LoadPrior, pieces: Pieces, engine: Engine) -> Array:
    """Variance (time, 3, 3) of a load at samples next to a piece so short that these do not show it.

    What it gives in any part of a step down to a tenth, each as likely by the decade: of the square of the
    impulse over the step, the logarithm of ten.
    """
    cov, step = np.zeros((len(channel.time), 3, 3)), float(np.median(np.diff(channel.time)))
    if not (np.diff(pieces.edges) < 2 * step).any():
        return cov
    momentum = states_in(channel, prior, pieces, engine)[:, MOMENTUM] @ prior.axes.T
    for begin, end in pairwise(pieces.edges):
        if end - begin < 2 * step:
            a = max(int(np.searchsorted(channel.time, begin, "right")) - 1, 0)
            b = min(int(np.searchsorted(channel.time, end)), len(channel.time) - 1)
            near = (channel.time > begin - step) & (channel.time < end + step)
            given = (momentum[b] - momentum[a]) / step
            cov[near] += np.log(10.0) * np.outer(given, given)
    return cov


def directions(evidence: Evidence, pieces: Pieces) -> Array:
    """Errors (direction, edge) s of places, of one standard deviation each, that know nothing of each other.

    By second differences of the likelihood; a step at least a hundredth, and no more than a few.
    """
    time, count = evidence.channel.time, len(pieces.edges)
    step = float(np.median(np.diff(time)))
    one = BENT * step * np.eye(count)
    pairs = [(i, j) for i in range(count) for j in range(i + 1)]
    moves = [s * one[i] + t * one[j] for i, j in pairs for s in (1, -1) for t in (1, -1)]
    tried = [shifted_by(time, pieces, move) or pieces for move in moves]
    likely = evidence.likelihood(tried).sum(1).reshape(-1, 2, 2)
    bend = np.zeros((count, count))
    for (i, j), near in zip(pairs, likely, strict=True):
        # of an edge with itself, two steps either way and none
        bend[i, j] = bend[j, i] = (near[0, 1] + near[1, 0] - near[0, 0] - near[1, 1]) / 4
    curved, axes = np.linalg.eigh(bend / (BENT * step) ** 2)
    std = 1 / np.sqrt(np.clip(curved, (MOST_OPEN * step) ** -2, (CHANCE * step) ** -2))
    return np.asarray(std[:, None] * axes.T)


def shifted_by(time: Array, pieces: Pieces, move: Array) -> Pieces | None:
    """The pieces with their edges moved (edge,) s; None where they would pass each other."""
    edges = pieces.edges + move
    inside = np.concatenate([time[:1], edges, time[-1:]])
    return replace(pieces, edges=edges) if (np.diff(inside) > 0).all() else None


def smoothed(channel: Channel, prior: LoadPrior, pieces: Pieces, engine: Engine) -> Array:
    """Momentum and load (time, 6), world axes, that a channel shows in pieces."""
    x = states_in(channel, prior, pieces, engine)
    return np.concatenate([x[:, MOMENTUM] @ prior.axes.T, x[:, : prior.states] @ prior.rows.T], 1)


def states_in(channel: Channel, prior: LoadPrior, pieces: Pieces, engine: Engine) -> Array:
    """The chain (time, state) of a load in pieces, as a channel shows it."""
    tried = replace(prior, tuned=replace(prior.tuned, pieces=pieces))
    return engine.smooth_states(channel_model(channel, tried), channel.moved)


def with_edges_known(
    state: FlightState, spread: Mapping[str, Spread], seen: Mapping[str, Flags], given: Array
) -> FlightState:
    """A state whose loads are, near their edges, the mean over the places of these, and claimed as that.

    spread: by name, at the samples of the flight; seen (time,), by name: samples that the channel of a load
    has; given (time, 6): momentum by the loads.
    """
    force, moment, cov = state.force.copy(), state.moment.copy(), state.wrench_cov.copy()
    for name, load, own in (("force", force, slice(0, 3)), ("moment", moment, slice(3, 6))):
        if name in spread:
            at = seen[name]
            load[at] += spread[name].mean[at, 3:]
            cov[at, own, own] += spread[name].cov[at]
    return replace(state, force=force, moment=moment, wrench_cov=cov, given=given)
