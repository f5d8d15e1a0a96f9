"""Loads that change character: pieces of a record between edges, in each of which a load is drawn anew.

A step, an impact, a foot on the ground between two flights: no stationary prior has them. Between two edges
a load is stationary, of a size and a rate of its own; at an edge it forgets what it was, its mean as well.
An impact shorter than the samples is a piece of part of a step. Source: principal equations 4e, with a
covariance that depends on time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from forceid.records import Array, Flags, Indices

CLOCK = 1e-9  # s: clocks are no finer, so that an edge as near to a sample as that lies at it


@dataclass(frozen=True)
class Split:
    """Steps of a clock, cut at edges: step (part,) s, the step of the clock it is of, and its piece.

    begin (record,): the part that each record begins with, where more than one are in a row.
    """

    step: Array
    owner: Indices
    piece: Indices
    begin: Indices


@dataclass(frozen=True)
class Pieces:
    """Edges (edge,) s, at which a load becomes another one, and what it is in each piece.

    size (edge + 1, axis), haste (edge + 1,): factors on the standard deviation of the load about its mean,
    and on the rate at which it forgets itself.
    """

    edges: Array
    size: Array
    haste: Array

    def of(self, axes: Indices) -> Pieces:
        """The pieces of some axes."""
        return replace(self, size=self.size[:, axes])

    def split(self, step: Array, begin: float) -> Split:
        """Steps (step,) s of a clock that begins at `begin`, cut at the edges.

        >>> WHOLE.cut(np.array([0.75])).split(np.array([0.5, 0.5]), 0.0).step.tolist()
        [0.5, 0.25, 0.25]
        """
        ticks = begin + np.concatenate([[0.0], np.cumsum(step)])
        edges = self.edges[(self.edges > begin) & (self.edges < ticks[-1])]
        apart = np.abs(ticks[np.searchsorted(0.5 * (ticks[1:] + ticks[:-1]), edges)] - edges) > CLOCK
        parts = np.sort(np.concatenate([ticks, edges[apart]]))
        middle = 0.5 * (parts[1:] + parts[:-1])
        owner = np.searchsorted(ticks, middle) - 1
        return Split(np.diff(parts), owner, np.searchsorted(self.edges, middle), np.zeros(1, int))

    def cut(self, more: Array) -> Pieces:
        """The pieces with more edges (edge,) s, on both sides of which the load is of one size."""
        edges = np.union1d(self.edges, more)
        was = np.searchsorted(self.edges, np.concatenate([[-np.inf], edges]), side="right")
        return Pieces(edges, self.size[was], self.haste[was])


WHOLE = Pieces(np.zeros(0), np.ones((1, 3)), np.ones(1))  # a load of one character


def split_in_a_row(tried: Sequence[Pieces], step: Array, begin: float) -> Split:
    """Steps (step,) s of one clock, cut by each of the pieces tried, in a row; and their pieces."""
    cuts = [pieces.split(step, begin) for pieces in tried]
    parts, pieces = (
        np.cumsum([0, *counts[:-1]]) for counts in ([len(c.step) for c in cuts], [len(t.size) for t in tried])
    )
    owner = [cut.owner + k * len(step) for k, cut in enumerate(cuts)]
    piece = [cut.piece + before for cut, before in zip(cuts, pieces, strict=True)]
    return Split(np.concatenate([c.step for c in cuts]), np.concatenate(owner), np.concatenate(piece), parts)


def drawn(
    tables: tuple[Array, Array, Array, Array],
    size: Array,
    states: tuple[Flags, Flags],
    cut: Split,
    length: Indices,
    haste: Indices,
) -> tuple[Array, Array, Indices, Array]:
    """F, Q (kind, ..., state, state) of chains whose load comes in pieces, each step's kind, and P0 of each.

    tables: F, Q (haste, length, ..., state, state) of a load of size one throughout, what is the load's
    of Q, and P0 (haste, ..., state, state); size (piece, ..., state): those of the axis of each state;
    states (state,): which are the mean of the load, and which those of its kernel; length (part,), haste
    (piece,): where in the tables those of a cut clock and of each piece are.
    """
    mean, kernel = states
    F, Q, own, P0 = tables
    # what steps of one length do in one piece is the same
    each, which = np.unique(cut.piece * F.shape[1] + length, return_inverse=True)
    piece = each // F.shape[1]
    at = haste[piece], each % F.shape[1]
    F, Q, P0 = F[at], Q[at] + (pairs(size[piece]) - 1) * own[at], P0[haste]
    kind = which[np.flatnonzero(np.diff(cut.owner, append=-1))]
    new = np.diff(cut.piece, prepend=-1) != 0
    new[cut.begin] = False
    steps = np.unique(cut.owner[new])
    first, stop = np.searchsorted(cut.owner, steps), np.searchsorted(cut.owner, steps, "right")
    through = np.tile(np.eye(F.shape[-1]), (len(steps), *F.shape[1:-2], 1, 1))
    noise = np.zeros_like(through)
    for later in range(int((stop - first).max(initial=0))):
        on = first + later < stop
        part = (first + later)[on]
        f, q, anew = F[which[part]], Q[which[part]], new[part].reshape(-1, *[1] * (F.ndim - 1))
        start = P0[cut.piece[part]] * pairs(np.where(kernel, size[cut.piece[part]], 1.0 * mean))
        q = q + anew * (f @ start @ f.mT)  # the load is drawn anew
        f = np.where(anew & (mean | kernel), 0.0, f)
        through[on], noise[on] = f @ through[on], f @ noise[on] @ f.mT + q
    kind[steps] = len(F) + np.arange(len(steps))
    begun = cut.piece[cut.begin]
    P0 = pairs(np.where(kernel, size[begun], 1.0)) * P0[begun]
    return np.concatenate([F, through]), np.concatenate([Q, noise]), kind, P0


def pairs(factor: Array) -> Array:
    """Products (..., state, state) of factors (..., state)."""
    return np.asarray(factor[..., :, None] * factor[..., None, :])
