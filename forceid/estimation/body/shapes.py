"""The mean shape of a body and the shapes in which it deforms: given, elastic, affine, or principal."""

from __future__ import annotations

import numpy as np

from forceid.config import Settings
from forceid.errors import DataError
from forceid.estimation.body.inertia import Inertia
from forceid.motion.modes import (
    Modes,
    deflected_shape,
    elastic_modes,
    fit_amplitudes,
    given_modes,
    mean_shape,
    principal_deformations,
    split_rigid,
    strain_shapes,
)
from forceid.motion.pose import (
    pose_rank,
)
from forceid.motion.telling import log_evidence, shown_by, telling_modes
from forceid.principal import summation_operator
from forceid.records import Array, Body, Flags

SHIFT = 4.0  # standard errors by which a mean shape must leave the reference shape to replace it


SIZE = 3.0  # times the reference shape, or its third, that no body stretches to


def check_scale(x: Array, X: Array) -> None:
    """A DataError where marker tracks x (time, node, 3) are not of the size of the shape X (node, 3).

    A body may bend and stretch; three times its size is a unit that is not what it says.
    """
    seen: Flags = np.asarray(np.isfinite(x).all(2))
    count = np.maximum(seen.sum(1), 1)[:, None]

    def size(a: Array) -> Array:
        a = np.where(seen[..., None], a, 0.0)
        off = np.where(seen[..., None], a - (a.sum(1) / count)[:, None], 0.0)
        return np.asarray(np.sqrt((off**2).sum((1, 2)) / count[:, 0]))

    moving, still = size(x), size(np.broadcast_to(X, x.shape))
    both = (moving > 0) & (still > 0)
    if not both.any():
        return
    ratio = float(np.median(moving[both] / still[both]))
    if not 1 / SIZE < ratio < SIZE:
        raise DataError(
            f"spans {ratio:.2g} times what the reference shape does (median of {both.sum()} frames), "
            "expected about the same",
            "/motion/position",
            "check the units of /motion/position and /body/position",
        )


def rank_of(shape: Array, nodes: Flags) -> int:
    """Rank of the rigid-body modes that the named nodes see."""
    return pose_rank(summation_operator(shape[nodes])) if nodes.any() else 0


def spinning_shape(
    time: Array, x: Array, X: Array, inertia: Inertia, modes: Modes | None, weight: Array, sigma: float
) -> Array:
    """The mean shape, where the record shows that it is not the reference shape; else the reference."""
    shape = mean_shape(x, X, weight)
    frames = np.isfinite(x).all(2).sum(0)
    error = sigma / np.sqrt(frames.clip(1))
    if not (np.abs(shape - X).max(1) > SHIFT * error).any():
        return X
    hidden = (inertia.weight > 0) & (frames == 0)
    if modes is None or inertia.nodal is None or not hidden.any():
        return shape
    return deflected_shape(time, x, X, modes, inertia.nodal, weight, sigma**2)


def modes_of(body: Body, inertia: Inertia) -> Modes | None:
    """The modes that a body brings with it, as shapes or as a stiffness."""
    nodal = inertia.nodal
    if body.position is None or nodal is None:
        return None if body.mode_shape is None else Modes(body.mode_shape)
    X = body.position - inertia.center
    if body.mode_shape is not None:
        return given_modes(body.mode_shape, body.mode_frequency, nodal, X)
    if body.stiffness is None or rank_of(X, inertia.weight > 0) < 6:  # masses on a line: no mass gauge
        return None
    return elastic_modes(nodal, body.stiffness, X)


def deformation_shapes(
    body: Body,
    inertia: Inertia,
    modes: Modes | None,
    residual: Array,
    shape: Array,
    weight: Array,
    seen: Flags,
    sigma: float,
    settings: Settings,
) -> tuple[Array, Array, Array]:
    """Unit shapes (mode, node, 3) of the model asked for, the variances of their amplitudes, and the rest.

    The rest is the covariance (dof, dof) of what deforms beside them. A modal body deforms in the modes that
    it brings with it, which take its unmarked masses along; in its principal deformations where it brings
    none, or where all its masses carry markers that show them better.
    """
    none = np.zeros((0, *shape.shape)), np.zeros(0), np.zeros((shape.size, shape.size))
    if settings.model == "rigid" or rank_of(shape, weight > 0) < 6:
        return none
    hidden = bool((inertia.weight[~seen] > 0).any())
    if settings.model == "affine":
        whole = hidden and inertia.nodal is not None  # what strains, strains everywhere
        raw = strain_shapes(shape) if whole else strain_shapes(shape) * seen[:, None]
        gauge = inertia.nodal if whole and inertia.nodal is not None else weight
        flat = split_rigid(raw, shape, gauge)[1].reshape(len(raw), -1)
        U, size, _ = np.linalg.svd(flat.T, full_matrices=False)
        shapes = U[:, size > 1e-6 * size[0]].T.reshape(-1, *shape.shape)
        q, q_var = fit_amplitudes(residual, shapes, summation_operator(shape), sigma**2)
        if not np.isfinite(q).any(0).all():  # in no frame are markers enough
            return none
        var = np.maximum(np.nanvar(q, axis=0) - np.nanmean(q_var, axis=0), sigma**2 * 1e-3)
        return shapes, var, none[2]
    principal, var, rest = none
    if modes is None or not (hidden or body.mode_shape is not None):
        on_seen, var = principal_deformations(residual[:, seen], sigma**2, settings.modes)
        principal = np.zeros((len(on_seen), *shape.shape))
        principal[:, seen] = on_seen
    if modes is None:
        return principal, var, rest
    own = split_rigid(modes.shape, shape, weight if inertia.nodal is None else inertia.nodal)[1]
    size = np.linalg.norm(own, axis=(1, 2))
    own, size = own[size > 0] / size[size > 0, None, None], size[size > 0]
    soft = None if modes.compliance is None else modes.compliance * size
    shown = shown_by(seen, shape, np.concatenate([own, principal]))
    samples = shown.of(residual)
    samples = samples[np.isfinite(samples).all(1)]
    frames = len(samples)
    if frames < 2:
        return none
    scatter = samples.T @ samples / frames
    noise = sigma**2 * np.eye(len(scatter))
    D = shown.of(own)
    kept, own_var, level = telling_modes(scatter, frames, D, soft, sigma**2, settings.modes)
    if soft is not None:
        flat, left = np.delete(own.reshape(len(own), shape.size), kept, axis=0), np.delete(soft, kept)
        rest = flat.T @ (level * left[:, None] ** 2 * flat)
    k, dim = len(principal), len(shown.rows) - 6
    numbers = k * dim - k * (k - 1) / 2 - len(kept) - 1  # by which principal deformations cost more
    alike = D.T @ (level * soft[:, None] ** 2 * D) if soft is not None else 0.0
    gain = log_evidence(scatter, frames, shown.of(principal), var, noise) - log_evidence(
        scatter, frames, D[kept], own_var, noise + alike
    )
    if k and gain > 0.5 * numbers * np.log(frames):
        return principal, var, none[2]
    return own[kept], own_var, rest
