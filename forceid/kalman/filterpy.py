"""Linear Gaussian filter, smoother and likelihood: the reference engine, on filterpy's KalmanFilter.

Slow, and written by others: what `linear` is judged by. The one file that imports filterpy.
"""

from __future__ import annotations

import numpy as np
from filterpy.kalman import KalmanFilter

from forceid.errors import EstimationError
from forceid.kalman.linear import LOG_2PI, Filtered, Smoothed, StateSpace, as_channels, mean_square
from forceid.records import Array


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
    kf = KalmanFilter(dim_x=n, dim_z=z.shape[1])
    kf.x, kf.P = model.x0, model.P0  # x without a second axis: z must have none either
    for k, seen in enumerate(np.isfinite(z)):
        if k > 0:
            u = None if model.u is None else model.at("u", k - 1)
            kf.predict(u, np.eye(n), model.at("F", k - 1), model.at("Q", k - 1))
        x_pred[k], P_pred[k] = kf.x, kf.P
        if seen.any():  # a NaN would poison the state without a word
            try:
                kf.update(z[k, seen], R=model.at("R", k)[seen][:, seen], H=model.at("H", k)[seen])
                L = np.linalg.cholesky(kf.S)
            except np.linalg.LinAlgError as e:
                raise EstimationError(
                    f"gives an innovation covariance that is not positive definite at sample {k}",
                    "the linear model",
                    "state a measurement noise above zero",
                ) from e
            # not kf.log_likelihood, which leaves out a channel 1e10 times less variable than another
            white = innovation[k, seen] = np.linalg.solve(L, kf.y)
            total -= 0.5 * float(white @ white + seen.sum() * LOG_2PI) + float(np.log(np.diag(L)).sum())
        x[k], P[k] = kf.x, kf.P
    return Filtered(x, P, x_pred, P_pred, innovation, mean_square(innovation), total)


def log_likelihood(model: StateSpace, z: Array) -> Array:
    """Log-likelihood of z (time, channel) or (time,); of each of many models, z (time, model, channel)."""
    if model.x0.ndim == 1:
        return np.asarray(filter(model, z).log_likelihood)
    each = [filter(model.one(i), z[:, i]).log_likelihood for i in range(len(model.x0))]
    return np.asarray(each)


def smooth(model: StateSpace, z: Array) -> Smoothed:
    """Rauch-Tung-Striebel smoother over z (time, channel) or (time,); NaN = missing.

    Raises EstimationError where a state is known exactly: filterpy inverts the predicted covariance.
    """
    f = filter(model, z)
    x, P = f.x.copy(), f.P.copy()
    rts = KalmanFilter(dim_x=x.shape[1], dim_z=1).rts_smoother
    for k in range(len(x) - 2, -1, -1):
        # pair by pair: rts_smoother takes no input, so the later state comes without it; it wants the
        # step from sample 0 to sample 1 at index 1
        later = x[k + 1] if model.u is None else x[k + 1] - model.at("u", k)
        F, Q = (np.stack([model.at(name, k)] * 2) for name in ("F", "Q"))
        try:
            x_pair, P_pair, _, _ = rts(np.stack([f.x[k], later]), np.stack([f.P[k], P[k + 1]]), F, Q)
        except np.linalg.LinAlgError as e:
            raise EstimationError(
                f"knows a state exactly at sample {k + 1}, which filterpy's smoother cannot divide by",
                "the linear model",
                'choose engine = "numpy"',
            ) from e
        x[k], P[k] = x_pair[0], P_pair[0]
    return Smoothed(x, 0.5 * (P + P.transpose(0, 2, 1)), f)
