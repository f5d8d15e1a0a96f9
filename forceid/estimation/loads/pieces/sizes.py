"""What may hide in a piece: a load as large as the record does not exclude, claimed beside what is found.

The likeliest size of a load that a piece hardly shows is next to nothing, and a claim made of it says that
nothing acts there. The record excludes only sizes by which its likelihood falls; up to the one by which it
falls by a standard error, the load may be as large. Source: profile likelihood, with its limit of one half.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from forceid.estimation.loads.pieces.evidence import Evidence
from forceid.flight.pieces import Pieces
from forceid.flight.priors.protocol import LoadPrior, channel_model
from forceid.records import Array

LARGER = np.exp(0.5 * np.arange(1, 25))  # factors on a size, two in an e-fold: up to five decades
STANDARD_ERROR = 0.5  # log-likelihood that a size one standard error off its likeliest loses


def as_large_as_may_be(evidence: Evidence, pieces: Pieces) -> Pieces:
    """The pieces, the load in each of the largest size on each axis that loses less than a standard error."""
    level, size = evidence.likelihood([pieces])[0], pieces.size.copy()
    for k in range(len(size)):
        at = np.arange(len(size))[:, None] == k
        tried = [replace(pieces, size=np.where(at, f * pieces.size, pieces.size)) for f in LARGER]
        open_ = level - evidence.likelihood(tried) < STANDARD_ERROR
        size[k] *= np.where(open_, LARGER[:, None], 1.0).max(0)
    return replace(pieces, size=size)


def hiding(evidence: Evidence, pieces: Pieces) -> Array:
    """What loads as large as they may be add to the covariance (time, 3, 3) of a load in pieces."""
    load, var = load_in(evidence, pieces)
    largest, wide = load_in(evidence, as_large_as_may_be(evidence, pieces))
    axes, apart = evidence.prior.axes, largest - load
    more = axes * np.maximum(wide - var, 0.0)[:, None] @ axes.T
    return np.asarray(more + apart[:, :, None] * apart[:, None])


def load_in(evidence: Evidence, pieces: Pieces) -> tuple[Array, Array]:
    """The load (time, 3) that a channel shows in pieces, world axes, and its variance along the prior's."""
    channel, was = evidence.channel, evidence.prior
    prior: LoadPrior = replace(was, tuned=replace(was.tuned, pieces=pieces))
    found = evidence.engine.smooth(channel_model(channel, prior), channel.moved)
    rows = prior.axes.T @ prior.rows
    var = np.einsum("ai,tij,aj->ta", rows, found.P[:, : prior.states, : prior.states], rows, optimize=True)
    return found.x[:, : prior.states] @ prior.rows.T, var
