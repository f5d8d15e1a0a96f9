"""What a load is near its edges: the mean over all places that an edge may have, and claimed as their spread.

The place of an edge is known as well as the likelihood of the channel tells it from others. Each place has a
load of its own, before it, behind it and at some distance from it. Near an edge loads are means over the
cells of samples. Source: the law of total variance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss

from forceid.estimation.loads.pieces.cells import OPEN, Cells, cells_beside, motion_in, step_of
from forceid.estimation.loads.pieces.evidence import Evidence, hiding, of_any_size, settled
from forceid.flight.channels import Channel
from forceid.flight.pieces import Pieces
from forceid.flight.priors.protocol import LoadPrior
from forceid.flight.smoother import FlightState
from forceid.kalman.engines import Engine
from forceid.records import Array, Flags
from forceid.significance import CHANCE, PATIENCE, SIGMAS

HASTES = np.exp([1.5, 3.0, 4.5])  # rates of a load between two edges over that of the record
REACHES = 2.0 ** np.arange(-3, 5)  # standard deviations, were it a parabola, up to which a place is tried
IMPACT = 0.1  # steps: so short, its share of a cell is known to a tenth from its place
AMONG, AMONG_SHARES = 0.5 + 0.5 * leggauss(5)[0], 0.5 * leggauss(5)[1]  # of a way: exact to x^9
TINY = np.finfo(float).tiny
BENT = 1 / 32  # of a step: over which the likelihood is differenced, far less than a place is open


@dataclass(frozen=True)
class Spread:
    """What the places of edges that are as likely add to momentum and load of a channel (time, 6), by frame.

    apart (alternative, time, 6): deviations of momentum and load, each weighed by the root of its share;
    hidden (time, 3, 3): variance of what loads in pieces may be beside that. near (time,): samples whose load
    is the mean over a cell, own (time, 3, 3) its covariance where edges and sizes are known. at (time, 3):
    the load of the channel at the instant of a sample, of a piece that has a share (time,) of its cell.
    """

    mean: Array
    apart: Array
    hidden: Array
    near: Flags
    own: Array
    at: Array
    share: Array

    def of_cells(self, load: Array) -> Array:
        """A load (time, 3) at instants, with its edges in all places, as means over cells near them.

        What it has beside that of the channel, which leaves out turns within a step, it has in its piece.
        """
        return np.asarray(self.at + self.mean[:, 3:] + self.share[:, None] * (load - self.at))

    def beside(self, cov: Array) -> Array:
        """Covariance (time, 3, 3) of the load of which `cov` is that where its edges are known."""
        load, known = self.apart[:, :, 3:], np.where(self.near[:, None, None], self.own, cov)
        return np.asarray(known + np.einsum("kta,ktb->tab", load, load) + self.hidden)

    def of_change(self, first: int, last: int) -> Array:
        """What is added to the covariance (3, 3) of the change of momentum between two samples."""
        change = self.apart[:, last, :3] - self.apart[:, first, :3]
        return np.asarray(change.T @ change)


def spread_of(channel: Channel, prior: LoadPrior, time: Array, engine: Engine) -> Spread | None:
    """What is open of the places of the edges of a load, None where it has none.

    time (time,) s: of the frames, those that the channel shows and others. Along each direction in which the
    likelihood of all places bends by itself: those of a short piece are open together, for it gives as much
    in less time.
    """
    pieces = prior.tuned.pieces
    if pieces is None or not len(pieces.edges):
        return None
    evidence = Evidence(channel, prior, engine, pieces.edges)
    kinds = [[pieces]]
    found = motion_in(cells_beside(channel, (), time), prior, pieces, engine)
    if len(pieces.edges) > 1:  # what is between two edges may change more and faster than the record tells
        wide = as_large_as_it_is(time, found[:, 3:] @ prior.axes, prior, pieces)
        for factor in HASTES:
            haste = pieces.haste.copy()
            haste[1:-1] *= factor
            kinds[0] += [settled(evidence, replace(one, haste=haste)) for one in (pieces, wide)]
    impacts = impacts_in(evidence, pieces)
    # at samples beside edges the mean over their cells: so all samples give together what the load gives
    beside = [*pieces.edges[:, None], *(pieces.edges[k : k + 2] for k in impacts)]
    cells = cells_beside(channel, [(one[0], one[-1]) for one in beside], time)
    kinds += [list(impacts.values())] if impacts else []
    each = [[places_of(evidence, one) for one in kind] for kind in kinds]
    # by the volume of places one of a kind is likelier than another, and a kind by what it is at its best
    likely = [np.array([one.volume for one in kind]) for kind in each]
    best = [float(evidence.likelihood(kind).sum(1).max()) for kind in kinds]
    likely = [value - value.max() + most - max(best) for value, most in zip(likely, best, strict=True)]
    # those that the record does not tell apart from the best count alike in what is claimed
    open_ = [
        (*motion_over(cells, prior, one, engine), float(np.exp(much)), len(each) * (value > -PATIENCE).sum())
        for kind, value in zip(each, likely, strict=True)
        for one, much in zip(kind, value, strict=True)
        if much > -PATIENCE
    ]
    weight = np.array([much for *_, much, _ in open_])
    mean = np.einsum("k,kta->ta", weight / weight.sum(), [one for one, *_ in open_])
    apart = [np.concatenate([(one - mean)[None], away]) / np.sqrt(count) for one, away, _, count in open_]
    near = np.isin(np.arange(len(mean)), cells.sample)
    own, hidden = hiding(evidence, cells, pieces)
    # between samples that the channel shows, as of tracks low-passed before, any frame may have had it all
    between = step_of(channel) / float(np.median(np.diff(time))) - 1
    hidden[near] += between * mean[near, 3:, None] * mean[near, None, 3:]
    share = np.where(near, share_of_cells(time, pieces.edges), 1.0)
    return Spread(mean - found, np.concatenate(apart), hidden, near, own, found[:, 3:], share)


def share_of_cells(time: Array, edges: Array) -> Array:
    """Share (time,) that the piece at each sample has of its cell, by edges (edge,) s.

    >>> share_of_cells(np.arange(4.0), np.array([0.9, 1.2])).round(3).tolist()
    [1.0, 0.3, 1.0, 1.0]
    """
    middle = np.concatenate([time[:1], 0.5 * (time[1:] + time[:-1]), time[-1:]])
    bounds, piece = np.concatenate([time[:1], edges, time[-1:]]), np.searchsorted(edges, time, "right")
    inside = np.minimum(bounds[piece + 1], middle[1:]) - np.maximum(bounds[piece], middle[:-1])
    return np.asarray(inside / np.diff(middle))


def as_large_as_it_is(time: Array, load: Array, prior: LoadPrior, pieces: Pieces) -> Pieces:
    """Pieces between two edges whose load (time, axis) may vary about its mean by as much as it is."""
    size = pieces.size.copy()
    for k, (begin, end) in enumerate(pairwise(pieces.edges), 1):
        inside = slice(*np.searchsorted(time, (begin, end)))
        level = np.sqrt((load[inside] ** 2).mean(0)) if load[inside].size else 0.0
        size[k] = np.maximum(size[k], level / np.maximum(prior.kernel.std, TINY))
    return replace(pieces, size=size)


def impacts_in(evidence: Evidence, pieces: Pieces) -> dict[int, Pieces]:
    """By its first edge, each piece between two as an impact that gives as much, where it may be one.

    An impact in a tenth of a step, where it is likeliest; one that is as long already is one.
    """
    time, step = evidence.channel.time, step_of(evidence.channel)
    found, level = {}, evidence.likelihood([pieces]).sum()
    for k, (begin, end) in enumerate(pairwise(pieces.edges)):
        short = min(IMPACT * step, end - begin)
        edges, size, haste = pieces.edges.copy(), pieces.size.copy(), pieces.haste.copy()
        edges[k : k + 2] = 0.5 * (begin + end) + short * np.array([-0.5, 0.5])
        size[k + 1] *= (end - begin) / short
        haste[k + 1] = 1.0
        impact = of_any_size(evidence, Pieces(edges, size, haste), k + 1)
        own = np.isin(range(len(edges)), (k, k + 1))
        for reach in ((end - begin) / 4, step / 4, step / 16):
            tried = [
                one for n in range(-3, 4) if (one := shifted_by(time, impact, np.asarray(n * reach * own)))
            ]
            likely = evidence.likelihood(tried).sum(1)
            impact, best = tried[int(likely.argmax())], likely.max()
        if best > level - PATIENCE:
            found[k] = impact
    return found


@dataclass(frozen=True)
class Places:
    """Pieces with their edges in all places, one direction after another: (share, pieces) of each place.

    volume: how likely they are, as a log-likelihood, over the volume of the places.
    """

    pieces: Pieces
    tried: list[list[tuple[float, Pieces]]]
    volume: float


def places_of(evidence: Evidence, pieces: Pieces) -> Places:
    """All places that the edges of pieces may have."""
    volume = level = float(evidence.likelihood([pieces]).sum())
    found = []
    for direction in directions(evidence, pieces):
        first, last = as_far_as_likely(evidence, pieces, direction, level)
        tried = [moved_by(pieces, far * direction) for far in first + (last - first) * AMONG]
        likely = evidence.likelihood(tried).sum(1) - level
        share = AMONG_SHARES * np.exp(likely - likely.max())
        wide = (last - first) * float(np.linalg.norm(direction))
        volume += float(likely.max() + np.log(share.sum() * wide + TINY))
        found.append(list(zip((share / share.sum()).tolist(), tried, strict=True)))
    return Places(pieces, found, volume)


def motion_over(cells: Cells, prior: LoadPrior, places: Places, engine: Engine) -> tuple[Array, Array]:
    """Momentum and load (time, 6), mean over all places of edges, and how far apart these are.

    How far: (place, time, 6), each weighed by the root of its share.
    """
    found = motion_in(cells, prior, places.pieces, engine)
    total, away = found.copy(), [np.zeros((0, *found.shape))]
    for tried in places.tried:
        share = np.array([part for part, _ in tried])
        apart = np.array([motion_in(cells, prior, one, engine) - found for _, one in tried])
        mean = np.einsum("k,kta->ta", share, apart)
        total += mean
        away.append(np.sqrt(share)[:, None, None] * (apart - mean))
    return total, np.concatenate(away)


def directions(evidence: Evidence, pieces: Pieces) -> Array:
    """Errors (direction, edge) s of places, of one standard deviation each, that know nothing of each other.

    By second differences of the likelihood; a step at least a hundredth, and no more than a few.
    """
    time, count, step = evidence.channel.time, len(pieces.edges), step_of(evidence.channel)
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
    std = 1 / np.sqrt(np.clip(curved, (OPEN * step) ** -2, (CHANCE * step) ** -2))
    return np.asarray(std[:, None] * axes.T)


def as_far_as_likely(
    evidence: Evidence, pieces: Pieces, direction: Array, level: float
) -> tuple[float, float]:
    """How far back and ahead along a direction (edge,) s edges may lie; level: the likelihood of pieces.

    The likelihood bends elsewhere than here: a piece within a step may well be longer, but for some steps.
    """
    time, ends = evidence.channel.time, [0.0, 0.0]
    most = OPEN * step_of(evidence.channel) / float(np.abs(direction).max())
    for side, sign in enumerate((-1.0, 1.0)):
        far = [s for s in sign * REACHES if abs(s) <= most and shifted_by(time, pieces, s * direction)]
        if far:
            lost = level - evidence.likelihood([moved_by(pieces, s * direction) for s in far]).sum(1)
            ends[side] = far[min(int(np.cumprod(lost < 0.5 * SIGMAS**2).sum()), len(far) - 1)]
    return ends[0], ends[1]


def shifted_by(time: Array, pieces: Pieces, move: Array) -> Pieces | None:
    """The pieces with their edges moved (edge,) s; None where they would pass each other."""
    shifted = moved_by(pieces, move)
    inside = np.concatenate([time[:1], shifted.edges, time[-1:]])
    return shifted if (np.diff(inside) > 0).all() else None


def moved_by(pieces: Pieces, move: Array) -> Pieces:
    """The pieces with their edges moved (edge,) s."""
    return replace(pieces, edges=pieces.edges + move)


def with_edges_known(state: FlightState, spread: Mapping[str, Spread], given: Array) -> FlightState:
    """A state whose loads are, near their edges, the mean over the places of these, and claimed as that.

    spread: by name; given (time, 6): momentum by the loads.
    """
    force, moment, cov = state.force.copy(), state.moment.copy(), state.wrench_cov.copy()
    for name, load, own in (("force", force, slice(0, 3)), ("moment", moment, slice(3, 6))):
        if name in spread:
            load[:] = spread[name].of_cells(load)
            cov[:, own, own] = spread[name].beside(cov[:, own, own])
            cov[spread[name].near, :3, 3:] = cov[spread[name].near, 3:, :3] = 0.0
    return replace(state, force=force, moment=moment, wrench_cov=cov, given=given)
