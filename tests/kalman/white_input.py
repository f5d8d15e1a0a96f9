"""A system with an input as a plain model, of which the input is a white state."""

import numpy as np

from forceid.kalman import StateSpace
from forceid.kalman.inputs.unknown_input import uncorrelated
from forceid.kalman.recursions.square_root import squared


def with_white_input(system, z, var, P0):
    """A plain model of states x, u for `kalman.filter` and `bounds.steady`: u white of variance `var`.

    system: A, B, C, D, Q, R, S; noises of step and sample are made independent, for the samples z at hand.
    Its matrices are constant unless S is not zero and z (time, channel) misses some channels.
    """
    B, C, D, R, S = system[1:4] + system[5:]
    n, inputs = B.shape
    spread = np.diag(np.broadcast_to(np.asarray(var, float), inputs))
    seen = np.isfinite(z[:-1])
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    if not S.any() or not len(seen):
        patterns, which = np.ones((1, z.shape[1]), bool), np.zeros(len(seen), int)
    F, Q = (np.zeros((len(patterns), n + inputs, n + inputs)) for _ in range(2))
    known = np.zeros((len(seen), n + inputs))
    for i, there in enumerate(patterns):
        Ak, Bk, common, noise = uncorrelated(system, there)
        F[i, :n], Q[i, :n, :n], Q[i, n:, n:] = np.hstack([Ak, Bk]), squared(noise), spread
        at = np.flatnonzero(which.ravel() == i)
        known[at, :n] = np.where(seen[at][:, there], z[at][:, there], 0.0) @ common.T
    F, Q = (a[0] if len(patterns) == 1 else a[which.ravel()] for a in (F, Q))
    start = np.zeros((n + inputs, n + inputs))
    start[:n, :n], start[n:, n:] = P0, spread
    u = known if S.any() and len(seen) else None
    return StateSpace(F, Q, np.hstack([C, D]), R, np.zeros(n + inputs), start, u)
