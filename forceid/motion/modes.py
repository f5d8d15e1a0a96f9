"""u = R alpha + Phi q: what is deformation and what is mean motion, and the shapes that deform."""

from __future__ import annotations

import numpy as np

from forceid.errors import ConfigError
from forceid.motion.pose import body_axes, fit_rotation
from forceid.principal.operator import summation_operator
from forceid.records import Array, Flags

GAUGES = ("mass", "euclidean", "sensor")


def gauge_weight(gauge: str, mass: Array, seen: Flags) -> Array:
    """Weight (node,) of the complement that `gauge` names: R^T W Phi = 0.

    mass: W = M, the momentum-averaged motion; euclidean: W = I over all nodes; sensor: W = I over the nodes
    that carry a marker, a fit to the markers and not a mean motion. Source: principal equations 2.5.
    """
    if gauge == "mass":
        return mass
    if gauge == "euclidean":
        return np.ones_like(mass)
    if gauge == "sensor":
        return seen.astype(float)
    raise ConfigError(f"is '{gauge}'", "gauge", f"choose one of {', '.join(GAUGES)}")


def split(u: Array, position: Array, weight: Array) -> tuple[Array, Array]:
    """Amplitudes alpha (..., 6) and deformation (..., node, 3) of a displacement u (..., node, 3).

    alpha = (R^T W R)^-1 R^T W u with R the rigid-body modes at `position` (node, 3), W = diag(weight).

    >>> u_d = split(np.ones((4, 3)), np.eye(4, 3), np.ones(4))[1]
    >>> bool(abs(u_d).max() < 1e-12)
    True
    """
    R = summation_operator(position)
    W = np.repeat(weight, 3)
    flat = u.reshape(*u.shape[:-2], -1)
    alpha = flat @ np.linalg.solve(R.T @ (W[:, None] * R), R.T * W).T
    return alpha, (flat - alpha @ R.T).reshape(u.shape)


def mean_shape(position: Array, shape: Array, weight: Array) -> Array:
    """Mean shape (node, 3) of a moving body in its own axes; nodes never seen keep the reference shape.

    Of a spinning body it is the shape it spins with, which differs from the one at rest. Only frames that
    show every weighted node enter, where there are any. Source: principal equations 4d.
    """
    seen = np.all(np.isfinite(position), axis=2)
    ever = np.any(seen, axis=0)
    whole = np.all(seen[:, ever & (weight > 0)], axis=1)
    frames = position[whole] if whole.sum() >= 3 else position
    ever = np.any(np.isfinite(frames).all(2), axis=0)
    mean = shape.copy()
    for _ in range(3):
        center, R = fit_rotation(frames, mean, weight)
        mean[ever] = np.nanmean(body_axes(frames, center, R)[:, ever], axis=0)
    return mean


def principal_deformations(residual: Array, noise_var: float, most: int | None = None) -> tuple[Array, Array]:
    """Orthonormal shapes (mode, node, 3) that a residual (time, node, 3) takes, and their variances (mode,).

    Only shapes that stand out of white marker noise: above the largest eigenvalue that noise alone
    gives (Johnstone 2001), exceeded by chance in one record of a hundred; the first `most`, if given.
    """
    frames = residual[np.isfinite(residual).all((1, 2))].reshape(-1, residual.shape[1] * 3)
    if len(frames) < 2:
        return np.zeros((0, *residual.shape[1:])), np.zeros(0)
    variance, shapes = np.linalg.eigh(frames.T @ frames / len(frames))
    root_n, root_p = np.sqrt(frames.shape)
    edge = (root_n + root_p) ** 2
    width = (root_n + root_p) * (1 / root_n + 1 / root_p) ** (1 / 3)
    count = int((len(frames) * variance > noise_var * (edge + 2 * width)).sum())
    if most is not None:
        count = min(most, frames.shape[1])
    top = np.arange(len(variance))[::-1][:count]
    return shapes[:, top].T.reshape(count, *residual.shape[1:]), np.maximum(variance[top] - noise_var, 0.0)


def stretches(shape: Array) -> Array:
    """The affine shapes of a body: nodal patterns (mode, node, 3) of the symmetric strains it can show.

    Six for a solid body, three for a plane one (strains in its plane), one for a line. Strain k is the
    pattern E_k X with E_k symmetric, in the principal axes of the shape. Source: principal equations 4g.
    """
    centered = shape - shape.mean(0)
    _, size, axes = np.linalg.svd(centered, full_matrices=False)
    spread = axes[size > 1e-6 * size[0]]
    pairs = [(a, b) for i, a in enumerate(spread) for b in spread[i:]]
    strains = [0.5 * (np.outer(a, b) + np.outer(b, a)) for a, b in pairs]
    return np.array([shape @ E for E in strains])


def fit_amplitudes(residual: Array, shapes: Array, rigid: Array, noise_var: float) -> tuple[Array, Array]:
    """Amplitudes q (time, mode) of shapes (mode, node, 3) and their noise variance, NaN where not determined.

    Fitted together with the six rigid modes `rigid` (3 node, 6), so that no error of the pose enters:
    the markers seen in a frame must fix all of them, or q is NaN there.
    """
    T, count = len(residual), len(shapes)
    q, var = np.full((T, count), np.nan), np.full((T, count), np.nan)
    G = np.concatenate([rigid, shapes.reshape(count, len(rigid)).T], 1)
    seen = np.isfinite(residual).all(2)
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    for i, pattern in enumerate(patterns):
        rows, at = np.repeat(pattern, 3), which.ravel() == i
        if rows.sum() < 6 + count:
            continue
        pinv, rank = np.linalg.pinv(G[rows]), np.linalg.matrix_rank(G[rows], rtol=1e-6)
        if rank == 6 + count:
            q[at] = residual[at][:, pattern].reshape(at.sum(), -1) @ pinv[6:].T
            var[at] = noise_var * (pinv[6:] ** 2).sum(1)
    return q, var
