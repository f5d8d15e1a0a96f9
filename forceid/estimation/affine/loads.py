"""Force and the nine first moments of force on a body that deforms affinely, x = c + F X.

The center and the columns of F E V, with E the second moment and V the axes in which their errors are
independent, are channels that a load drives: m c'' = f + m g and (F E)'' = K. K turns with the body, whose
spin it holds whole, so its prior is one along axes of the body. Then N_E = K F^T, the Euler tensor of all
that acts. Source: pseudo-rigid bodies, section 1; principal equations 4e.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.config import Settings, load_settings
from forceid.errors import ForceIdError
from forceid.estimation.affine.applied import applied_moments, row_by_row
from forceid.estimation.affine.channels import AffineChannels, affine_channels, aligned_basis, along_axes
from forceid.estimation.affine.priors import tune_channels
from forceid.estimation.affine.smoothing import smooth_channels
from forceid.estimation.body.material import Solid
from forceid.estimation.verdict.catalogue import note
from forceid.flight.priors.protocol import LoadPrior
from forceid.kalman.engines import Engine, engine
from forceid.records import Array, Finding, Flags, Recording


@dataclass(frozen=True)
class AffineLoads:
    """Affine motion and its loads, world axes, F from reference axes; covariances of matrices row by row.

    time (time,) s; center (time, 3) m; force (time, 3) N, weight excluded, force_cov (time, 3, 3); F, dF 1/s
    and ddF 1/s2 (time, 3, 3), F_cov (time, 9, 9); stretch (time, 3, 3): U of F = R U, of markers in a plane
    that of the plane; first_moment (time, 3, 3) N m: F'' E F^T about the mass center, of all forces on the
    body, those in it too, row: of the force, column: of its arm; first_moment_cov (time, 9, 9).
    applied_first_moment and its covariance: of the forces applied alone, where the material is known.

    What markers leave open is NaN, and `findings` say which and why. What is known then of the first moments:
    arm_moment (time, 3, arm) N m = F'' E arms, of the force along world axes and its arm along reference
    directions arms (3, arm), where the arm was in the reference; arm_moment_cov (time, 3 arm, 3 arm).
    span (3, arm): orthonormal reference directions along which F is known, spanned (time, 3, arm) = F span.
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
    findings: tuple[Finding, ...] = ()
    arms: Array | None = None
    arm_moment: Array | None = None
    arm_moment_cov: Array | None = None
    span: Array | None = None
    spanned: Array | None = None

    @property
    def reasons(self) -> tuple[str, ...]:
        """The sentences of the findings."""
        return tuple(finding.text for finding in self.findings)

    @property
    def moment(self) -> Array:
        """Moment (time, 3) N m about the mass center: what is antisymmetric in the first moments."""
        return moment_of(self.first_moment)

    @property
    def moment_cov(self) -> Array:
        """Covariance (time, 3, 3) of the moment."""
        return np.asarray(MOMENT @ self.first_moment_cov @ MOMENT.T)


def affine_loads(
    recording: Recording, settings: Settings | None = None, solid: Solid | None = None
) -> AffineLoads:
    """Force and first moments of an affine body from the markers of a recording.

    solid: the material of the whole body, to tell applied from inner forces, smooth along `load_axes`. What
    markers in a plane leave open is NaN, with reasons. Raises DataError where they lie on a line;
    EstimationError for too short a record. Source: pseudo-rigid bodies, section 1.
    """
    settings = load_settings() if settings is None else settings
    chosen = engine(settings.engine)
    channels = affine_channels(recording, settings)
    loads = smooth_affine(channels, tune_channels(channels, chosen), chosen)
    return (
        loads if solid is None else with_stress(loads, channels, solid, settings.load_axes == "body", chosen)
    )


def with_stress(
    loads: AffineLoads, channels: AffineChannels, solid: Solid, body_axes: bool, chosen: Engine
) -> AffineLoads:
    """The loads with the first moments applied: K F^T, of F'' E = K - P with the stress P of the material.

    F follows better with it, and so does all that acts, (K - P) F^T. body_axes: see `applied_moments`.
    """
    if not (along_axes(channels.span).all() and channels.whole):
        return replace(loads, findings=(*loads.findings, note("stress-open")))
    try:
        found = applied_moments(channels, loads.F, loads.dF, solid, body_axes, chosen)
        P, (by_F, by_dF) = solid.stress(found.F, found.dF), solid.slopes(found.F, found.dF)
    except ForceIdError as e:
        return replace(loads, findings=(*loads.findings, note("no-applied-moments", error=str(e))))
    turned = row_by_row(np.eye(3), found.F.mT)

    def changes(K: Array) -> Array:
        """Of K F^T by F."""
        return np.asarray(np.einsum("bd,tac->tabdc", np.eye(3), K).reshape(-1, 9, 9))

    by_own = np.concatenate([turned, changes(found.K), np.zeros_like(turned)], 2)
    by_all = np.concatenate([turned, changes(found.K - P) - turned @ by_F, -turned @ by_dF], 2)
    return replace(
        loads, F=found.F, F_cov=found.cov[:, 9:18, 9:18], dF=found.dF,
        ddF=(found.K - P) @ np.linalg.inv(channels.second_moment), stretch=right_stretch(found.F, np.eye(3)),
        first_moment=(found.K - P) @ found.F.mT, first_moment_cov=by_all @ found.cov @ by_all.mT,
        applied_first_moment=found.K @ found.F.mT, applied_first_moment_cov=by_own @ found.cov @ by_own.mT,
    )  # fmt: skip


