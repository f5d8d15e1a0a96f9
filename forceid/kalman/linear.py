"""Linear Gaussian filter, Rauch-Tung-Striebel smoother and likelihood: the plain numpy engine.

x_{k+1} = F_k x_k + u_k + w_k, z_k = H_k x_k + n_k, cov w = Q_k, cov n = R_k. x0, P0 describe the state
at the first sample, before that sample is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.errors import EstimationError
from forceid.records import Array, Flags

LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True)
class StateSpace:
    """A linear Gaussian model; each matrix is constant, or carries a leading axis of time.

    F, Q (state, state) lead from a sample to the next; H (channel, state), R (channel, channel);
    x0 (state,), P0 (state, state); u (state,) or (time, state) is a known input of the step, or None.
    Many models at once: F, Q, H, R (time or 1, model, ., .), u (time or 1, model, state), x0 (model, state),
    P0 (model, state, state); every model then sees the same gaps.
    """

    F: Array
    Q: Array
    H: Array
    R: Array
    x0: Array
    P0: Array
    u: Array | None = None

    def at(self, name: str, k: int) -> Array:
        """Matrix `name` of sample (or step) k."""
        a: Array = getattr(self, name)
        if a.ndim > (1 if name == "u" else 2):
            a = a[k] if len(a) > 1 else a[0]
        return a

    def one(self, j: int) -> StateSpace:
        """Model j of many, by itself."""
        F, Q, H, R = (
            a if a.ndim < 4 else a[:, min(j, a.shape[1] - 1)] for a in (self.F, self.Q, self.H, self.R)
        )
        u = None if self.u is None else self.u[:, j]
        return StateSpace(F, Q, H, R, self.x0[j], self.P0[j], u)


@dataclass(frozen=True)
class Filtered:
    """What the filter knows: x, P after each sample, x_pred, P_pred before it.

    innovation (time, channel): z - H x_pred whitened by its covariance, NaN where z is missing; nis (time,):
    its mean square over the channels present, NaN where none is. log_likelihood: of all samples.
    """

    x: Array
    P: Array
    x_pred: Array
    P_pred: Array
    innovation: Array
    nis: Array
    log_likelihood: float


@dataclass(frozen=True)
class Smoothed:
    """State x (time, state) with covariance P (time, state, state) given all samples, and the filter's."""

    x: Array
    P: Array
    filtered: Filtered


def filter(model: StateSpace, z: Array) -> Filtered:
    """Kalman filter over z (time, channel) or (time,); NaN = missing.

    >>> level = StateSpace(*np.ones((4, 1, 1)), x0=np.zeros(1), P0=np.eye(1))
    >>> round(float(filter(level, np.array([1.0, np.nan, 2.0])).x[0, 0]), 9)
    0.5
    """
    z = as_channels(z)
    T, n = len(z), len(model.x0)
    x, P, x_pred, P_pred = (np.empty(s) for s in ((T, n), (T, n, n), (T, n), (T, n, n)))
    innovation, total = np.full(z.shape, np.nan), 0.0
    x_k, P_k = model.x0, model.P0
    for k, seen in enumerate(np.isfinite(z)):
        if k > 0:
            x_k, P_k = predict(model, k - 1, x_k, P_k)
        x_pred[k], P_pred[k] = x_k, P_k
        if seen.any():
            x_k, P_k, innovation[k, seen], gained = update(model, k, seen, x_k, P_k, z[k, seen])
            total += float(gained)
        x[k], P[k] = x_k, P_k
    return Filtered(x, P, x_pred, P_pred, innovation, mean_square(innovation), total)


def log_likelihood(model: StateSpace, z: Array) -> Array:
    """Log-likelihood of z (time, channel) or (time,); of each of many models, z (time, model, channel)."""
    z = as_channels(z)
    x, P, total = model.x0, model.P0, np.zeros(model.x0.shape[:-1])
    present = np.isfinite(z if z.ndim == 2 else z[:, 0])
    for k, seen in enumerate(present):
        if k > 0:
            x, P = predict(model, k - 1, x, P)
        if seen.any():
            x, P, _, gained = update(model, k, seen, x, P, z[k][..., seen])
            total = total + gained
    return np.asarray(total)


def robust_log_likelihood(model: StateSpace, z: Array, limit: float) -> Array:
    """Log-likelihood (model,) of many models of one channel, z (time, model); no known input.

    Whitened innovations beyond `limit` count as outliers of just that size, and their sample is believed
    accordingly less (Huber's filter). Three times as quick as `log_likelihood`, without its Joseph form:
    for tuning, where models that lose their sign to rounding may go as NaN.
    """
    x, P, total = model.x0.copy(), model.P0.copy(), np.zeros(len(model.x0))
    seen, FP = np.isfinite(z[:, 0]), np.empty_like(model.P0)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for k in range(len(z)):
            if k > 0:
                F = model.at("F", k - 1)
                x = (F @ x[..., None])[..., 0]
                np.matmul(F, P, out=FP)
                np.matmul(FP, F.swapaxes(-1, -2), out=P)
                P += model.at("Q", k - 1)
            if seen[k]:
                h = model.at("H", k)[0, 0]
                PHt, error = P @ h, z[k] - x @ h
                S = np.maximum(PHt @ h + model.at("R", k)[:, 0, 0], (error / limit) ** 2)
                K = PHt / S[:, None]
                x += K * error[:, None]
                P -= K[:, :, None] * PHt[:, None, :]
                total -= 0.5 * (error**2 / S + np.log(S) + LOG_2PI)
    return total


