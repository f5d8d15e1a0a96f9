"""How likely a load in pieces is, edges and sizes that make it likelier, and what may hide in a piece.

The likeliest size of a load that a piece hardly shows is next to nothing, and a claim made of it says that
nothing acts there. The record excludes only sizes by which its likelihood falls; up to the one by which it
falls by a standard error, the load may be as large. Source: profile likelihood, with its limit of one half.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from forceid.estimation.loads.pieces.cells import Cells, load_in
from forceid.flight.channels import Channel, load_chain, model_in_pieces
from forceid.flight.pieces import Pieces
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import LoadPrior
from forceid.kalman.building.lines import along_axes
from forceid.kalman.building.process import Process, matern
from forceid.kalman.engines import Engine, for_tuning
from forceid.kalman.model import StateSpace
from forceid.records import Array
from forceid.rounding import ITERATIONS
from forceid.significance import NUMBER, OUTLIER

PIECE_SIZES = np.exp([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])  # factors on size or rate, in one step of a search
AT_A_TIME = 128  # tries whose models are held at once: those of a record of 1000 samples take 10 MB
FIRST_REACH, LAST_REACH = 8, 8  # steps by which an edge moves at first, and parts of one at last
MOST_HASTE = 100.0  # rate in a piece over the least of the record: two orders of magnitude, as sizes
LARGER = np.exp(0.5 * np.arange(1, 25))  # factors on a size, two in an e-fold: up to five decades
STANDARD_ERROR = 0.5  # log-likelihood that a size one standard error off its likeliest loses


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
        given = set(self.given.tolist())
        return (
            sum(edge not in given for edge in pieces.edges.tolist()) * self.place + len(pieces.edges) * NUMBER
        )

    def by_axis(self, tried: Sequence[Pieces]) -> Array:
        """Log-likelihood (try, axis), less a third of the cost each, of all at once."""
        cost = np.array([self.cost(one) for one in tried])
        return self.likelihood(tried) - cost[:, None] / 3

    def likelihood(self, tried: Sequence[Pieces]) -> Array:
        """Log-likelihood (try, axis) of all at once."""
        z = (self.channel.moved @ self.prior.axes)[:, :, None]
        found = [
            for_tuning(self.engine)
            .log_likelihood(self.model(some), np.tile(z, (1, len(some), 1)), OUTLIER)
            .reshape(len(some), 3)
            for some in (tried[k : k + AT_A_TIME] for k in range(0, len(tried), AT_A_TIME))
        ]
        return np.nan_to_num(np.concatenate(found), nan=-np.inf, neginf=-np.inf)

    @cached_property
    def model(self) -> Callable[[Sequence[Pieces]], StateSpace]:
        """The model of the channel along each axis, in each of some pieces."""
        ch, prior = self.channel, self.prior
        kernel, axes, noise = prior.kernel, prior.axes, prior.tuned.noise**2
        assert isinstance(kernel, Matern)
        drift = np.einsum("ai,ab,bi->i", axes, ch.drift, axes)
        lines = along_axes(line.along(axes) for line in prior.lines)

        def chain(haste: float) -> Process:
            return load_chain(matern(kernel.order, kernel.std, haste * kernel.rate), prior.start, lines)

        seen = ch.gain, ch.var(axes) * noise, drift * noise, ch.time, kernel.order
        return model_in_pieces(chain, *seen, ch.color)

    def of(self, pieces: Pieces) -> float:
        """Log-likelihood less cost."""
        return float(self.by_axis([pieces]).sum())


def longest(time: Array, pieces: Pieces) -> int:
    """The piece that lasts longest: the load is of its size, and as much larger or smaller in others."""
    return int(np.diff(pieces.edges, prepend=time[0], append=time[-1]).argmax())


def best_of(evidence: Evidence, *groups: Sequence[Pieces]) -> tuple[float, Pieces]:
    """Of groups of pieces with the same edges, the likeliest, sized as is likeliest on each axis.

    And how likely they are. The first of a group are as they were: another size has to gain a number.
    """
    each = evidence.by_axis([one for group in groups for one in group])
    found = []
    for tried in groups:
        likely, each = each[: len(tried)], each[len(tried) :]
        likely = likely - NUMBER * (np.arange(len(tried)) > 0)[:, None]
        size = np.stack([tried[k].size[:, axis] for axis, k in enumerate(likely.argmax(0))], 1)
        found.append((float(likely.max(0).sum()), replace(tried[0], size=size)))
    return max(found, key=lambda one: one[0])


def moved(evidence: Evidence, pieces: Pieces) -> Pieces:
    """Pieces after edges have moved and gone, and sizes changed, as long as that is likelier.

    Edges move by less and less, down to a part of a step.
    """
    time = evidence.channel.time
    step, value = float(np.median(np.diff(time))), evidence.of(pieces)
    reach = FIRST_REACH * step
    for _ in range(ITERATIONS):
        before = value
        for k in range(len(pieces.size)):
            at = np.arange(len(pieces.size))[:, None] == k
            sizes = [replace(pieces, size=np.where(at, f * pieces.size, pieces.size)) for f in PIECE_SIZES]
            value, pieces = max((value, pieces), best_of(evidence, [pieces, *sizes]), key=lambda one: one[0])
        for tries in (hastened, fewer, shifted):
            for k in range(len(pieces.size)):
                if k < len(pieces.edges) + (tries is hastened) and (tried := tries(time, reach, pieces, k)):
                    likely = evidence.by_axis(tried).sum(1)
                    if likely.max() > value:
                        value, pieces = float(likely.max()), tried[int(likely.argmax())]
        if not value > before + NUMBER:
            if reach < step / LAST_REACH or not len(pieces.edges):
                break
            reach /= 4
    return pieces


def settled(evidence: Evidence, pieces: Pieces) -> Pieces:
    """The pieces with their edges where they are likeliest, as many and as large as they are."""
    time = evidence.channel.time
    step, value = float(np.median(np.diff(time))), float(evidence.likelihood([pieces]).sum())
    for reach in (step, step / 4, step / 16):
        for k in np.tile(np.arange(len(pieces.edges)), 2):
            if tried := shifted(time, reach, pieces, k):
                likely = evidence.likelihood(tried).sum(1)
                if likely.max() > value:
                    value, pieces = float(likely.max()), tried[int(likely.argmax())]
    return pieces


def hastened(_: Array, __: float, pieces: Pieces, k: int) -> list[Pieces]:
    """The pieces with one in which the load changes faster or slower."""
    at = np.arange(len(pieces.haste)) == k
    factors = [one for one in PIECE_SIZES if 1 <= one * pieces.haste[k] <= MOST_HASTE]
    return [replace(pieces, haste=np.where(at, one * pieces.haste, pieces.haste)) for one in factors]


def fewer(time: Array, reach: float, pieces: Pieces, k: int) -> list[Pieces]:
    """The pieces without an edge, its neighbor in its place or moved; what is before or behind it goes on."""
    edges = np.delete(pieces.edges, k)
    tried = [edges]
    if k < len(edges):
        bounds = np.concatenate([time[:1], np.delete(edges, k), time[-1:]])
        places = np.linspace(pieces.edges[k] - reach, edges[k] + reach, 2 * FIRST_REACH + 1)
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


def of_any_size(evidence: Evidence, pieces: Pieces, k: int) -> Pieces:
    """The pieces, the load in one of them of the likeliest size on each axis, larger if it has to be."""
    at = np.arange(len(pieces.size))[:, None] == k
    tried = [replace(pieces, size=np.where(at, f * pieces.size, pieces.size)) for f in (1.0, *LARGER)]
    likely = evidence.likelihood(tried).argmax(0)
    return replace(pieces, size=np.stack([tried[f].size[:, axis] for axis, f in enumerate(likely)], 1))


def as_large_as_may_be(evidence: Evidence, pieces: Pieces) -> Pieces:
    """The pieces, the load in each of the largest size on each axis that loses less than a standard error."""
    own = np.eye(len(pieces.size))[:, :, None]
    tried = [replace(pieces, size=np.where(k, f * pieces.size, pieces.size)) for k in own for f in LARGER]
    lost = evidence.likelihood([pieces]) - evidence.likelihood(tried)
    open_ = lost.reshape(len(own), len(LARGER), -1) < STANDARD_ERROR
    return replace(pieces, size=pieces.size * np.where(open_, LARGER[:, None], 1.0).max(1))


def hiding(evidence: Evidence, cells: Cells, pieces: Pieces) -> tuple[Array, Array]:
    """Covariance (time, 3, 3) of a load in pieces, and what loads as large as they may be add to it."""
    axes, known = evidence.prior.axes, (cells, evidence.prior)
    load, cov = load_in(*known, pieces, evidence.engine)
    largest, wide = load_in(*known, as_large_as_may_be(evidence, pieces), evidence.engine)
    apart, wider = largest - load, np.einsum("ai,tab,bi->ti", axes, wide - cov, axes)
    more = axes * np.maximum(wider, 0.0)[:, None] @ axes.T
    return cov, np.asarray(more + apart[:, :, None] * apart[:, None])
