"""Smoothers of filterpy, statsmodels and PyNumDiff on the paths, under an acceleration that walks at random.

State of every channel: position, velocity, acceleration, driven by white jerk of density q; measurement noise
as high differences show it, unless it is fitted too. Second derivatives come with variances where the library
gives them.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from evidence.subjects.flights.peers.differentiators import noise_std
from forceid.records import Array

EVALUATIONS = 12  # of the likelihood, one filter pass each
RATES = (0.5, 50.0)  # Hz: how fast the smoother may be
UNKNOWN = 1e6  # variance of the start, in units of the path


def density(rate: float, r: float) -> float:
    """Density of white jerk that is followed up to `rate` Hz; r: noise variance times step."""
    return float(r * (2 * np.pi * rate) ** 6)


def constant_acceleration(step: float, q: float) -> tuple[Array, Array]:
    """Transition and noise covariance (3, 3) of a step under white jerk of density q."""
    F = np.array([[1, step, step**2 / 2], [0, 1, step], [0, 0, 1]])
    i = np.arange(2, -1, -1)
    factorial = np.array([2.0, 1.0, 1.0])
    power = i[:, None] + i + 1
    return F, q * step**power / (power * factorial[:, None] * factorial)


def filterpy_rts(z: Array, step: float, rate: float | None = None) -> tuple[Array, Array]:
    """The KalmanFilter of filterpy, batch_filter and rts_smoother; q by likelihood, or as `rate` says."""
    second, var = np.zeros_like(z), np.zeros_like(z)
    for i, std in enumerate(noise_std(z)):
        if std > 0:
            track = z[:, i] - z[0, i]
            chosen = likeliest_rate(track, step, float(std)) if rate is None else rate
            kf = filterpy_filter(track, step, float(std), chosen)
            x, P, _, _ = kf.batch_filter(track)
            x, P, _, _ = kf.rts_smoother(x, P)
            second[:, i], var[:, i] = x[:, 2, 0], P[:, 2, 2]
    return second, var


def filterpy_filter(track: Array, step: float, std: float, rate: float) -> Any:
    """A KalmanFilter for one track (sample,) with noise std, that follows up to `rate` Hz."""
    kf = import_module("filterpy.kalman").KalmanFilter(dim_x=3, dim_z=1)
    kf.F, kf.Q = constant_acceleration(step, density(rate, std**2 * step))
    kf.H, kf.R = np.array([[1.0, 0.0, 0.0]]), np.array([[std**2]])
    kf.P = UNKNOWN * max(float(np.ptp(track)), 1e-3) ** 2 * np.eye(3)
    return kf


def likeliest_rate(track: Array, step: float, std: float) -> float:
    """The rate (Hz) of greatest likelihood, by filterpy, one filter pass at a time."""

    def unlikely(log_rate: float) -> float:
        kf, total = filterpy_filter(track, step, std, float(np.exp(log_rate))), 0.0
        for value in track:
            kf.predict()
            kf.update(value)
            S = float(kf.S[0, 0])
            total += float(kf.y[0, 0]) ** 2 / S + float(np.log(S))
        return total

    low, high = np.log(RATES)
    options: Any = {"maxiter": EVALUATIONS, "xatol": 0.05}
    found: Any = minimize_scalar(unlikely, bounds=(low, high), method="bounded", options=options)
    return float(np.exp(found.x))


def statsmodels_fit(z: Array, step: float) -> tuple[Array, Array]:
    """An MLEModel of statsmodels: q and the noise by maximum likelihood, then its smoother."""
    MLEModel: Any = import_module("statsmodels.tsa.statespace.mlemodel").MLEModel

    class Driven(MLEModel):  # type: ignore[misc]
        """Position measured, acceleration a random walk; parameters are logarithms."""

        def __init__(self, track: Array, r: float) -> None:
            super().__init__(track, k_states=3, k_posdef=3)
            self.r = r
            self["design"], self["selection"] = np.array([[1.0, 0.0, 0.0]]), np.eye(3)
            self["transition"] = constant_acceleration(step, 1.0)[0]
            self.ssm.initialize_known(np.zeros(3), UNKNOWN * max(float(np.ptp(track)), 1e-3) ** 2 * np.eye(3))

        @property
        def start_params(self) -> Array:
            return np.array([np.log(5.0), 0.0])

        @property
        def param_names(self) -> list[str]:
            return ["log rate", "log noise"]

        def update(self, params: Array, **kwargs: Any) -> None:
            rate, noise = np.exp(super().update(params, **kwargs))
            self["state_cov"] = constant_acceleration(step, density(rate, self.r * step))[1]
            self["obs_cov"] = np.array([[self.r * noise**2]])

    second, var = np.zeros_like(z), np.zeros_like(z)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of an optimizer that stops at a flat top
        for i, std in enumerate(noise_std(z)):
            if std > 0:
                found = Driven(z[:, i] - z[0, i], std**2).fit(disp=False, maxiter=50)
                second[:, i], var[:, i] = found.smoothed_state[2], found.smoothed_state_cov[2, 2]
    return second, var


def pynumdiff_twice(z: Array, step: float, method: str, **settings: Any) -> Array:
    """A method of PyNumDiff, which gives first derivatives, twice."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its optional dependencies
        differentiate: Any = getattr(import_module("pynumdiff"), method)
        velocity = differentiate(z - z[0], step, **settings, axis=0)[1]
        return np.asarray(differentiate(velocity, step, **settings, axis=0)[1])
