"""Exact gradient of the log-likelihood in every matrix of a linear model, from one smoothing pass.

By Fisher's identity the score is the expectation, over the states given the record, of the score with the
states known: smoothed disturbances and their covariances hold all of it. Source: Koopman and Shephard,
Biometrika 79 (1992); Segal and Weinstein, IEEE Trans. Inf. Theory 35 (1989).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.kalman.engines import engine as engine_called
from forceid.kalman.model import StateSpace, as_channels
from forceid.records import Array

NAMES = ("F", "Q", "H", "R", "x0", "P0", "u")


@dataclass(frozen=True)
class Score:
    """Derivatives of the log-likelihood, each of the shape of its matrix in the model; u zero where None.

    For a small change of the model, the log-likelihood changes by the sum over all entries of derivative
    times change; changes of Q, R and P0 are symmetric.
    """

    F: Array
    Q: Array
    H: Array
    R: Array
    x0: Array
    P0: Array
    u: Array
    log_likelihood: float

    def along(self, change: StateSpace) -> float:
        """Derivative of the log-likelihood along a change of the model: the changes of its matrices."""
        total = sum(float(np.sum(getattr(self, name) * getattr(change, name))) for name in NAMES[:-1])
        return total if change.u is None else total + float(np.sum(self.u * change.u))


def score(model: StateSpace, z: Array, engine: str = "auto") -> Score:
    """Gradient of log_likelihood(model, z) in F, Q, H, R, x0, P0 and u; z (time, channel), NaN = missing.

    Divides by no covariance of the state: exact where some states are known or driven by nothing. Raises
    EstimationError where an innovation covariance is not positive definite.

    >>> z = np.array([0.5, 1.5, np.nan, 1.0])
    >>> level = StateSpace(*np.ones((4, 1, 1)), x0=np.zeros(1), P0=np.eye(1))
    >>> more = StateSpace(*np.ones((3, 1, 1)), R=np.full((1, 1), 1 + 1e-6), x0=np.zeros(1), P0=np.eye(1))
    >>> likely = engine_called("numpy").log_likelihood
    >>> gained = float((likely(more, z) - likely(level, z)) / 1e-6)
    >>> bool(np.isclose(score(level, z).R[0, 0], gained, atol=1e-5))
    True
    """
    z = as_channels(z)
    filtered = engine_called(engine).filter(model, z)
    T, n = len(z), len(model.x0)
    seen = np.isfinite(z)
    # a channel that is missing: seen by nothing, with noise of its own
    H = np.broadcast_to(model.H, (T, *model.H.shape[-2:])) * seen[..., None]
    one = np.broadcast_to(np.eye(z.shape[1]), (T, z.shape[1], z.shape[1]))
    both = seen[:, :, None] & seen[:, None, :]
    R = np.where(both, model.R, one)
    x_pred, P_pred, P = filtered.x_pred, filtered.P_pred, filtered.P
    e = np.where(seen, z, 0.0) - (H @ x_pred[..., None])[..., 0]
    PHt = P_pred @ H.swapaxes(1, 2)
    S_inv = np.linalg.inv(H @ PHt + R)
    S_inv = 0.5 * (S_inv + S_inv.swapaxes(1, 2))
    K = PHt @ S_inv
    Se = (S_inv @ e[..., None])[..., 0]
    HtSe, HtSH, L = (Se[:, None] @ H)[:, 0], H.swapaxes(1, 2) @ S_inv @ H, np.eye(n) - K @ H
    F = np.broadcast_to(model.F, (T - 1, n, n))

    r, N = np.empty((T, n)), np.empty((T, n, n))  # of the prediction: x smoothed = x_pred + P_pred r
    rt, Nt = np.zeros((T, n)), np.zeros((T, n, n))  # of the update
    for k in range(T - 1, -1, -1):
        if k < T - 1:
            rt[k] = r[k + 1] @ F[k]
            Nt[k] = F[k].T @ N[k + 1] @ F[k]
        r[k] = HtSe[k] + rt[k] @ L[k]
        N[k] = HtSH[k] + L[k].T @ Nt[k] @ L[k]

    x = x_pred + (P_pred @ r[..., None])[..., 0]
    Kt = K.swapaxes(1, 2)
    u = Se - (Kt @ rt[..., None])[..., 0]
    D = S_inv + Kt @ Nt @ K
    ahead, N_ahead = r[1:], N[1:]
    each = {
        "F": outer(ahead, x[:-1]) - N_ahead @ F @ P[:-1],
        "Q": 0.5 * (outer(ahead, ahead) - N_ahead),
        "H": (outer(u, x) - Kt @ (np.eye(n) - Nt @ P)) * seen[..., None],
        "R": 0.5 * (outer(u, u) - D) * both,
    }
    summed = {name: over_time(value, getattr(model, name), 2) for name, value in each.items()}
    known = ahead.sum(0) if model.u is None else over_time(ahead, model.u, 1)
    P0 = 0.5 * (np.outer(r[0], r[0]) - N[0])
    return Score(**summed, x0=r[0], P0=P0, u=known, log_likelihood=float(filtered.log_likelihood))


def outer(a: Array, b: Array) -> Array:
    """Outer products (time, i, j) of the rows of a (time, i) and b (time, j)."""
    return a[:, :, None] * b[:, None, :]


def over_time(each: Array, matrix: Array, dims: int) -> Array:
    """Derivatives of every sample added up to the shape of the matrix, constant or with an axis of time."""
    if matrix.ndim == dims:
        return np.asarray(each.sum(0))
    return each.sum(0, keepdims=True) if len(matrix) == 1 < len(each) else each
