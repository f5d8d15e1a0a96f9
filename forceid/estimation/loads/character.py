"""Edges at which a load changes its character, found by evidence: steps, impacts, a contact between flights.

Where one prior has to drive a load much harder in some stretch than elsewhere, the load is of another
character there. That stretch is where the search begins; each edge then moves, or goes, as the exact
likelihood of the channel says, and stays where it gains more than its place among all samples costs. Source:
principal equations 4e.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from forceid.flight.channels import CHANNEL_SAMPLES, Channel, driven_in_pieces, load_chain
from forceid.flight.pieces import WHOLE, Pieces
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import KERNEL, LoadPrior, channel_model
from forceid.kalman.building.process import Process, matern
from forceid.kalman.engines import Engine, for_tuning
from forceid.records import Array, Indices
from forceid.rounding import ITERATIONS
from forceid.significance import NUMBER, OUTLIER, PATIENCE

SIZES = np.exp([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])  # factors that the size of a piece may take in one step
COARSE_SIZES = np.exp([1.5, 3.0])  # of a load between edges over that around them, at first
AT_A_TIME = 32  # tries whose models are held at once
ROUNDS = 2  # of edges that move one after the other, at each reach
GRID = 8  # parts of a stretch and half of it to either side, between which an edge is tried at first
FARTHEST, FINEST = 8, 8  # steps by which an edge moves at first, and parts of one at last
LEAST_HASTE = np.exp(-4.5)  # of rates in one record, the least over the largest: two orders of magnitude
IMPOSSIBLE = -1e300  # log-likelihood where numbers lose their sign
FEWEST = 16  # samples below which no character shows

Tune = Callable[..., LoadPrior]


@dataclass(frozen=True)
class Evidence:
    """How likely a channel is under a prior whose load comes in pieces.

    place: log-likelihood that the place of an edge costs; given (edge,) s: edges that cost no place.
    """

    channel: Channel
    prior: LoadPrior
    engine: Engine
    given: Array

    @property
    def place(self) -> float:
        """What the place of an edge among all samples costs."""
        return float(np.log(len(self.channel.time)))

    def cost(self, pieces: Pieces) -> float:
        """Log-likelihood that edges have to gain: their places, and a number each for the sizes."""
        return float((~np.isin(pieces.edges, self.given)).sum() * self.place + len(pieces.edges) * NUMBER)

    def by_axis(self, tried: Sequence[Pieces]) -> Array:
        """Log-likelihood (try, axis), less a third of the cost each, of all at once."""
        cost = np.array([self.cost(one) for one in tried])
        return self.likelihood(tried) - cost[:, None] / 3

    def likelihood(self, tried: Sequence[Pieces]) -> Array:
        """Log-likelihood (try, axis) of all at once."""
        ch, prior = self.channel, self.prior
        kernel, axes, noise = prior.kernel, prior.axes, prior.tuned.noise**2
        assert isinstance(kernel, Matern)
        drift = np.einsum("ai,ab,bi->i", axes, ch.drift, axes)
        lines = [line.scaled(np.abs(line.direction)) for line in (line.along(axes) for line in prior.lines)]

        def chain(haste: float) -> Process:
            return load_chain(matern(kernel.order, kernel.std, haste * kernel.rate), prior.start, lines)

        seen = ch.gain, ch.var(axes) * noise, drift * noise, ch.time
        z = (ch.moved @ axes)[:, :, None]
        found = [
            for_tuning(self.engine)
            .log_likelihood(
                driven_in_pieces(chain, *seen, kernel.order, some, ch.color),
                np.tile(z, (1, len(some), 1)),
                OUTLIER,
            )
            .reshape(len(some), 3)
            for some in batched(tried)
        ]
        return np.nan_to_num(np.concatenate(found), nan=IMPOSSIBLE)

    def of(self, pieces: Pieces) -> float:
        """Log-likelihood less cost."""
        return float(self.by_axis([pieces]).sum())


def with_character(
    channel: Channel, prior: LoadPrior, engine: Engine, tune: Tune, given: Array | None = None
) -> LoadPrior:
    """The prior of the load on a channel, in pieces where these are likelier by more than their edges cost.

    prior: of one character, as tuned on it; tune: a prior for given pieces; given (edge,) s: edges that
    another load of the body has, which cost no place.
    """
    time, free = channel.time, np.zeros(0) if given is None else given
    if not FEWEST <= len(time) <= CHANNEL_SAMPLES or not isinstance(prior.kernel, Matern):
        return prior
    pieces = WHOLE if prior.tuned.pieces is None else prior.tuned.pieces
    level = prior.tuned.log_likelihood - Evidence(channel, prior, engine, free).cost(pieces)
    for _ in range(ITERATIONS):
        evidence = Evidence(channel, prior, engine, free)
        found = added(evidence, pieces)
        if found is None:
            break
        near = prior
        for _ in range(2):  # what moves under one prior is tuned, and moves again
            loud = near.with_kernel(near.kernel.scaled(found.size.max(0)))
            near = tune(pieces=normal(found), near=loud)
            found = moved(replace(evidence, prior=near), normal(found))
        if not near.tuned.log_likelihood - evidence.cost(found) > level:
            break
        other = tune(pieces=normal(found))
        value = other.tuned.log_likelihood - evidence.cost(found)
        if not value > level + PATIENCE:
            break
        prior, pieces, level = other, normal(found), value
    return prior


def batched(tried: Sequence[Pieces]) -> list[Sequence[Pieces]]:
    """A few of what is tried at a time."""
    return [tried[k : k + AT_A_TIME] for k in range(0, len(tried), AT_A_TIME)]


def normal(pieces: Pieces) -> Pieces:
    """The same with sizes of one at most."""
    return replace(pieces, size=pieces.size / pieces.size.max(0))


def added(evidence: Evidence, pieces: Pieces) -> Pieces | None:
    """The pieces with an edge or two more, where a stretch is driven the hardest; None where none is."""
    time, tried = evidence.channel.time, []
    for first, last in uneven(driving(evidence)):
        reach = (last - first) // 2
        at = np.unique(np.linspace(first - reach, last + reach, GRID + 1).astype(int))
        at = at[(at > 0) & (at < len(time) - 1)]
        tried += [time[[one]] for one in at]
        tried += [time[[one, other]] for i, one in enumerate(at) for other in at[i + 1 :]]
    if len(evidence.given):
        tried.append(evidence.given)
    wider = [pieces.cut(edges) for edges in tried]
    found = [
        best_of(evidence, sized_anew(more, edges))
        for more, edges in zip(wider, tried, strict=True)
        if len(more.edges) > len(pieces.edges)
    ]
    likely, best = max(found, key=lambda one: one[0], default=(-np.inf, pieces))
    return best if likely > IMPOSSIBLE else None


def sized_anew(pieces: Pieces, edges: Array) -> list[Pieces]:
    """The pieces with other sizes between edges, the first and the last of them, or all around."""
    starts = np.concatenate([[-np.inf], pieces.edges])
    inside = (starts >= edges[0]) & ((starts < edges[-1]) | (len(edges) == 1))
    louder = [np.where(inside[:, None], factor, 1.0) for factor in COARSE_SIZES]
    quieter = [np.where(inside[:, None], 1.0, 1 / factor) for factor in COARSE_SIZES]
    return [pieces, *(replace(pieces, size=factor * pieces.size) for factor in (*louder, *quieter))]


def best_of(evidence: Evidence, tried: Sequence[Pieces]) -> tuple[float, Pieces]:
    """Of pieces with the same edges, the sizes likeliest on each axis, and how likely they are.

    The first are as they were: another size has to gain a number.
    """
    likely = evidence.by_axis(tried) - NUMBER * (np.arange(len(tried)) > 0)[:, None]
    size = np.stack([tried[k].size[:, axis] for axis, k in enumerate(likely.argmax(0))], 1)
    return float(likely.max(0).sum()), replace(tried[0], size=size)


def driving(evidence: Evidence) -> Array:
    """What drives the load over each step (step, axis), as smoothed, in units of what the prior expects."""
    ch, prior = evidence.channel, evidence.prior
    x = evidence.engine.smooth_states(channel_model(ch, prior), ch.moved)[:, : prior.states]
    order = prior.kernel.order
    last = slice(KERNEL + 3 * (order - 1), KERNEL + 3 * order)
    F, Q, _ = prior.chain(np.diff(ch.time), None, ch.time[0])
    w = x[1:, last] - np.einsum("tij,tj->ti", F[:, last], x[:-1])
    return np.asarray(w / np.sqrt(np.diagonal(Q[:, last, last], axis1=1, axis2=2)))


def uneven(w: Array) -> list[tuple[int, int]]:
    """First and last step of the stretch that drives each axis of w (step, axis) the hardest, if one does.

    By the ratio of likelihoods of one size and two, over stretches of half the record and less; steps that
    know of each other count as one.
    """
    found, steps = [], len(w)
    for one in w.T:
        if not one.any():
            continue
        follows = np.fft.irfft(np.abs(np.fft.rfft(one, 2 * steps)) ** 2)[:steps]
        each = 1 / (2 * float(((follows / follows[0]) ** 2).sum()) - 1)  # numbers a step
        energy = one**2 / np.mean(one**2)
        total, best, length = np.concatenate([[0.0], np.cumsum(energy)]), (PATIENCE / 2, 0, 0), steps // 2
        while length >= 2:
            first = np.arange(0, steps - length + 1, max(length // 2, 1))
            inside = total[first + length] - total[first]
            gain = unlikely(each * inside, each * length)
            gain += unlikely(each * (total[-1] - inside), each * (steps - length))
            if gain.max() > best[0]:
                at = int(first[gain.argmax()])
                best = (float(gain.max()), at, at + length)
            length //= 2
        if best[2]:
            found.append(best[1:])
    return found


def unlikely(energy: Array, numbers: float) -> Array:
    """Log-likelihood that a stretch gains which has a size of its own, by the energy of so many numbers.

    One more of energy one: no stretch is known to be still.
    """
    return np.asarray(-0.5 * (numbers + 1) * np.log((energy + 1) / (numbers + 1)))


def moved(evidence: Evidence, pieces: Pieces) -> Pieces:
    """Pieces after edges have moved and gone, and sizes changed, as long as that is likelier.

    Edges move by less and less, down to a part of a step.
    """
    time = evidence.channel.time
    step, value = float(np.median(np.diff(time))), evidence.of(pieces)
    reach = FARTHEST * step
    for _ in range(ITERATIONS):
        before = value
        for k in range(len(pieces.size)):
            at = np.arange(len(pieces.size))[:, None] == k
            sizes = [replace(pieces, size=np.where(at, f * pieces.size, pieces.size)) for f in SIZES]
            value, pieces = max((value, pieces), best_of(evidence, [pieces, *sizes]), key=lambda one: one[0])
        for tries in (hastened, fewer, shifted):
            for k in range(len(pieces.size)):
                if k < len(pieces.edges) + (tries is hastened) and (tried := tries(time, reach, pieces, k)):
                    likely = evidence.by_axis(tried).sum(1)
                    if likely.max() > value:
                        value, pieces = float(likely.max()), tried[int(likely.argmax())]
        if not value > before + NUMBER:
            if reach < step / FINEST or not len(pieces.edges):
                break
            reach /= 4
    return pieces


def settled(evidence: Evidence, pieces: Pieces) -> Pieces:
    """The pieces with their edges where they are likeliest, as many and as large as they are."""
    time = evidence.channel.time
    step, value = float(np.median(np.diff(time))), float(evidence.likelihood([pieces]).sum())
    for reach in (step, step / 4, step / 16):
        for k in np.tile(np.arange(len(pieces.edges)), ROUNDS):
            if tried := shifted(time, reach, pieces, k):
                likely = evidence.likelihood(tried).sum(1)
                if likely.max() > value:
                    value, pieces = float(likely.max()), tried[int(likely.argmax())]
    return pieces


def hastened(_: Array, __: float, pieces: Pieces, k: int) -> list[Pieces]:
    """The pieces with one in which the load changes faster or slower."""
    at = np.arange(len(pieces.haste)) == k
    tried = np.array([factor for factor in SIZES if 1 <= factor * pieces.haste[k] <= 1 / LEAST_HASTE])
    return [replace(pieces, haste=np.where(at, factor * pieces.haste, pieces.haste)) for factor in tried]


def fewer(time: Array, reach: float, pieces: Pieces, k: int) -> list[Pieces]:
    """The pieces without an edge, its neighbor in its place or moved; what is before or behind it goes on."""
    edges = np.delete(pieces.edges, k)
    tried = [edges]
    if k < len(edges):
        bounds = np.concatenate([time[:1], np.delete(edges, k), time[-1:]])
        places = np.linspace(pieces.edges[k] - reach, edges[k] + reach, 2 * GRID + 1)
        tried += [np.sort([*np.delete(edges, k), one]) for one in places if bounds[k] < one < bounds[k + 1]]
    left = [(np.delete(pieces.size, k + side, 0), np.delete(pieces.haste, k + side)) for side in (0, 1)]
    return [Pieces(one, *kept) for one in tried for kept in left]


def shifted(time: Array, reach: float, pieces: Pieces, k: int) -> list[Pieces]:
    """The pieces with an edge moved by up to three times `reach` s, no further than its neighbors."""
    bounds = np.concatenate([time[:1], pieces.edges, time[-1:]])
    new = pieces.edges[k] + reach * np.array([-3, -2, -1, 1, 2, 3])
    others = np.delete(pieces.edges, k)
    new = new[(new > bounds[k]) & (new < bounds[k + 2])]
    return [replace(pieces, edges=np.sort([*others, one])) for one in new]