def smooth_affine(channels: AffineChannels, priors: list[LoadPrior], chosen: Engine) -> AffineLoads:
    """Force and first moments under given priors, of the force where it is shown and of columns of K."""
    s = smooth_channels(channels, priors, chosen)
    V, E, span = channels.axes, channels.second_moment, channels.span
    T, n, first = len(s.k), V.shape[1], int(channels.center is not None)
    entry = np.arange(s.cov.shape[1]).reshape(2, 3, n + first)  # of k and z: axis, group
    columns = entry[..., first:].ravel()
    cov = s.cov[:, columns[:, None], columns]
    k, z, rate = (a[..., first:] for a in (s.k, s.z, s.rate))
    center, force, force_cov = np.full((T, 3), np.nan), np.full((T, 3), np.nan), np.full((T, 3, 3), np.nan)
    if first:
        own = entry[0, :, 0]
        center, force, force_cov = s.z[..., 0], s.k[..., 0], s.cov[:, own[:, None], own]
    to_span, eye = np.linalg.inv(span.T @ E @ V), np.eye(3)
    known = along_axes(span)
    F, dF, ddF = (mask_unobserved(a @ to_span @ span.T, known) for a in (z, rate, k))
    by_F = np.kron(eye, span @ to_span.T)
    F_cov = by_F @ cov[:, 3 * n :, 3 * n :] @ by_F.T
    N, N_cov = first_moments(k, z, cov, np.asarray(np.linalg.inv(V.T @ E @ V)))
    N, N_cov = (N, N_cov) if channels.whole else (np.full_like(N, np.nan), np.full_like(N_cov, np.nan))
    arms = aligned_basis(V)
    by_arm = np.kron(eye, arms.T @ V)
    return AffineLoads(
        channels.time, center, force, force_cov, F, mask_unobserved_cov(F_cov, known), dF, ddF,
        mask_unobserved(mask_unobserved(right_stretch(z @ to_span, span), known).mT, known).mT,
        N, N_cov, s.log_likelihood, findings=channels.findings,
        arms=arms, arm_moment=k @ V.T @ arms, arm_moment_cov=by_arm @ cov[:, : 3 * n, : 3 * n] @ by_arm.T,
        span=span, spanned=z @ to_span,
    )  # fmt: skip


def first_moments(k: Array, z: Array, cov: Array, A: Array) -> tuple[Array, Array]:
    """N = k A z^T (time, 3, 3), and its covariance (time, 9, 9).

    k, z (time, 3, n) with cov (time, 6 n, 6 n) of both, row by row; A (n, n).
    """
    T, n = len(k), k.shape[2]
    eye = np.eye(3)
    by_k = np.einsum("ac,tbB->tabcB", eye, z @ A).reshape(T, 9, 3 * n)
    by_z = np.einsum("bc,taB->tabcB", eye, k @ A).reshape(T, 9, 3 * n)
    both = np.concatenate([by_k, by_z], 2)
    linked = cov[:, : 3 * n, 3 * n :].reshape(T, 3, n, 3, n)
    return k @ A @ z.mT + np.einsum("taBbC,BC->tab", linked, A), both @ cov @ both.mT


def right_stretch(columns: Array, span: Array) -> Array:
    """Stretch (time, 3, 3), reference axes, of F where F span (3, n) = columns (time, 3, n), zero across."""
    square, turn = np.linalg.eigh(columns.mT @ columns)
    U = (turn * np.sqrt(np.maximum(square, 0.0))[:, None]) @ turn.mT
    return np.asarray(span @ U @ span.T)


def mask_unobserved(matrix: Array, known: Flags) -> Array:
    """A matrix (time, 3, 3), NaN in the columns of reference axes that are not known."""
    return np.asarray(np.where(known, matrix, np.nan))


def mask_unobserved_cov(cov: Array, known: Flags) -> Array:
    """Covariance (time, 9, 9) of such a matrix, NaN where it is open."""
    entries = np.tile(known, 3)
    return np.asarray(np.where(entries & entries[:, None], cov, np.nan))


MOMENT = np.zeros((3, 9))  # takes first moments, row by row, to the moment: r x f, of f r^T
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    MOMENT[_i, 3 * _k + _j], MOMENT[_i, 3 * _j + _k] = 1.0, -1.0


def moment_of(first_moment: Array) -> Array:
    """Moment (..., 3) N m of first moments (..., 3, 3), f r^T: r x f.

    >>> moment_of(np.outer([0.0, 2.0, 0.0], [0.5, 0.0, 0.0])).tolist()
    [0.0, 0.0, 1.0]
    """
    return np.asarray(first_moment.reshape(*first_moment.shape[:-2], 9) @ MOMENT.T)
