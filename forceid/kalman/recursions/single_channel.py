"""Many models of one channel each, side by side and sample by sample, in plain numpy.

A step predicts the reading of the next sample together with the state, as one more row and column before
it. What the sample tells is then one step of Gaussian elimination, of covariance and mean at once.
Arguments as in `passes`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import repeat

import numpy as np

from forceid.records import Array, Flags
from forceid.significance import WHOLE

SAMPLES_AT_ONCE = 1000  # samples whose matrices are made at once: a few megabytes of them


def innovation_blocks(
    F: Array, Q: Array, H: Array, R: Array, u: Array, x0: Array, P0: Array, z: Array,
    seen: Flags, limit: float,
) -> Iterator[tuple[Array, Array]]:  # fmt: skip
    """Innovations and their variances (sample seen, model), of one block of samples after the other.

    A variance is at least (innovation / limit)^2: the noise of an outlier is taken as larger (Huber's
    filter). A model that loses its sign to rounding goes on with a variance that is not positive, or NaN.
    """
    models, n = x0.shape
    both = np.zeros((models, n + 1, n + 2))  # covariance of reading and state, and the mean less z beside it
    known, row, column, spread, error = (
        both[:, 1:, 1:], both[:, :1], both[:, :, :1], both[:, :1, :1], both[:, :1, -1:],
    )  # fmt: skip
    known[..., :-1], known[..., -1] = P0, x0
    moved, taken, gain = np.empty((models, n + 1, n + 1)), np.empty_like(both), np.empty((models, n + 1, 1))
    share = gain[:, 0, 0]
    for first, stop in [
        (0, min(1, len(z))),
        *((k, min(k + SAMPLES_AT_ONCE, len(z))) for k in range(1, len(z), SAMPLES_AT_ONCE)),
    ]:
        e, S = np.empty((2, stop - first, models, 1, 1))
        here = seen[first:stop, 0].astype(bool)
        samples = [a[first:stop] if len(a) > 1 else a for a in (R, H)]
        steps = map(each, (*with_reading(F, Q, samples[1], u, first, stop), *samples))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for present, z_k, e_k, S_k, G, G_beside, added, R_k, H_k in zip(
                here.tolist(), z[first:stop, :, None], e, S, *steps, strict=False
            ):
                np.matmul(G, known, out=moved)
                np.matmul(moved, G_beside, out=both)
                both += added
                if not present:
                    continue
                error -= z_k
                e_k[:] = error
                np.add(spread, R_k, out=S_k)
                if limit < np.inf:
                    np.maximum(S_k, (error / limit) ** 2, out=S_k)
                np.divide(column, S_k, out=gain)
                np.multiply(gain, row, out=taken)
                if np.fmax.reduce(share) > WHOLE:  # of the reading's variance; no state loses more of its own
                    most = share > WHOLE
                    noise = R_k + (S_k - (spread + R_k))  # R to its last digit, but of outliers
                    H_k = H_k[most] if len(H_k) > 1 else H_k
                    P = joseph(known[most, :, :-1], gain[most, 1:], H_k, noise[most])
                    both -= taken
                    known[most, :, :-1] = P
                else:
                    both -= taken
        yield -e[here, :, 0, 0], S[here, :, 0, 0]


def with_reading(F: Array, Q: Array, H: Array, u: Array, first: int, stop: int) -> tuple[Array, Array, Array]:
    """Steps to the samples from `first` to before `stop`, of what each reads by H and then of the state.

    G (time or 1, model or 1, 1 + state, state); G^T and, for the mean beside it, a one (., ., 1 + state,
    state + 2); the covariance of what noise adds and, beside it, the input. The first sample of all is a step
    of nothing away.
    """
    n = F.shape[-1]
    if first == 0:
        F, Q, u = np.eye(n)[None, None], np.zeros((1, 1, n, n)), np.zeros((1, 1, n))
    F, Q, u = (a[first - 1 : stop - 1] if len(a) > 1 else a for a in (F, Q, u))
    reads = np.concatenate([H, np.broadcast_to(np.eye(n), (*H.shape[:2], n, n))], -2)
    G, noise, pushed = reads @ F, reads @ Q @ reads.swapaxes(2, 3), reads @ u[..., None]
    beside = np.zeros((*G.shape[:2], n + 1, n + 2))
    beside[..., :n, :-1], beside[..., n, -1] = G.swapaxes(2, 3), 1.0
    added = np.empty((*np.broadcast_shapes(noise.shape[:2], pushed.shape[:2]), n + 1, n + 2))
    added[..., :-1], added[..., -1:] = noise, pushed
    return G, beside, added


def joseph(P: Array, K: Array, H: Array, R: Array) -> Array:
    """Covariances (..., state, state) after an update with gain K, in Joseph's form.

    For updates that take most of a variance; elsewhere the difference P - K H P is as good: what it loses to
    rounding is small against what is left.
    """
    I_KH = np.eye(P.shape[-1]) - K @ H
    P = I_KH @ P @ I_KH.swapaxes(-1, -2) + K @ R @ K.swapaxes(-1, -2)
    return np.asarray(0.5 * (P + P.swapaxes(-1, -2)))


def each(a: Array) -> Iterable[Array]:
    """Matrices of one step after the other: those of all steps again and again."""
    return a if len(a) > 1 else repeat(a[0])
