"""What markers show beyond the rigid motion, and how likely it is in a few shapes under a dynamic prior."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from forceid.estimation.deformation import ORDER
from forceid.estimation.kinematics import Kinematics
from forceid.kalman.channels import driven, load_chain, start_of
from forceid.kalman.engines import Engine
from forceid.kalman.passes import LOG_2PI
from forceid.kalman.tuning import tune_loads
from forceid.motion.pose import body_axes, fit_rotation
from forceid.principal.operator import summation_operator
from forceid.records import Array, Flags

CHANCE = 0.01  # of a veto where the level is right
LAGS = 10  # of the autocorrelation of what a level leaves


def often_seen(position: Array, seen: Flags) -> Flags:
    """Markers (node,) that at least half of the frames show together: the least seen go first."""
    visible = np.all(np.isfinite(position), axis=2)
    kept = seen.copy()
    while kept.sum() > 3 and 2 * visible[:, kept].all(1).sum() < len(visible):
        kept[np.flatnonzero(kept)[visible[:, kept].mean(0).argmin()]] = False
    return kept


def beyond_rigid(position: Array, kin: Kinematics, kept: Flags) -> tuple[Array, Array]:
    """What no rigid motion explains: y (time, freedom), NaN in frames not whole, and its basis U.

    U (3 node, freedom) is orthonormal and orthogonal to the rigid modes, over the markers kept. The rotation
    is fitted in the mass gauge, in which the deformation of a frame is linear in its shapes, however large.
    """
    weight = kin.inertia.weight * kept
    if (weight > 0).sum() < 4:
        weight = kept.astype(float)
    x = np.where(kept[:, None], position, np.nan)
    center, R = fit_rotation(x, kin.shape, weight)
    residual = body_axes(x, center, R) - kin.shape
    S = summation_operator(kin.shape[kept])
    left, size, _ = np.linalg.svd(S, full_matrices=True)
    U = left[:, int((size > 1e-9 * size[0]).sum()) :]
    return residual[:, kept].reshape(len(x), -1) @ U, U


def principal_axes(y: Array, shapes: Array) -> Array:
    """Orthonormal basis (freedom, mode) of the span of shapes (mode, freedom), axes of y (time, freedom).

    Along its own axes a motion has amplitudes that do not correlate, as separate priors take for granted.
    """
    if not len(shapes):
        return np.zeros((y.shape[1], 0))
    basis, size, _ = np.linalg.svd(shapes.T, full_matrices=False)
    basis = basis[:, size > 1e-6 * size[0]]
    q = (y @ basis)[np.isfinite(y).all(1)]
    return np.asarray(basis @ np.linalg.eigh(q.T @ q)[1][:, ::-1])


def dynamic_gain(time: Array, q: Array, var: float, engine: Engine) -> tuple[float, float]:
    """Log-likelihood of amplitudes q (time, mode) under tuned dynamic priors over that of white noise.

    And their mean NIS. var: of the noise in each amplitude.
    """
    if not q.shape[1]:
        return 0.0, 1.0
    noise, none = np.full_like(q, var), np.zeros(q.shape[1])
    tuned = tune_loads(time, q, 1.0, noise, none, orders=(ORDER,), engine=engine)
    start = start_of(time, q, 1.0)
    models = driven(load_chain(ORDER, tuned.std, tuned.rate, start), 1.0, noise, none, np.diff(time))
    paths = [engine.filter(models.one(j), q[:, j]) for j in range(q.shape[1])]
    white = -0.5 * float(np.nansum(q**2 / var + np.log(var) + LOG_2PI + 0 * q))
    nis = float(np.mean([np.nanmean(path.nis) for path in paths]))
    return sum(float(path.log_likelihood) for path in paths) - white, nis


def correlation(left: Array, dof: int) -> tuple[float, bool]:
    """Largest autocorrelation of what a level leaves (time, freedom), and whether it is beyond chance."""
    if dof < 1:
        return 0.0, False
    y = left[np.isfinite(left).all(1)]
    power = float((y**2).sum())
    lags = range(1, min(LAGS, len(y) // 2) + 1)
    r = np.array([float((y[k:] * y[:-k]).sum()) for k in lags]) / max(power, 1e-300)
    portmanteau = float((r**2).sum()) * len(y) * dof
    return float(r[np.abs(r).argmax()]), bool(portmanteau > chdtri(len(r), CHANCE))
