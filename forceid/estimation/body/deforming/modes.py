"""u = R alpha + Phi q: what is deformation and what is mean motion, and the shapes that deform."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, eigh

from forceid.estimation.body.deforming.mode_selection import log_evidence, observed_shapes
from forceid.motion import ReadingCov, body_axes, fit_rotation, frames_seen_alike, log
from forceid.principal import summation_operator
from forceid.records import Array, all_finite
from forceid.rounding import SOLVED

LAG_TURN = 0.5  # rad: over less of a turn, the noise of the rotations would pass for spin


@dataclass(frozen=True)
class Modes:
    """Shapes (mode, node, 3) in which a body deforms, and the compliance (mode,) that holds them.

    compliance: amplitude under a steady unit load, 1 / W^2 s2 of a mass-normalized shape; None if unknown.
    """

    shape: Array
    compliance: Array | None = None


def given_modes(shape: Array, frequency: Array | None, mass: Array, position: Array) -> Modes:
    """Modes from shapes (mode, node, 3) in any scale and gauge, and their frequencies (mode,) Hz if known.

    mass (node,) or (dof, dof). The shapes are put into the mass gauge at `position`, and scaled to unit
    modal mass where they have any.
    """
    flat = split_rigid(shape, position, mass)[1].reshape(len(shape), -1)
    Mf = flat * np.repeat(mass, 3) if mass.ndim == 1 else flat @ mass
    modal = np.einsum("ki,ki->k", flat, Mf)
    known = frequency is not None and (frequency > 0).all() and (modal > 0).all()
    scale = 1 / np.sqrt(modal) if known else np.ones(len(shape))
    compliance = (2 * np.pi * frequency) ** -2.0 if known and frequency is not None else None
    return Modes((scale[:, None] * flat).reshape(shape.shape), compliance)


def elastic_modes(mass: Array, stiffness: Array, position: Array) -> Modes:
    """Elastic modes of a free body, mass-normalized, in the mass gauge, lowest frequency first.

    mass (node,) kg or (dof, dof); stiffness (dof, dof) N/m of the free body, K S = 0 and no mechanism;
    position (node, 3) m. From the flexibility P K^- P^T with P = I - R M_alpha^-1 R^T M, which holds no
    rigid motion to the last digit; nodes without mass follow statically, and make no mode of their own.
    Source: principal equations 2.5, 2.9.
    """
    R = summation_operator(position - position.mean(0))
    M = np.diag(np.repeat(mass, 3)) if mass.ndim == 1 else mass
    MR = M @ R
    P = np.eye(len(M)) - R @ np.linalg.solve(R.T @ MR, MR.T)
    Q = np.linalg.qr(R)[0]
    held = cho_factor(stiffness + np.trace(stiffness) / len(M) * Q @ Q.T)
    flexibility = P @ cho_solve(held, P.T)
    size, axes = np.linalg.eigh(M)
    keep = size > 1e-12 * size[-1]
    root = axes[:, keep] * np.sqrt(size[keep])
    compliance, y = eigh(root.T @ flexibility @ root)
    elastic = np.arange(len(compliance))[::-1][: len(compliance) - 6]
    shape = flexibility @ root @ (y[:, elastic] / compliance[elastic])
    return Modes(shape.T.reshape(len(elastic), *position.shape), compliance[elastic])


def split_rigid(u: Array, position: Array, weight: Array) -> tuple[Array, Array]:
    """Amplitudes alpha (..., 6) and deformation (..., node, 3) of a displacement u (..., node, 3).

    alpha = (R^T W R)^-1 R^T W u with R the rigid-body modes at `position` (node, 3), W = diag(weight) of
    weight (node,), or the weight itself if it is (dof, dof).
    """
    R = summation_operator(position)
    WR = np.repeat(weight, 3)[:, None] * R if weight.ndim == 1 else weight @ R
    flat = u.reshape(*u.shape[:-2], -1)
    alpha = flat @ np.linalg.solve(R.T @ WR, WR.T).T
    return alpha, (flat - alpha @ R.T).reshape(u.shape)


def mean_shape(position: Array, shape: Array, weight: Array) -> Array:
    """Mean shape (node, 3) of a moving body in its own axes; nodes never seen keep the reference shape.

    Of a spinning body it is the shape it spins with, which differs from the one at rest. Only frames that
    show every weighted node enter, where there are any. Source: principal equations 4d.
    """
    seen = all_finite(position)
    ever = np.any(seen, axis=0)
    whole = np.all(seen[:, ever & (weight > 0)], axis=1)
    frames = position[whole] if whole.sum() >= 3 else position
    ever = np.any(all_finite(frames), axis=0)
    mean, gaps = shape.copy(), not np.isfinite(frames[:, ever]).all()
    tracks = frames[:, ever].swapaxes(0, 1).reshape(ever.sum(), -1)  # (node, time and axis)
    for _ in range(3):
        center, R = fit_rotation(frames, mean, weight)
        if gaps:
            mean[ever] = np.nanmean(body_axes(frames, center, R)[:, ever], axis=0)
        else:  # of R^T (x - c) in one product
            mean[ever] = (tracks @ R.reshape(-1, 3) - np.einsum("ta,tab->b", center, R)) / len(R)
    return mean


def deflected_shape(
    time: Array, position: Array, shape: Array, modes: Modes, mass: Array, weight: Array, noise_var: float
) -> Array:
    """Mean shape (node, 3) of a moving body that carries mass where it carries no marker.

    The markers where they are seen, the other nodes as the modes take them: bent by the mean spin, corrected
    by what the markers show, see `steady_amplitudes`. time (time,) s; position (time, node, 3) m; shape
    (node, 3) without load, about the mass center; mass (node,) or (dof, dof), of the gauge; weight (node,),
    of the rotation fit; noise_var m2 of a coordinate. Source: principal equations 2.5, 4d.
    """
    frames = all_finite(position).sum(0)
    ever = frames > 0
    observed = observed_shapes(ever, shape, modes.shape)
    noise = observed.axes.T * np.repeat(noise_var / frames[ever], 3) @ observed.axes
    bent = shape
    for _ in range(3):
        center, R = fit_rotation(position, bent, weight)
        seen = np.zeros_like(shape)
        seen[ever] = np.nanmean(body_axes(position, center, R)[:, ever], axis=0) - shape[ever]
        expected = spinning_amplitudes(modes, mass, shape, mean_spin(time, R))
        q = steady_amplitudes(observed.of(seen), noise, observed.of(modes.shape), modes.compliance, expected)
        u = np.tensordot(q, modes.shape, 1)
        u[ever] += split_rigid(seen - u, shape, ever.astype(float))[1][ever]
        bent = shape + split_rigid(u, shape, mass)[1]
    return np.asarray(bent)


def mean_spin(time: Array, rotation: Array) -> Array:
    """Mean of w w^T (3, 3) rad2/s2, body axes, from rotations (time, 3, 3) that turn by about LAG_TURN."""
    turn = np.linalg.norm(log(rotation[:-1].mT @ rotation[1:]), axis=1)
    lag = int(np.clip(LAG_TURN / max(np.median(turn), 1e-9), 1, len(time) - 1))
    omega = log(rotation[:-lag].mT @ rotation[lag:]) / (time[lag:] - time[:-lag])[:, None]
    return np.asarray(omega.T @ omega / len(omega))


def principal_deformations(residual: Array, noise_var: float, most: int | None = None) -> tuple[Array, Array]:
    """Orthonormal shapes (mode, node, 3) that a residual (time, node, 3) takes, and their variances (mode,).

    Only shapes that stand out of white marker noise: above the largest eigenvalue that noise alone
    gives (Johnstone 2001), exceeded by chance in one record of a hundred; the first `most`, if given.
    """
    frames = residual[np.isfinite(residual).all((1, 2))].reshape(-1, residual.shape[1] * 3)
    if len(frames) < 2:
        return np.zeros((0, *residual.shape[1:])), np.zeros(0)
    wide = len(frames) < frames.shape[1]
    variance, axes = np.linalg.eigh((frames @ frames.T if wide else frames.T @ frames) / len(frames))
    variance, axes = variance[::-1], axes[:, ::-1]
    root_n, root_p = np.sqrt(frames.shape)
    edge = (root_n + root_p) ** 2
    width = (root_n + root_p) * (1 / root_n + 1 / root_p) ** (1 / 3)
    count = int((len(frames) * variance > noise_var * (edge + 2 * width)).sum())
    if most is not None:
        count = min(most, int((variance > SOLVED * variance[0]).sum()))  # frames show no more shapes
    shapes = axes[:, :count].T
    if wide:
        shapes = shapes @ frames / np.sqrt(len(frames) * variance[:count, None])
    return shapes.reshape(count, *residual.shape[1:]), np.maximum(variance[:count] - noise_var, 0.0)


def fit_amplitudes(
    residual: Array,
    shapes: Array,
    rigid: Array,
    noise: ReadingCov,
    own: Array | None = None,
    loose: Array | None = None,
) -> tuple[Array, Array]:
    """Amplitudes q (time, mode) of shapes (mode, node, 3) and their noise variance, NaN where not determined.

    noise: of the readings; own (time, node) m2: variance of single ones beside. Fitted together with the six
    rigid modes `rigid` (3 node, 6), so that no error of the pose enters: the markers seen in a frame must fix
    all of them, or q is NaN there. loose (mode,) m2: of amplitudes that are known beforehand to be of that
    variance, any number of which may be fitted.
    """
    T, count = len(residual), len(shapes)
    q, var = np.full((T, count), np.nan), np.full((T, count), np.nan)
    if not count:
        return q, var
    G = np.concatenate([rigid, shapes.reshape(count, len(rigid)).T], 1)
    held = np.zeros((0, count)) if loose is None else np.diag(np.maximum(loose, np.finfo(float).tiny) ** -0.5)
    held = np.pad(held, ((0, 0), (6, 0)))
    fitted = G if loose is None else rigid
    for pattern, more, at in frames_seen_alike(residual, own):
        rows = np.repeat(pattern, 3)
        if rows.sum() < fitted.shape[1] or np.linalg.matrix_rank(fitted[rows], rtol=1e-6) < fitted.shape[1]:
            continue
        seen = noise.seen(pattern, more)
        fit = np.linalg.pinv(np.concatenate([seen.whitened(G[rows].T).T, held]))[6:]
        told = seen.reading(fit[:, : rows.sum()])
        every = residual if len(at) == T else residual[at]
        q[at] = (every if pattern.all() else every[:, pattern]).reshape(len(at), -1) @ told.T
        var[at] = (fit**2).sum(1)
    return q, var


def spinning_amplitudes(modes: Modes, mass: Array, position: Array, square: Array) -> Array:
    """Amplitudes (mode,) that a steady spin gives the modes: K u = M (w^2 I - w w^T) X.

    square (3, 3) rad2/s2: mean of w w^T, body axes; position (node, 3) m about the mass center. None where
    no compliance is known.
    """
    if modes.compliance is None:
        return np.zeros(len(modes.shape))
    pull = position @ (np.trace(square) * np.eye(3) - square)
    M = np.repeat(mass, 3) * pull.ravel() if mass.ndim == 1 else mass @ pull.ravel()
    return np.asarray(modes.compliance * (modes.shape.reshape(len(modes.shape), -1) @ M))


def steady_amplitudes(
    observed: Array, noise_var: Array, directions: Array, compliance: Array | None, expected: Array
) -> Array:
    """Amplitudes (mode,) of a steady displacement, of which markers show `shown` (shown,).

    About those that are expected, or about none, whichever the markers make more likely, under unknown
    loads alike on all modes: variance (scale * compliance)^2, with the scale of most evidence. noise_var
    (shown, shown) of what is shown. So a mode that no marker shows stays where it is expected.
    """
    noise = np.linalg.cholesky(noise_var)
    D, y = np.linalg.solve(noise, directions.T).T, np.linalg.solve(noise, observed)
    soft = np.ones(len(D)) if compliance is None else compliance**2
    unit = np.trace(D.T @ (soft[:, None] * D)) / len(y)
    best, found = -np.inf, expected
    for start in (np.zeros_like(expected), expected):
        left = y - start @ D
        for var in soft * (np.outer(left, left).trace() / len(y) / unit * np.logspace(-6, 1, 36))[:, None]:
            value = log_evidence(np.outer(left, left), 1, D, var, np.eye(len(y)))
            if value > best:
                V = np.eye(len(y)) + D.T @ (var[:, None] * D)
                best, found = value, start + var * (D @ np.linalg.solve(V, left))
    return np.asarray(found)
