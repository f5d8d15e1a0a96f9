"""Loads that change character: pieces of a record between edges, in each of which a load is drawn anew.

A step, an impact, a foot on the ground between two flights: no stationary prior has them. Between two edges
a load is stationary, of a size and a rate of its own; at an edge it forgets what it was, its mean as well.
An impact shorter than the samples is a piece of part of a step. Source: principal equations 4e, with a
covariance that depends on time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.records import Array, Flags, Indices

CLOCK = 1e-9  # s: clocks are no finer, so that an edge as near to a sample as that lies at it


@dataclass(frozen=True)
class Split:
    """Steps of a clock, cut at edges: step (part,) s, the step of the clock it is of, and its piece."""

    step: Array
    owner: Indices
    piece: Indices

    def joined(self, F: Array, Q: Array) -> tuple[Array, Array]:
        """F, Q (step, ..., state, state) over the steps of the clock, of those over the parts."""
        last = np.append(np.flatnonzero(np.diff(self.owner)), len(self.owner) - 1)
        whole_F, whole_Q = F[last], Q[last]
        for part in np.flatnonzero(np.diff(self.owner) == 0)[::-1]:
            k = self.owner[part]
            whole_Q[k] += whole_F[k] @ Q[part] @ whole_F[k].swapaxes(-1, -2)
            whole_F[k] = whole_F[k] @ F[part]
        return whole_F, whole_Q


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
        return Split(np.diff(parts), owner, np.searchsorted(self.edges, middle))

    def cut(self, more: Array) -> Pieces:
        """The pieces with more edges (edge,) s, on both sides of which the load is of one size."""
        edges = np.union1d(self.edges, more)
        was = np.searchsorted(self.edges, np.concatenate([[-np.inf], edges]), side="right")
        return Pieces(edges, self.size[was], self.haste[was])

    def drawn(
        self, F: Array, Q: Array, own: Array, P0: Array, size: Array, states: tuple[Flags, Flags], cut: Split
    ) -> tuple[Array, Array, Array]:
        """F, Q (step, ..., state, state) and P0 (..., state, state) of a chain whose load comes in pieces.

        Given those over the parts of a cut clock of a load of size one throughout; own (part, ..., state,
        state): what is the load's of Q; P0 (piece, ..., state, state); size (piece, ..., state): those of the
        axis of each state; states (state,): which are the mean of the load, and which those of its kernel.
        """
        mean, kernel = states
        piece = cut.piece
        F, Q = F.copy(), Q + (pairs(size)[piece] - 1) * own
        for k in np.flatnonzero(np.diff(piece, prepend=piece[:1])):
            anew = np.where(kernel, size[piece[k]], 1.0 * mean)
            Q[k] += F[k] @ (pairs(anew) * P0[piece[k]]) @ F[k].swapaxes(-1, -2)
            F[k] *= ~(mean | kernel)
        return *cut.joined(F, Q), pairs(np.where(kernel, size[piece[0]], 1.0)) * P0[piece[0]]


WHOLE = Pieces(np.zeros(0), np.ones((1, 3)), np.ones(1))  # a load of one character


def pairs(factor: Array) -> Array:
    """Products (..., state, state) of factors (..., state)."""
    return np.asarray(factor[..., :, None] * factor[..., None, :])
