"""Loads that change character: pieces of a record between edges, in each of which a load is drawn anew.

A step, an impact, a foot on the ground between two flights: no stationary prior has them. Between two edges
a load is stationary, of a size and a rate of its own; at an edge it forgets what it was, its mean as well.
An impact shorter than the samples is a piece of part of a step. Source: principal equations 4e, with a
covariance that depends on time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from forceid.kalman.building.clock import ONE_LOAD, discretize_steps
from forceid.kalman.building.process import Process, discretize
from forceid.records import Array, Flags, Indices
from forceid.rounding import ITERATIONS

Discretization: TypeAlias = Callable[[Process, Array], tuple[Array, Array]]

HASTES_HELD = 8  # factors on a rate that pieces have: of 1500 uneven steps each takes 10 MB
CLOCK = 1e-9  # s: clocks are no finer, so that an edge as near to a sample as that lies at it


@dataclass(frozen=True)
class Split:
    """Steps of one clock, cut by each of the pieces tried, whose pieces stand in a row.

    piece (try, step): what each step is of, where no edge is in it; begun (try,): what the record begins
    with. cut (cut,): steps in which an edge is, or with which one begins, numbered through all tries. Of
    their parts: of (part,) the cut step, in order, length (part,) s, inside (part,) their piece, anew whether
    the load is drawn anew with it.
    """

    piece: Indices
    begun: Indices
    cut: Indices
    of: Indices
    length: Array
    inside: Indices
    anew: Flags


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

    def cut(self, more: Array) -> Pieces:
        """The pieces with more edges (edge,) s, on both sides of which the load is of one size."""
        edges = np.union1d(self.edges, more)
        was = np.searchsorted(self.edges, np.concatenate([[-np.inf], edges]), side="right")
        return Pieces(edges, self.size[was], self.haste[was])


WHOLE = Pieces(np.zeros(0), np.ones((1, 3)), np.ones(1))  # a load of one character


def split_in_a_row(tried: Sequence[Pieces], step: Array, begin: float) -> Split:
    """Steps (step,) s of a clock that begins at `begin`, cut by each of the pieces tried.

    >>> cut = split_in_a_row([WHOLE.cut(np.array([0.75]))], np.array([0.5, 0.5]), 0.0)
    >>> cut.piece.tolist(), cut.cut.tolist(), cut.length.tolist(), cut.inside.tolist()
    ([[0, 0]], [1], [0.25, 0.25], [0, 1])
    """
    ticks, steps = begin + np.concatenate([[0.0], np.cumsum(step)]), len(step)
    edges = np.full((len(tried), max(len(one.edges) for one in tried)), np.inf)
    for row, one in zip(edges, tried, strict=True):
        row[: len(one.edges)] = one.edges
    before = np.cumsum([0, *(len(one.size) for one in tried[:-1])])
    middle = 0.5 * (ticks[1:] + ticks[:-1])
    piece = (edges[:, :, None] < middle).sum(1) + before[:, None]
    begun = (edges <= begin + CLOCK).sum(1) + before

    row, k = np.nonzero((edges > begin) & (edges < ticks[-1]))
    edge = edges[row, k]
    nearest = np.searchsorted(middle, edge)
    apart = np.abs(ticks[nearest] - edge) > CLOCK
    owner = row * steps + np.where(apart, np.searchsorted(ticks, edge) - 1, nearest)
    cut = np.unique(owner[apart | (nearest < steps)])
    begins = np.concatenate([ticks[cut % steps], edge[apart]])
    of = np.concatenate([np.arange(len(cut)), np.searchsorted(cut, owner[apart])])
    order = np.lexsort((begins, of))
    begins, of = begins[order], of[order]
    first = np.diff(of, prepend=-1) != 0
    ends = np.append(begins[1:], 0.0)
    last = np.append(first[1:], True)[: len(of)]
    ends[: len(of)][last] = ticks[cut % steps + 1]
    length = ends[: len(of)] - begins
    try_ = cut[of] // steps
    inside = (edges[try_] < (begins + 0.5 * length)[:, None]).sum(1)
    earlier = np.where(first, (edges[try_] < (begins - CLOCK)[:, None]).sum(1), np.roll(inside, 1))
    anew = (inside != earlier) & ~(first & (cut[of] % steps == 0))
    return Split(piece, begun, cut, of, length, inside + before[try_], anew)


@dataclass(frozen=True)
class Forms:
    """F, Q (form, ..., state, state) of a load of size one over steps and parts of steps, each form once.

    own: what its kernel adds to Q; P0 (haste, ..., state, state); duration (form,) s. step (haste, length):
    the form of a step by its piece and its length (time - 1,); part (part,): that of each part. haste
    (piece,): which of the hastes each piece has.
    """

    F: Array
    Q: Array
    own: Array
    P0: Array
    duration: Array
    step: Indices
    length: Indices
    part: Indices
    haste: Indices


def forms_over(
    chain: Callable[[float], Process], kernel: Flags, step: Array
) -> Callable[[Sequence[Pieces], Split], Forms]:
    """All that a load does over the steps of a clock (step,) s, and over parts of them, in pieces tried.

    chain: of a load of size one, by a factor on its rate; kernel (state,): which states its kernel has. What
    it does over whole steps is worked out once for each of the last few factors.
    """
    lengths, length = np.unique(np.round(step, 12), return_inverse=True)

    def acting(load: Process, over: Array, through: Discretization) -> tuple[Array, Array, Array]:
        F, Q = through(load, over)
        alone = np.where(kernel[:, None] & kernel, load.Qc, 0.0)
        rest = np.array_equal(alone, load.Qc)
        return F, Q, Q if rest else through(replace(load, Qc=alone), over)[1]

    @lru_cache(HASTES_HELD)
    def whole(haste: float) -> tuple[Process, tuple[Array, Array, Array]]:
        load = chain(haste)
        return load, acting(load, lengths, discretize_steps)

    def within(loads: Sequence[Process], which: Indices, over: Array) -> list[tuple[Array, Array, Array]]:
        # parts stand in the order of the hastes that they have
        if not 0 < len(over) <= ITERATIONS or loads[0].A.shape[-1] > ONE_LOAD:
            return [acting(loads[k], over[which == k], discretize_steps) for k in np.unique(which)]
        A, Qc = (np.stack([getattr(load, name) for load in loads])[which] for name in ("A", "Qc"))
        each = Process(A, Qc, A, A)
        return [acting(each, over.reshape(-1, *[1] * (A.ndim - 3)), discretize)]

    def forms(tried: Sequence[Pieces], split: Split) -> Forms:
        hastes, haste = np.unique(np.concatenate([one.haste for one in tried]), return_inverse=True)
        parts, part = np.unique(haste[split.inside] + 1j * np.round(split.length, 12), return_inverse=True)
        which, short = parts.real.astype(int), parts.imag
        loads, each = zip(*(whole(float(one)) for one in hastes), strict=True)
        F, Q, own = (np.concatenate(some) for some in zip(*each, *within(loads, which, short), strict=True))
        of_step = np.arange(len(hastes) * len(lengths)).reshape(len(hastes), -1)
        duration = np.concatenate([np.tile(lengths, len(hastes)), short])
        P0 = np.stack([load.P0 for load in loads])
        return Forms(F, Q, own, P0, duration, of_step, length, of_step.size + part, haste)

    return forms


def drawn(
    forms: Forms, size: Array, states: tuple[Flags, Flags], split: Split
) -> tuple[Array, Array, Indices, Array]:
    """F, Q (kind, ..., state, state) of chains whose load comes in pieces, and P0 of each try.

    Also of which kind (try, step) each step is. size (piece, ..., state): of the axis of each state; states
    (state,): which are the mean of the load, and which those of its kernel.
    """
    mean, kernel = states
    # what steps of one length do in one piece is the same
    lengths, haste, P0 = forms.step.shape[1], forms.haste, forms.P0
    code = split.piece * lengths + forms.length
    held = np.zeros(len(haste) * lengths, bool)
    held[code] = True
    each, kind = np.flatnonzero(held), (np.cumsum(held) - 1)[code]

    def moved(piece: Indices, form: Indices) -> tuple[Array, Array]:
        return forms.F[form], forms.Q[form] + (pairs(size[piece]) - 1) * forms.own[form]

    piece, length = np.divmod(each, lengths)
    whole = moved(piece, forms.step[haste[piece], length])
    through = np.tile(np.eye(len(mean)), (len(split.cut), *forms.F.shape[1:-2], 1, 1))
    noise = np.zeros_like(through)
    first, stop = (np.searchsorted(split.of, np.arange(len(split.cut)), side) for side in ("left", "right"))
    for later in range(int((stop - first).max(initial=0))):
        on = first + later < stop
        part = (first + later)[on]
        piece, anew = split.inside[part], split.anew[part].reshape(-1, *[1] * (forms.F.ndim - 1))
        f, q = moved(piece, forms.part[part])
        start = P0[haste[piece]] * pairs(np.where(kernel, size[piece], 1.0 * mean))
        q = q + anew * (f @ start @ f.mT)  # the load is drawn anew
        f = np.where(anew & (mean | kernel), 0.0, f)
        through[on], noise[on] = f @ through[on], f @ noise[on] @ f.mT + q
    kind.ravel()[split.cut] = len(each) + np.arange(len(split.cut))
    F, Q = (np.concatenate(pair) for pair in zip(whole, (through, noise), strict=True))
    return F, Q, kind, pairs(np.where(kernel, size[split.begun], 1.0)) * P0[haste[split.begun]]


def pairs(factor: Array) -> Array:
    """Products (..., state, state) of factors (..., state)."""
    return np.asarray(factor[..., :, None] * factor[..., None, :])
