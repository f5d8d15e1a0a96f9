"""Edges at which a load changes its character, found by evidence: steps, impacts, a contact between flights.

Where one prior has to drive a load much harder in some stretch than elsewhere, the load is of another
character there. That stretch is where the search begins; edges stay where they gain more than their places
among all samples cost. Source: principal equations 4e.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from forceid.compiled import engine as compiled
from forceid.estimation.loads.pieces.evidence import Evidence, best_of, longest, moved
from forceid.estimation.loads.pieces.stretches import strong_by_turns, uneven
from forceid.flight.channels import CHANNEL_SAMPLES, Channel
from forceid.flight.pieces import WHOLE, Pieces
from forceid.flight.priors.matern import Matern
from forceid.flight.priors.protocol import KERNEL, LOAD, LoadPrior, channel_model
from forceid.flight.tuning import LEAK
from forceid.kalman.engines import Engine
from forceid.kalman.model import Filtered, same_at_all_times
from forceid.records import Array, Flags, Indices
from forceid.rounding import ITERATIONS
from forceid.significance import NUMBER, PATIENCE

COARSE_SIZES = np.exp([1.5, 3.0])  # of a load between edges over that around them, at first: to a decade
WEAKER = 1 / np.append(COARSE_SIZES, COARSE_SIZES[-1] ** 2)  # of one that is weak by turns
MOST_TURNS = 12  # edges that are tried at once: their search takes seconds, and grows by their square
TRIED = 8  # parts of a stretch and half of it to either side, between which an edge is tried at first
ENOUGH_FOR_TWO = 16  # samples, below which no two characters show

Tune = Callable[..., LoadPrior]


def with_character(
    channel: Channel, prior: LoadPrior, engine: Engine, tune: Tune, given: Array | None = None
) -> LoadPrior:
    """The prior of the load on a channel, in pieces where these are likelier by more than their edges cost.

    prior: of one character, as tuned on it; tune: a prior for given pieces; given (edge,) s: edges that
    another load of the body has, which cost no place.
    """
    time, free = channel.time, np.zeros(0) if given is None else given
    if not ENOUGH_FOR_TWO <= len(time) <= CHANNEL_SAMPLES or not isinstance(prior.kernel, Matern):
        return prior
    pieces = WHOLE if prior.tuned.pieces is None else prior.tuned.pieces
    level = Evidence(channel, prior, engine, free).of(pieces)
    for _ in range(ITERATIONS):
        evidence = Evidence(channel, prior, engine, free)
        begun = added(evidence, pieces)
        if begun is None:
            break
        near, found = begun
        for _ in range(2):  # what moves under one prior is tuned, and moves again
            size = found.size[longest(time, found)]
            found = replace(found, size=found.size / size)
            near = tune(pieces=found, near=near.with_kernel(near.kernel.scaled(size)))
            found = moved(replace(evidence, prior=near), found)
        if not near.tuned.log_likelihood - evidence.cost(found) > level:
            break
        found = replace(found, size=found.size / found.size[longest(time, found)])
        other = tune(pieces=found)
        value = other.tuned.log_likelihood - evidence.cost(found)
        own = not np.isin(found.edges, free).all()
        if not value > level + PATIENCE * own:  # edges that another load has are likely ones
            break
        prior, pieces, level = other, found, value
    return prior


def added(evidence: Evidence, pieces: Pieces) -> tuple[LoadPrior, Pieces] | None:
    """The pieces with an edge or two more, where the prior drives a load hardest or is surprised most.

    Or, where there are none yet, all of a load that is strong and weak by turns: each pair of its edges by
    itself leaves both in one piece. And the prior under which they are likelier.
    """
    time, tried = evidence.channel.time, []
    model = channel_model(evidence.channel, evidence.prior)
    f, x = evidence.engine.filter_and_smooth_states(model, evidence.channel.moved)
    for first, last in suspected(evidence, f, x):
        reach = (last - first) // 2
        at = np.unique(np.linspace(first - reach, last + reach, TRIED + 1).astype(int))
        at = at[(at > 0) & (at < len(time) - 1)]
        tried += [time[[one]] for one in at]
        tried += [time[[one, other]] for i, one in enumerate(at) for other in at[i + 1 :]]
    wider = [(pieces.cut(edges), edges) for edges in tried]
    groups = [sized_anew(more, edges) for more, edges in wider if len(more.edges) > len(pieces.edges)]
    if not len(pieces.edges):
        groups += by_turns(evidence, x)
    found = [best_of(evidence, *groups)] if groups else []
    if len(evidence.given) and len((more := pieces.cut(evidence.given)).edges) > len(pieces.edges):
        found.append(as_large_as_likely(evidence, more, evidence.given))
        groups.append(sized_anew(more, evidence.given))
    likely, best = max(found, key=lambda one: one[0], default=(-np.inf, pieces))
    level = evidence.of(pieces)
    if likely > level:
        return evidence.prior, best
    likely, prior, best = best_of_slower(evidence, groups) if groups else (-np.inf, evidence.prior, pieces)
    return (prior, best) if likely > level else None


def best_of_slower(evidence: Evidence, groups: Sequence[list[Pieces]]) -> tuple[float, LoadPrior, Pieces]:
    """As `best_of`, of a load that is as fast as the prior says where it is strong, and slower elsewhere.

    Along each axis along which that is likelier: one prior of a load that a blow is in follows the blow, and
    is too fast for the load around it.
    """
    kernel, found = evidence.prior.kernel, []
    assert isinstance(kernel, Matern)
    for factor in COARSE_SIZES:
        hasty = [[hasty_inside(one, factor) for one in group] for group in groups]
        tried = [one for group in hasty for one in group]
        slow = replace(kernel, rate=kernel.rate / factor)
        other = replace(evidence, prior=evidence.prior.with_kernel(slow))
        each = np.stack([evidence.by_axis(tried), other.by_axis(tried) - NUMBER])
        for group in hasty:
            own, each = each[:, : len(group)], each[:, len(group) :]
            slower, size = np.divmod(own.reshape(-1, 3).argmax(0), len(group))
            sizes = np.stack([group[k].size[:, axis] for axis, k in enumerate(size)], 1)
            rate = np.where(slower, slow.rate, kernel.rate)
            found.append((float(own.max((0, 1)).sum()), rate, replace(group[0], size=sizes)))
    likely, rate, pieces = max(found, key=lambda one: one[0])
    return likely, evidence.prior.with_kernel(replace(kernel, rate=rate)), pieces


def hasty_inside(pieces: Pieces, factor: float) -> Pieces:
    """The pieces whose load changes so many times faster where it is largest."""
    largest = pieces.size.max(1) >= pieces.size.max()
    return replace(pieces, haste=np.where(largest, factor * pieces.haste, pieces.haste))


def by_turns(evidence: Evidence, x: Array) -> list[list[Pieces]]:
    """Pieces of a load that is strong and weak by turns, as of contacts, the weak ones so by some factors.

    By the load along each axis that has one, of states x (time, state).
    """
    time, kernel, found = evidence.channel.time, evidence.prior.kernel, []
    each = np.tanh(
        np.asarray(kernel.rate) * np.median(np.diff(time))
    )  # numbers a step, of one that forgets so
    for axis in np.flatnonzero(kernel.std > LEAK * kernel.std.max()):
        strong = strong_by_turns(x[:, KERNEL + axis], float(each[axis]), evidence.place + NUMBER)
        turns = np.flatnonzero(np.diff(strong))
        if not 0 < len(turns) <= MOST_TURNS:
            continue
        edges, apart = 0.5 * (time[turns] + time[turns + 1]), strong[np.append(turns, -1)][:, None]
        sizes = [np.where(apart, 1.0, factor) * np.ones(3) for factor in (1.0, *WEAKER)]
        found.append([Pieces(edges, size, np.ones(len(size))) for size in sizes])
    return found


def suspected(evidence: Evidence, f: Filtered, x: Array) -> list[tuple[int, int]]:
    """First and last step of stretches that drive a load the hardest, and about where drawing it anew gains.

    As much as the place of an edge costs. f, x (time, state): the channel filtered, and smoothed.
    """
    ch, prior = evidence.channel, evidence.prior
    gain = drawn_anew(f, prior.vectors)
    gain[[0, -1]] = 0.0
    at = int(gain.argmax())
    surprising = [(max(at - TRIED // 2, 0), at + TRIED // 2)] if gain[at] > evidence.place else []
    pieces = prior.tuned.pieces or WHOLE
    cuts = (np.searchsorted(ch.time, pieces.edges) - 1).tolist()
    return uneven(driving(ch.time, prior, x[:, : prior.states]), cuts) + surprising


def drawn_anew(f: Filtered, vectors: int) -> Array:
    """Log-likelihood (time,) that a load gains which is drawn anew behind a sample, along axes that gain.

    By the adjoint of the filter: what a state moved behind a sample changes in all later innovations.
    vectors: states of the chain that come in threes. Source: de Jong and Penzer, J. Am. Stat. Assoc. 93
    (1998) 796.
    """
    model, seen = f.model, np.asarray(np.isfinite(f.innovation).all(1))
    run = np.repeat(np.arange(len(f.gains.start)), np.diff(f.gains.start, append=len(seen)))
    F, H = (a if a.ndim == 3 and not same_at_all_times(a) else a.reshape(-1, *a.shape[-2:])[:1]
            for a in (model.F, model.H))  # fmt: skip
    given = F, H, run, f.gains.K, f.gains.W, np.where(seen[:, None], f.innovation, 0.0), seen
    slopes, bends = (shocks_in_numpy if compiled is None else compiled.shocks)(*given, LOAD.start, vectors)
    gain = np.zeros(len(seen))
    for axis in range(3):
        own = np.arange(LOAD.start + axis, vectors, 3)
        std = np.sqrt(np.diagonal(model.P0)[own])
        root = std[:, None] * np.linalg.cholesky(model.P0[np.ix_(own, own)] / np.outer(std, std))
        shown, directions = np.linalg.eigh(root.T @ bends[:, axis] @ root)
        shown = np.maximum(shown, 0.0)  # a covariance: less than nothing is rounding
        v = np.einsum("ti,tij->tj", slopes[:, own] @ root, directions)
        likely = 0.5 * (v**2 / (1 + shown)).sum(1)
        gain += np.maximum(likely - 0.5 * np.log1p(shown).sum(1), 0.0)
    return gain


def shocks_in_numpy(
    F: Array, H: Array, run: Indices, K: Array, W: Array, v: Array, seen: Flags, first: int, stop: int
) -> tuple[Array, Array]:
    """What shocks to states behind each sample change in all later innovations v (time, channel).

    The adjoint (time, state), and the blocks (time, 3, k, k) of its covariance of the states from `first` to
    `stop`, which come in threes. F, H of each step, or one of all; run (time,): of gains K and W; seen
    (time,).
    """
    T, n = len(v), F.shape[-1]
    F, H = np.broadcast_to(F, (T - 1, n, n)), np.broadcast_to(H, (T, *H.shape[1:]))[1:]
    # by the states before each step: what its sample shows of them, and what is left of them behind it
    rows = W[run[1:]] @ H @ F
    rows[~seen[1:]] = 0.0
    rest = np.where(seen[1:, None, None], F - K[run[1:]] @ (H @ F), F)
    slopes, bends = np.zeros((T, n)), np.zeros((T, n, n))
    slopes[:-1], bends[:-1] = (v[1:, None] @ rows)[:, 0], rows.mT @ rows
    for t in range(T - 2, -1, -1):
        slopes[t] += slopes[t + 1] @ rest[t]
        bends[t] += rest[t].T @ (bends[t + 1] @ rest[t])
    return slopes, np.stack([bends[:, own, own] for own in (slice(first + i, stop, 3) for i in range(3))], 1)


def sized_anew(pieces: Pieces, edges: Array) -> list[Pieces]:
    """The pieces with other sizes between edges, the first and the last of them, or all around."""
    starts = np.concatenate([[-np.inf], pieces.edges])
    inside = (starts >= edges[0]) & ((starts < edges[-1]) | (len(edges) == 1))
    louder = [np.where(inside[:, None], factor, 1.0) for factor in COARSE_SIZES]
    quieter = [np.where(inside[:, None], 1.0, 1 / factor) for factor in COARSE_SIZES]
    return [pieces, *(replace(pieces, size=factor * pieces.size) for factor in (*louder, *quieter))]


def as_large_as_likely(evidence: Evidence, pieces: Pieces, edges: Array) -> tuple[float, Pieces]:
    """How likely pieces of the likeliest sizes between edges are, and these: an impact may be of any size."""
    likely, found = best_of(evidence, sized_anew(pieces, edges))
    while (again := best_of(evidence, sized_anew(found, edges)))[0] > likely:
        likely, found = again
    return likely, found


def driving(time: Array, prior: LoadPrior, x: Array) -> Array:
    """What drives the load over each step (step, axis), in units of what the prior expects.

    x (time, state): its chain, as smoothed.
    """
    order = prior.kernel.order
    last = slice(KERNEL + 3 * (order - 1), KERNEL + 3 * order)
    F, Q, _ = prior.chain(np.diff(time), None, time[0])
    w = x[1:, last] - np.einsum("tij,tj->ti", F[:, last], x[:-1])
    return np.asarray(w / np.sqrt(np.diagonal(Q[:, last, last], axis1=1, axis2=2)))
