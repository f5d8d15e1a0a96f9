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


def innovation_blocks(
    F: Array, Q: Array, H: Array, R: Array, u: Array, x0: Array, P0: Array, z: Array, seen: Flags, limit: float
) -> Iterator[tuple[Array, Array]]:
    """Innovations and their variances (sample seen, model), of one block of samples after the other.

    A variance is at least (innovation / limit)^2: the noise of an outlier is taken as larger (Huber's
    filter). A model that loses its sign to rounding goes on with a variance that is not positive, or NaN.
    """
    models, n = x0.shape
    both = np.zeros((models, n + 1, n + 2))  # covariance of reading and state, and the mean less z beside it
    known, error, spread = both[:, 1:, 1:], both[:, 0, -1], both[:, 0, 0]
    known[..., :-1], known[..., -1] = P0, x0
    moved, taken = np.empty((models, n + 1, n + 1)), np.empty_like(both)
    for first, stop in [(0, min(1, len(z))), *((k, min(k + BLOCK, len(z))) for k in range(1, len(z), BLOCK))]:
        G, G_beside, added, H_here = with_reading(F, Q, H, u, first, stop)
        e, S = np.empty((stop - first, models)), np.empty((stop - first, models))
        here = seen[first:stop, 0].astype(bool)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for k, present in enumerate(here.tolist()):
                np.matmul(step_of(G, k), known, out=moved)
                np.matmul(moved, step_of(G_beside, k), out=both)
                both += step_of(added, k)
                if not present:
                    continue
                error -= z[first + k, :, 0]
                e[k], R_k, S_k = -error, step_of(R, first + k)[:, 0, 0], S[k]
                np.add(spread, R_k, out=S_k)
                if limit < np.inf:
                    np.maximum(S_k, (error / limit) ** 2, out=S_k)
                gain = both[..., 0] / S_k[:, None]
                np.multiply(gain[..., None], both[:, :1], out=taken)
                most = spread > WHOLE * S_k  # of a variance of a state no larger part can go
                if np.logical_or.reduce(most):
                    (j,) = most.nonzero()
                    noise = R_k + (S_k - (spread + R_k))  # R_k to its last digit where nothing is wild
                    H_k, P, K = step_of(H_here, k), known[j, :, :-1], gain[j, 1:, None]
                    H_k = H_k[j] if len(H_k) > 1 else H_k
                    P = updated(P, K, H_k, noise[j, None, None], taken[j, 1:, 1:-1])
                    both -= taken
                    known[j, :, :-1] = P
                else:
                    both -= taken
        yield e[here], S[here]


def with_reading(
    F: Array, Q: Array, H: Array, u: Array, first: int, stop: int
) -> tuple[Array, Array, Array, Array]:
    """Steps to the samples from `first` to before `stop`, of what each reads and then of the state.

    G (time or 1, model or 1, 1 + state, state); G^T and a one for the mean beside it (., ., 1 + state, state +
    2); covariance of the noise of G and, beside it, its input; H of the samples. The first sample of all is a
    step of nothing away.
    """
    n, H = F.shape[-1], H[first:stop] if len(H) > 1 else H
    if first == 0:
        F, Q, u = np.eye(n)[None, None], np.zeros((1, 1, n, n)), np.zeros((1, 1, n))
    F, Q, u = (a[first - 1 : stop - 1] if len(a) > 1 else a for a in (F, Q, u))
    reads = np.concatenate([H, np.broadcast_to(np.eye(n), (*H.shape[:2], n, n))], -2)
    G, G_Q, G_u = reads @ F, reads @ Q @ reads.swapaxes(2, 3), reads @ u[..., None]
    beside = np.zeros((*G.shape[:2], n + 1, n + 2))
    beside[..., :n, :-1], beside[..., n, -1] = G.swapaxes(2, 3), 1.0
    shape = np.broadcast_shapes(G_Q.shape[:2], G_u.shape[:2])
    parts = (np.broadcast_to(a, (*shape, *a.shape[2:])) for a in (G_Q, G_u))
    return G, beside, np.concatenate(list(parts), -1), H


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
