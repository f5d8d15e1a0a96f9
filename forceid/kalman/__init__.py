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

from forceid.kalman.bounds import Steady as Steady
from forceid.kalman.bounds import driven_load_bound as driven_load_bound
from forceid.kalman.bounds import steady as steady
from forceid.kalman.building.lines import Line as Line
from forceid.kalman.building.process import Process as Process
from forceid.kalman.building.process import discretize as discretize
from forceid.kalman.building.process import integrate as integrate
from forceid.kalman.building.process import integrated_wiener as integrated_wiener
from forceid.kalman.building.process import matern as matern
from forceid.kalman.building.process import random_walk as random_walk
from forceid.kalman.building.process import resonator as resonator
from forceid.kalman.building.process import superpose as superpose
from forceid.kalman.building.sensors import colored as colored
from forceid.kalman.building.sensors import sensor_rows as sensor_rows
from forceid.kalman.building.sensors import specific_force as specific_force
from forceid.kalman.building.sensors import state_space as state_space
from forceid.kalman.building.structure import Structure as Structure
from forceid.kalman.building.structure import System as System
from forceid.kalman.building.structure import discretize_input as discretize_input
from forceid.kalman.building.structure import drive as drive
from forceid.kalman.building.structure import modal as modal
from forceid.kalman.engines import Engine as Engine
from forceid.kalman.engines import engine as engine
from forceid.kalman.inputs.input_smoothing import InputSmoothed as InputSmoothed
from forceid.kalman.inputs.input_smoothing import input_smoother as input_smoother
from forceid.kalman.inputs.unknown_input import InputFiltered as InputFiltered
from forceid.kalman.inputs.unknown_input import input_filter as input_filter
from forceid.kalman.model import Filtered as Filtered
from forceid.kalman.model import Gains as Gains
from forceid.kalman.model import Smoothed as Smoothed
from forceid.kalman.model import StateSpace as StateSpace
from forceid.kalman.observability import gramian as gramian
from forceid.kalman.observability import invariant_zeros as invariant_zeros
from forceid.kalman.observability import pbh as pbh
from forceid.kalman.observability import prior_only as prior_only
from forceid.kalman.observability import variance_ratio as variance_ratio
from forceid.kalman.tuning.calibration import Consistency as Consistency
from forceid.kalman.tuning.calibration import chi_square_band as chi_square_band
from forceid.kalman.tuning.calibration import consistency as consistency
from forceid.kalman.tuning.calibration import nees as nees
from forceid.kalman.tuning.fit import Fit as Fit
from forceid.kalman.tuning.fit import tune as tune
from forceid.kalman.tuning.gradient import Score as Score
from forceid.kalman.tuning.gradient import score as score
from forceid.kalman.tuning.robust import Rejection as Rejection
from forceid.kalman.tuning.robust import reject as reject
from forceid.kalman.tuning.robust import unswap as unswap
from forceid.records import Array

_engine = engine  # the keyword below has the same name


def filter(model: StateSpace, z: Array, engine: str = "auto") -> Filtered:
    """Kalman filter over z (time, channel) or (time,), NaN = missing; engine as in `kalman.engine`.

    Many signals of one model at once: z (time, signal, channel).

    Raises EstimationError where an innovation covariance is not positive definite.
    """
    return _engine(engine).filter(model, z)


def smooth(model: StateSpace, z: Array, engine: str = "auto") -> Smoothed:
    """Fixed-interval smoother over z (time, channel) or (time,), NaN = missing; engine as in `kalman.engine`.

    Many signals of one model at once: z (time, signal, channel).

    Raises EstimationError where an innovation covariance is not positive definite.
    """
    return _engine(engine).smooth(model, z)


def log_likelihood(model: StateSpace, z: Array, engine: str = "auto") -> Array:
    """Log-likelihood of z (time, channel) or (time,); of many models or signals, z (time, ., channel).

    Raises EstimationError where an innovation covariance is not positive definite.
    """
    return _engine(engine).log_likelihood(model, z)
