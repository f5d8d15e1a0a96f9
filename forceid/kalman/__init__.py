"""Linear Gaussian estimation: priors of loads, filter, smoother, likelihood, and free flights.

>>> import numpy as np
>>> from forceid import kalman
>>> load = kalman.matern(2, std=1.0, rate=30.0)
>>> F, Q = kalman.discretize(load, 0.01)
>>> model = kalman.StateSpace(F, Q, np.eye(1, 2), 0.01 * np.eye(1), np.zeros(2), load.P0)
>>> kalman.smooth(model, np.array([0.9, np.nan, 1.1])).x.shape
(3, 2)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from forceid.kalman.engines import Engine, engine
from forceid.kalman.linear import Filtered, Smoothed, StateSpace
from forceid.records import Array

_LAZY = {  # these need scipy.linalg
    "Process": "forceid.kalman.process",
    "matern": "forceid.kalman.process",
    "with_mean": "forceid.kalman.process",
    "integrate": "forceid.kalman.process",
    "discretize": "forceid.kalman.process",
}
__all__ = [
    "Engine", "Filtered", "Smoothed", "StateSpace", "engine", "filter", "log_likelihood", "smooth", *_LAZY,
]  # fmt: skip

if TYPE_CHECKING:
    from forceid.kalman.process import Process as Process
    from forceid.kalman.process import discretize as discretize
    from forceid.kalman.process import integrate as integrate
    from forceid.kalman.process import matern as matern
    from forceid.kalman.process import with_mean as with_mean

_engine = engine  # the keyword below has the same name


def filter(model: StateSpace, z: Array, engine: str = "auto") -> Filtered:
    """Kalman filter over z (time, channel) or (time,), NaN = missing; engine as in `kalman.engine`.

    Raises EstimationError where an innovation covariance is not positive definite.
    """
    return _engine(engine).filter(model, z)


def smooth(model: StateSpace, z: Array, engine: str = "auto") -> Smoothed:
    """Fixed-interval smoother over z (time, channel) or (time,), NaN = missing; engine as in `kalman.engine`.

    Raises EstimationError where an innovation covariance is not positive definite.
    """
    return _engine(engine).smooth(model, z)


def log_likelihood(model: StateSpace, z: Array, engine: str = "auto") -> Array:
    """Log-likelihood of z (time, channel) or (time,); of each of many models, z (time, model, channel).

    Raises EstimationError where an innovation covariance is not positive definite.
    """
    return _engine(engine).log_likelihood(model, z)


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'forceid.kalman' has no attribute '{name}'")
    return getattr(import_module(_LAZY[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
