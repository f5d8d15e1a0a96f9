"""What a load gives between its edges: impulse of the force, angular impulse of the moment, with covariance.

The momentum at the end of a piece less that at its start. A copy of the momentum, taken at the start and kept
as a state, gives the covariance of the two: a contact or an impact is known by its impulse, however short.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forceid.estimation.loads.pieces.cells import change_of, with_copy
from forceid.estimation.loads.pieces.edges import Spread
from forceid.flight.model import Flight
from forceid.flight.path.linear import seen_part
from forceid.flight.path.reference import Reference
from forceid.flight.priors.protocol import LoadPrior
from forceid.kalman.engines import Engine
from forceid.kalman.model import StateSpace
from forceid.records import Array, Impulses


def impulses(
    flight: Flight,
    priors: Sequence[tuple[LoadPrior, Reference | None]],
    given: Array,
    spread: Sequence[Spread | None],
    engine: Engine,
) -> Impulses:
    """The impulses of each piece between the edges of all loads; edges within a step of each other are one.

    priors: of the force, and of the moment with the reference of its rotation, where that is seen; given
    (time, 6): momentum that the loads have given so far; spread: of each load, at the samples of
    the flight, what the places of its edges leave open.
    """
    time, step = flight.time, float(np.median(np.diff(flight.time)))
    all_edges = np.sort(np.concatenate([edges_of(prior) for prior, _ in priors]))
    apart = np.diff(all_edges, prepend=-np.inf) > step
    bounds = np.concatenate([time[:1], all_edges[apart], time[-1:]])
    first = np.maximum(np.searchsorted(time, bounds[:-1], "right") - 1, 0)
    last = np.minimum(np.searchsorted(time, bounds[1:]), len(time) - 1)
    cov = np.full((len(first), 6, 6), np.nan)
    for k, (prior, about) in enumerate(priors):
        own = slice(3 * k, 3 * k + 3)
        model, z = seen_part(flight, prior, about)
        for piece, (a, b) in enumerate(zip(first, last, strict=True)):
            cov[piece, own, own] = prior.axes @ change_cov(model, z, a, b, engine) @ prior.axes.T
            if (places := spread[k]) is not None:
                cov[piece, own, own] += places.of_change(a, b)
    if len(priors) == 2:
        cov[:, :3, 3:] = cov[:, 3:, :3] = 0.0
    return Impulses(bounds[:-1], bounds[1:], given[last] - given[first], cov)


def edges_of(prior: LoadPrior) -> Array:
    """The edges (edge,) s of a load."""
    return np.zeros(0) if prior.tuned.pieces is None else prior.tuned.pieces.edges


def change_cov(model: StateSpace, z: Array, first: int, last: int, engine: Engine) -> Array:
    """Covariance (3, 3) of what the momentum in a model changes from one sample to a later one, smoothed."""
    found = engine.smooth(with_copy(model, first, len(z) - 1), z)
    return change_of(found.P[last])
