"""Linear Gaussian filter, smoother and likelihood: the reference engine, on filterpy's KalmanFilter.

Slow, and written by others: what the other engines are judged by. The one file that imports filterpy.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from filterpy.kalman import KalmanFilter

from forceid.errors import EstimationError
from forceid.kalman.model import Filtered, Gains, Smoothed, StateSpace, as_channels
from forceid.kalman.recursions.linear import each_model, filter_each, require_positive, smooth_apart
from forceid.records import Array


def filter(model: StateSpace, z: Array) -> Filtered:
    """Kalman filter over z (time, channel), (time,) or (time, signal, channel); NaN = missing."""
    z = as_channels(z)
    if z.ndim == 3:
        starts = iter(range(z.shape[1]))
        return replace(filter_each(lambda one: filter(each_model(model, next(starts)), one), z), model=model)
    T, m, n = *z.shape, len(model.x0)
    x, P, P_pred, K, W = (np.zeros((T, *s)) for s in ((n,), (n, n), (n, n), (n, m), (m, m)))
    kf = KalmanFilter(dim_x=n, dim_z=m)
    kf.x, kf.P = model.x0, model.P0  # x without a second axis: z must have none either
    for k, seen in enumerate(np.isfinite(z)):
        if k > 0:
            u = None if model.u is None else model.at("u", k - 1)
            kf.predict(u, np.eye(n), model.at("F", k - 1), model.at("Q", k - 1))
        P_pred[k] = kf.P
        if seen.any():  # a NaN would poison the state without a word
            try:
                kf.update(z[k, seen], R=model.at("R", k)[seen][:, seen], H=model.at("H", k)[seen])
                W[k][np.ix_(seen, seen)] = np.linalg.inv(np.linalg.cholesky(kf.S))
            except np.linalg.LinAlgError:
                require_positive(k)
            K[k][:, seen] = kf.K
        x[k], P[k] = kf.x, kf.P
    return Filtered(model, z, x, Gains(T, np.arange(T), P_pred, P, K, W))


def log_likelihood(model: StateSpace, z: Array, limit: float = np.inf) -> Array:
    """Log-likelihood of z (time, channel) or (time,); of each of many models or signals (time, ., channel).

    Not filterpy's own, which leaves out a channel 1e10 times less variable than another. `limit` is not known
    here: no outlier is believed less.
    """
    z = as_channels(z)
    if model.x0.ndim == 1 and z.ndim == 2:
        return np.asarray(filter(model, z).log_likelihood)
    count = max(len(model.x0) if model.x0.ndim == 2 else 1, z.shape[1] if z.ndim == 3 else 1)
    signals = np.broadcast_to(z if z.ndim == 3 else z[:, None], (len(z), count, z.shape[-1]))
    return np.array([filter(each_model(model, j), signals[:, j]).log_likelihood for j in range(count)])


def smooth(model: StateSpace, z: Array) -> Smoothed:
    """Rauch-Tung-Striebel smoother over z (time, channel), (time,) or (time, signal, channel); NaN = missing.

    Raises EstimationError where a state is known exactly: filterpy inverts the predicted covariance.
    """
    z = as_channels(z)
    if z.ndim == 3:
        starts = iter(range(z.shape[1]))
        return smooth_apart(lambda one: smooth(each_model(model, next(starts)), one), z)
    f = filter(model, z)
    x, P, P_filtered = f.x.copy(), f.P, f.P
    rts = KalmanFilter(dim_x=x.shape[1], dim_z=1).rts_smoother
    for k in range(len(x) - 2, -1, -1):
        # pair by pair: rts_smoother takes no input, so the later state comes without it; it wants the
        # step from sample 0 to sample 1 at index 1
        later = x[k + 1] if model.u is None else x[k + 1] - model.at("u", k)
        F, Q = (np.stack([model.at(name, k)] * 2) for name in ("F", "Q"))
        try:
            x_pair, P_pair, _, _ = rts(np.stack([f.x[k], later]), np.stack([P_filtered[k], P[k + 1]]), F, Q)
        except np.linalg.LinAlgError as e:
            raise EstimationError(
                f"knows a state exactly at sample {k + 1}, which filterpy's smoother cannot divide by",
                "the linear model",
                'choose engine = "numpy"',
            ) from e
        x[k], P[k] = x_pair[0], P_pair[0]
    return Smoothed(x, np.arange(len(x)), 0.5 * (P + P.transpose(0, 2, 1)), f)


def smooth_states(model: StateSpace, z: Array) -> Array:
    """States (time, state) of `smooth`."""
    return smooth(model, z).x
