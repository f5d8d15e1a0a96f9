"""Force and the nine first moments of force on a body that deforms affinely, x = c + F X.

The center and the three columns of F E V, with E the second moment and V the axes in which their errors are
independent, are channels that a load drives: m c'' = f + m g and (F E)'' = K. K turns with the body, whose
spin it holds whole, so its prior is one along axes of the body. Then N_E = K F^T, the Euler tensor of all
that acts. Source: pseudo-rigid bodies, section 1; principal equations 4e.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.config import Settings, load_settings
from forceid.errors import EstimationError
from forceid.estimation.affine_channels import AffineChannels, affine_channels, tune_channels
from forceid.kalman.engines import Engine, engine
from forceid.kalman.model import StateSpace
from forceid.kalman.prior import LoadPrior, channel_model
from forceid.kalman.process import block_diagonal
from forceid.pseudorigid.decomposition import polar
from forceid.pseudorigid.materials import Material
from forceid.records import Array, Recording

APART = 1e-6  # correlation of two groups of channels that is none


@dataclass(frozen=True)
class AffineLoads:
    """Affine motion and its loads, world axes, F from reference axes; covariances of matrices row by row.

    time (time,) s; center (time, 3) m; force (time, 3) N, weight excluded, force_cov (time, 3, 3); F, dF 1/s
    and ddF 1/s2 (time, 3, 3), F_cov (time, 9, 9); stretch (time, 3, 3): U of F = R U; first_moment (time, 3,
    3) N m: F'' E F^T about the mass center, of all forces on the body, those in it too, row: of the force,
    column: of its arm; first_moment_cov (time, 9, 9). applied_first_moment and its covariance: of the forces
    applied alone, where the material is known.
    """

    time: Array
    center: Array
    force: Array
    force_cov: Array
    F: Array
    F_cov: Array
    dF: Array
    ddF: Array
    stretch: Array
    first_moment: Array
    first_moment_cov: Array
    log_likelihood: float
    applied_first_moment: Array | None = None
    applied_first_moment_cov: Array | None = None

    @property
    def moment(self) -> Array:
        """Moment (time, 3) N m about the mass center: what is antisymmetric in the first moments."""
        return moment_of(self.first_moment)

    @property
    def moment_cov(self) -> Array:
        """Covariance (time, 3, 3) of the moment."""
        return np.asarray(MOMENT @ self.first_moment_cov @ MOMENT.T)


@dataclass(frozen=True)
class SmoothedChannels:
    """Channels z, rates, loads k (time, 3, 4), center first; cov (time, 24, 24) of k, then z, row by row."""

    z: Array
    rate: Array
    k: Array
    cov: Array
    log_likelihood: float


def affine_loads(
    recording: Recording, settings: Settings | None = None, material: Material | None = None
) -> AffineLoads:
    """Force and first moments of an affine body from the markers of a recording.

    material: W of the whole body in J, as in forceid.pseudorigid, to tell applied from inner forces. Raises
    DataError where the markers do not fix F: in a plane, F is known in that plane only; EstimationError for
    too short a record. Source: pseudo-rigid bodies, section 1.
    """
    settings = load_settings() if settings is None else settings
    chosen = engine(settings.engine)
    channels = affine_channels(recording, settings)
    return smooth_affine(channels, tune_channels(channels, chosen), chosen, material)


def smooth_affine(
    channels: AffineChannels, priors: list[LoadPrior], chosen: Engine, material: Material | None = None
) -> AffineLoads:
    """Force and first moments under given priors, of the force and of three columns of K."""
    s = smoothed(channels, priors, chosen)
    V, E_inverse = channels.axes, np.linalg.inv(channels.second_moment)
    back = V.T @ E_inverse
    A = back @ V
    k, z = s.k[..., 1:], s.z[..., 1:]
    F = z @ back
    T = len(F)
    entry = np.arange(24).reshape(2, 3, 4)  # of k and z: axis, group
    columns, center = entry[..., 1:].ravel(), entry[0, :, 0]
    cov = s.cov[:, columns[:, None], columns]
    eye = np.eye(3)
    by_k = np.einsum("ac,tbB->tabcB", eye, z @ A).reshape(T, 9, 9)
    by_z = np.einsum("bc,taB->tabcB", eye, k @ A).reshape(T, 9, 9)
    by_F = np.kron(eye, back.T)
    both = np.concatenate([by_k, by_z], 2)
    N = k @ A @ z.mT + np.einsum("taBbC,BC->tab", cov[:, :9, 9:].reshape(T, 3, 3, 3, 3), A)
    N_cov = both @ cov @ both.mT
    applied = applied_cov = None
    if material is not None:
        gradient = material.gradient(F)
        applied = N + gradient @ F.mT
        units = np.eye(9).reshape(9, 3, 3)
        change = material.hessian(F[:, None], units) @ F[:, None].mT + gradient[:, None] @ units.mT
        both = np.concatenate([by_k, by_z + change.reshape(T, 9, 9).mT @ by_F], 2)
        applied_cov = both @ cov @ both.mT
    return AffineLoads(
        channels.time, s.z[..., 0], s.k[..., 0], s.cov[:, center[:, None], center],
        F, by_F @ cov[:, 9:, 9:] @ by_F.T, s.rate[..., 1:] @ back, k @ back, polar(F)[1],
        N, N_cov, s.log_likelihood, applied, applied_cov,
    )  # fmt: skip


def smoothed(channels: AffineChannels, priors: list[LoadPrior], chosen: Engine) -> SmoothedChannels:
    """The channels smoothed, each group by itself where no error links them, else all in one model."""
    models = [
        channel_model(channel, prior, channels.rotation)
        for channel, prior in zip(channels.groups, priors, strict=True)
    ]
    T, n = len(channels.time), len(models)
    offset = np.stack([g.z[np.isfinite(g.z).all(1)][0] for g in channels.groups])  # (group, 3)
    if channels.linked < APART:
        paths = [chosen.smooth(m, g.moved) for m, g in zip(models, channels.groups, strict=True)]
        total = sum(p.filtered.log_likelihood for p in paths)
    else:
        joint = together(models, channels.noise)
        paths = [chosen.smooth(joint, np.concatenate([g.moved for g in channels.groups], 1))]
        total = paths[0].filtered.log_likelihood
    if not all(np.isfinite(p.x).all() for p in paths):
        raise EstimationError("does not smooth", "the affine motion", "look at the markers for wild samples")
    x, P = np.concatenate([p.x for p in paths], 1), [p.P for p in paths]
    sizes = [m.F.shape[-1] for m in models]
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    read = np.zeros((3, 3, n, sum(sizes)))  # load, channel and rate of every axis and group
    for B, (at, prior) in enumerate(zip(starts, priors, strict=True)):
        for a in range(3):
            # the center's chain runs along the axes of its prior, those of the columns in world axes
            for first, which in ((0, 1), (3, 2), (6, 0), (9, 0)):
                read[which, a, B, at + first : at + first + 3] += prior.axes[a]
        read[1, :, B] *= channels.groups[B].gain
        read[2, :, B] *= channels.groups[B].gain
    k, z, rate = np.einsum("maBs,ts->mtaB", read, x)
    rows = read[:2].reshape(6 * n, -1)
    cov = np.zeros((T, 6 * n, 6 * n))
    for at, size, part in zip(starts, sizes, P, strict=False) if len(P) > 1 else [(0, sum(sizes), P[0])]:
        own = rows[:, at : at + size]
        cov += own @ part @ own.T
    return SmoothedChannels(z + offset.T, rate, k, cov, float(total))


def together(models: list[StateSpace], noise: Array) -> StateSpace:
    """One model of all groups, whose errors noise (time, channel, channel) links."""
    T = len(noise)
    F, Q = (
        block_diagonal(
            *(np.broadcast_to(getattr(m, name), (T - 1, *getattr(m, name).shape[-2:])) for m in models)
        )
        for name in ("F", "Q")
    )
    H = np.zeros((3 * len(models), F.shape[-1]))
    at = 0
    for i, m in enumerate(models):
        H[3 * i : 3 * i + 3, at : at + m.H.shape[1]] = m.H
        at += m.H.shape[1]
    return StateSpace(F, Q, H, noise, np.zeros(at), block_diagonal(*(m.P0 for m in models)))


MOMENT = np.zeros((3, 9))  # takes first moments, row by row, to the moment: r x f, of f r^T
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    MOMENT[_i, 3 * _k + _j], MOMENT[_i, 3 * _j + _k] = 1.0, -1.0


def moment_of(first_moment: Array) -> Array:
    """Moment (..., 3) N m of first moments (..., 3, 3), f r^T: r x f.

    >>> moment_of(np.outer([0.0, 2.0, 0.0], [0.5, 0.0, 0.0])).tolist()
    [0.0, 0.0, 1.0]
    """
    return np.asarray(first_moment.reshape(*first_moment.shape[:-2], 9) @ MOMENT.T)