def smooth(model: StateSpace, z: Array) -> Smoothed:
    """Fixed-interval smoother over z (time, channel) or (time,); NaN = missing.

    Rauch-Tung-Striebel's result, in a form that divides by no covariance of the state and takes no
    difference of two: the predicted one is singular in all but name where a prior is smooth, and a
    difference turns negative after a start as good as unknown. The state by the adjoint of Bryson and
    Frazier (1963), the covariance by the information of later samples (Fraser and Potter 1969).
    """
    z = as_channels(z)
    f = filter(model, z)
    one = np.eye(len(model.x0))
    x, adjoint, later, told = f.x.copy(), np.zeros(len(one)), np.zeros_like(f.P), np.zeros_like(one)
    for k in range(len(x) - 1, -1, -1):
        if k < len(x) - 1:
            F = model.at("F", k)
            adjoint = F.T @ adjoint
            later[k] = F.T @ np.linalg.solve(one + told @ model.at("Q", k), told) @ F
        x[k] += f.P[k] @ adjoint
        told, seen = later[k], np.isfinite(z[k])
        if seen.any():
            H, R = model.at("H", k)[seen], model.at("R", k)[np.ix_(seen, seen)]
            L, K = gain(f.P_pred[k], H, R, k)
            adjoint = adjoint + H.T @ (np.linalg.solve(L.T, f.innovation[k, seen]) - K.T @ adjoint)
            told = told + H.T @ np.linalg.solve(R, H)
        told = 0.5 * (told + told.T)
    return Smoothed(x, combine(f.P, later), f)


def combine(P: Array, information: Array) -> Array:
    """(P^-1 + information)^-1 of every sample (time, state, state), positive by construction.

    With P = C C^T it is C (1 + C^T information C)^-1 C^T.
    """
    C = square_root(P)
    known = np.eye(P.shape[-1]) + C.swapaxes(1, 2) @ information @ C
    root = np.linalg.solve(square_root(0.5 * (known + known.swapaxes(1, 2))), C.swapaxes(1, 2))
    return np.asarray(root.swapaxes(1, 2) @ root)


def square_root(P: Array) -> Array:
    """C with C C^T = P for each of many P (..., state, state)."""
    size = np.sqrt(np.maximum(np.diagonal(P, axis1=-2, axis2=-1), 1e-300))[..., None]
    correlation = P / (size * size.swapaxes(-1, -2))
    try:
        return np.asarray(size * np.linalg.cholesky(correlation))
    except np.linalg.LinAlgError:  # semidefinite to rounding
        spread, axes = np.linalg.eigh(correlation)
        return np.asarray(size * axes * np.sqrt(np.maximum(spread, 0.0))[..., None, :])


def predict(model: StateSpace, k: int, x: Array, P: Array) -> tuple[Array, Array]:
    """State and covariance one step on from sample k."""
    F = model.at("F", k)
    x = (F @ x[..., None])[..., 0]
    return x if model.u is None else x + model.at("u", k), F @ P @ F.swapaxes(-1, -2) + model.at("Q", k)


def update(
    model: StateSpace, k: int, seen: Flags, x: Array, P: Array, z: Array
) -> tuple[Array, Array, Array, Array]:
    """One sample, in Joseph form: x, P, the whitened innovation and the log-likelihood it adds."""
    H, R = model.at("H", k)[..., seen, :], model.at("R", k)[..., seen, :][..., seen]
    innovation = (z - (H @ x[..., None])[..., 0])[..., None]
    L, K = gain(P, H, R, k)
    white: Array = innovation / L if L.shape[-1] == 1 else np.asarray(np.linalg.solve(L, innovation))
    x = x + (K @ innovation)[..., 0]
    I_KH = np.eye(x.shape[-1]) - K @ H
    P = I_KH @ P @ I_KH.swapaxes(-1, -2) + K @ R @ K.swapaxes(-1, -2)
    white = white[..., 0]
    gained = -0.5 * ((white**2).sum(-1) + white.shape[-1] * LOG_2PI)
    gained = gained - np.log(np.diagonal(L, axis1=-2, axis2=-1)).sum(-1)
    return x, 0.5 * (P + P.swapaxes(-1, -2)), white, gained


def gain(P: Array, H: Array, R: Array, k: int) -> tuple[Array, Array]:
    """Cholesky factor L of the innovation covariance of sample k, and the gain K.

    Of many scalar models, those whose covariance has lost its sign go on as NaN; one model raises.
    """
    PHt = P @ H.swapaxes(-1, -2)
    S = H @ PHt + R
    if S.ndim > 2 and S.shape[-1] == 1:
        S = np.where(S > 0, S, np.nan)
        return np.sqrt(S), PHt / S
    try:
        L = np.linalg.cholesky(S)
    except np.linalg.LinAlgError as e:
        raise EstimationError(
            f"gives an innovation covariance that is not positive definite at sample {k}",
            "the linear model",
            "state a measurement noise above zero",
        ) from e
    K = np.linalg.solve(L @ L.swapaxes(-1, -2), PHt.swapaxes(-1, -2)).swapaxes(-1, -2)
    return np.asarray(L), np.asarray(K)


def as_channels(z: Array) -> Array:
    """Measurements with a channel axis: (time,) becomes (time, 1)."""
    z = np.asarray(z, float)
    return z[:, None] if z.ndim == 1 else z


def mean_square(innovation: Array) -> Array:
    """Mean over the channels present of squared whitened innovations (time, channel); NaN where none is."""
    seen = np.isfinite(innovation)
    return np.where(seen.any(1), np.nansum(innovation**2, 1) / np.maximum(seen.sum(1), 1), np.nan)
