"""What markers show beyond the rigid motion, and how likely it is in a few shapes under a dynamic prior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space
from scipy.special import chdtri

from forceid.estimation.body.kinematics import Kinematics
from forceid.flight.channels import driven, load_chain, start_of
from forceid.flight.tuning import MIDDLE, tune_loads
from forceid.kalman.engines import Engine
from forceid.kalman.recursions.passes import LOG_2PI
from forceid.motion import ORDER as DIFFERENCES
from forceid.motion import body_axes, fit_rotation, noise_variance
from forceid.principal import summation_operator
from forceid.records import Array, Flags, Motion
from forceid.rounding import SINGLE, SOLVED
from forceid.significance import CHANCE, LAGS


@dataclass(frozen=True)
class Beyond:
    """What no rigid motion explains, over the markers kept (node,).

    time (time,) s; y (time, freedom) m, NaN in frames not whole; basis (3 node, freedom) of y, orthonormal,
    orthogonal to the rigid modes; var m2: of the noise in each.
    """

    time: Array
    y: Array
    basis: Array
    kept: Flags
    var: float

    @property
    def frames(self) -> int:
        """Frames that are whole."""
        return int(np.isfinite(self.y).all(1).sum())

    def of(self, shapes: Array) -> Array:
        """What shapes (mode, node, 3) look like in y: (mode, freedom)."""
        return np.asarray(shapes[:, self.kept].reshape(len(shapes), len(self.basis)) @ self.basis)


def often_seen(position: Array, seen: Flags) -> Flags:
    """Markers (node,) that at least half of the frames show together: the least seen go first."""
    visible = np.all(np.isfinite(position), axis=2)
    kept = seen.copy()
    while kept.sum() > 3 and 2 * visible[:, kept].all(1).sum() < len(visible):
        kept[np.flatnonzero(kept)[visible[:, kept].mean(0).argmin()]] = False
    return kept


def beyond_rigid(time: Array, position: Array, kin: Kinematics) -> Beyond:
    """What markers at `position` (time, node, 3) m do beside moving as one.

    The rotation is fitted in the mass gauge, in which the deformation of a frame is linear in its shapes,
    however large.
    """
    kept = often_seen(position, kin.seen)
    weight = kin.inertia.weight * kept
    if (weight > 0).sum() < 4:
        weight = kept.astype(float)
    x = np.where(kept[:, None], position, np.nan)
    center, R = fit_rotation(x, kin.shape, weight)
    residual = body_axes(x, center, R) - kin.shape
    S = summation_operator(kin.shape[kept])
    left, size, _ = np.linalg.svd(S, full_matrices=True)
    U = left[:, int((size > SOLVED * size[0]).sum()) :]
    return Beyond(time, residual[:, kept].reshape(len(x), -1) @ U, U, kept, kin.noise["position"] ** 2)


def noise_beyond(kin: Kinematics, motion: Motion) -> float:
    """Factor on the noise of the markers: to what high-order differences show where no shape moves them.

    One where shapes and rigid motion together move the markers in all directions, or few frames are whole.
    """
    if motion.measured is None:
        return 1.0
    seen = beyond_rigid(motion.time, motion.measured, kin)
    left = seen.y @ null_space(seen.of(kin.shapes), rcond=SINGLE)
    if not left.shape[1] or seen.frames < 2 * DIFFERENCES:
        return 1.0
    return float(np.sqrt(noise_variance(motion.time, left) / seen.var))


def principal_axes(y: Array, directions: Array) -> Array:
    """Orthonormal basis (freedom, mode) of the span of directions (mode, freedom), axes of y (time, freedom).

    Along its own axes a motion has amplitudes that do not correlate, as separate priors take for granted.
    """
    if not len(directions):
        return np.zeros((y.shape[1], 0))
    basis, size, _ = np.linalg.svd(directions.T, full_matrices=False)
    basis = basis[:, size > SINGLE * size.max(initial=0.0)]
    q = (y @ basis)[np.isfinite(y).all(1)]
    return np.asarray(basis @ np.linalg.eigh(q.T @ q)[1][:, ::-1])


def dynamic_gain(time: Array, q: Array, var: float, engine: Engine) -> tuple[Array, Array]:
    """Log-likelihood of each amplitude q (time, mode) under a tuned dynamic prior over that of white noise.

    And its mean NIS; both (mode,). var: of the noise in each amplitude.
    """
    modes = q.shape[1]
    if not modes:
        return np.zeros(0), np.zeros(0)
    noise, none = np.full_like(q, var), np.zeros(modes)
    tuned = tune_loads(time, q, 1.0, noise, none, orders=(MIDDLE,), engine=engine)
    chain = load_chain(tuned.kernel.process, start_of(time, q, 1.0))
    models = driven(chain, 1.0, noise, none, np.diff(time))
    paths = [engine.filter(models.one(j), q[:, j]) for j in range(modes)]
    white = -0.5 * np.nansum(q**2 / var + np.log(var) + LOG_2PI + 0 * q, axis=0)
    dynamic, nis = np.array([(path.log_likelihood, np.nanmean(path.nis)) for path in paths]).T
    return dynamic - white, nis


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
