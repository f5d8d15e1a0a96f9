"""Many models of one channel each, side by side and sample by sample, in plain numpy.

A step predicts the reading of the next sample together with the state, as one more row and column before
it. What the sample tells is then one step of Gaussian elimination, of covariance and mean at once.
Arguments as in `passes`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from forceid.records import Array, Flags
from forceid.significance import WHOLE

BLOCK = 1000  # samples whose matrices are made at once: a few megabytes of them


def innovations(
    F: Array, Q: Array, H: Array, R: Array, u: Array, x0: Array, P0: Array, z: Array, seen: Flags, limit: float
) -> Iterator[tuple[Array, Array]]:
    """Innovations and their variances (sample seen, model), of one block of samples after the other.

    A variance is at least (innovation / limit)^2: the noise of an outlier is taken as larger (Huber's
    filter). A model that loses its sign to rounding goes on with a variance that is not positive, or NaN.
    """
    models, n = x0.shape
    known = np.concatenate([P0, x0[..., None]], -1)
    moved, both = np.empty((models, n + 1, n + 1)), np.empty((models, n + 1, n + 2))
    taken, times_F = np.empty_like(known), moved[..., :-1]
    covariance, mean, state = both[..., :-1], both[..., -1], both[:, 1:, 1:]
    error, spread, shared, shown = both[:, 0, -1], both[:, 0, 0], both[:, 1:, 0], both[:, :1, 1:]
    for first, stop in [(0, 1), *((k, min(k + BLOCK, len(z))) for k in range(1, len(z), BLOCK))]:
        G, G_Q, G_u, H_here = with_reading(F, Q, H, u, z, first, stop)
        e, S = np.empty((stop - first, models)), np.empty((stop - first, models))
        here = seen[first:stop, 0].astype(bool)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for k, present in enumerate(here.tolist()):
                G_k, R_k, S_k = step_of(G, k), step_of(R, first + k)[:, 0, 0], S[k]
                np.matmul(G_k, known, out=moved)
                np.matmul(times_F, G_k.swapaxes(1, 2), out=covariance)
                np.add(covariance, step_of(G_Q, k), out=covariance)
                np.add(moved[..., -1], G_u[k], out=mean)
                if not present:
                    known[...] = state
                    continue
                e[k] = error
                np.add(spread, R_k, out=S_k)
                if limit < np.inf:
                    np.maximum(S_k, (error / limit) ** 2, out=S_k)
                gain = shared / S_k[:, None]
                np.multiply(gain[..., None], shown, out=taken)
                np.subtract(state, taken, out=known)
                if np.logical_or.reduce(spread > WHOLE * S_k):  # else no variance loses as much
                    noise = R_k + (S_k - (spread + R_k))  # R_k to its last digit where nothing is wild
                    known[..., :-1] = updated(
                        state[..., :-1], gain[..., None], step_of(H_here, k), noise[:, None, None], taken[..., :-1]
                    )
        yield e[here], S[here]


def with_reading(
    F: Array, Q: Array, H: Array, u: Array, z: Array, first: int, stop: int
) -> tuple[Array, Array, Array, Array]:
    """Steps to the samples from `first` to before `stop`, of what each reads (less z) and then of the state.

    G (time or 1, model or 1, 1 + state, state), the covariance of its noise, its input (time, model or 1,
    1 + state); and H of these samples. The first sample of all is a step of nothing away.
    """
    n, H = F.shape[-1], H[first:stop] if len(H) > 1 else H
    if first == 0:
        F, Q, u = np.eye(n)[None, None], np.zeros((1, 1, n, n)), np.zeros((1, 1, n))
    F, Q, u = (a[first - 1 : stop - 1] if len(a) > 1 else a for a in (F, Q, u))
    reads = np.concatenate([H, np.broadcast_to(np.eye(n), (*H.shape[:2], n, n))], -2)
    G_u = (reads @ u[..., None])[..., 0]
    read = z[first:stop]
    shape = (len(read), max(G_u.shape[1], read.shape[1]), n + 1)
    G_u = np.broadcast_to(G_u, shape).copy()
    G_u[..., 0] -= read[..., 0]
    return reads @ F, reads @ Q @ reads.swapaxes(2, 3), G_u, H


def updated(P: Array, K: Array, H: Array, R: Array, taken: Array) -> Array:
    """Covariances (..., state, state) after an update: in Joseph's form where it takes most of a variance.

    Elsewhere P - taken, with taken = P H^T S^-1 H P, is as good: what it loses to rounding is small against
    what is left.
    """
    most = taken.diagonal(0, -2, -1) > WHOLE * P.diagonal(0, -2, -1)
    if not np.logical_or.reduce(most, None):
        return P - taken
    I_KH = np.eye(P.shape[-1]) - K @ H
    P = I_KH @ P @ I_KH.swapaxes(-1, -2) + K @ R @ K.swapaxes(-1, -2)
    return np.asarray(0.5 * (P + P.swapaxes(-1, -2)))


def step_of(a: Array, k: int) -> Array:
    """Matrices (model, ...) of sample or step k."""
    return a[k] if len(a) > 1 else a[0]
