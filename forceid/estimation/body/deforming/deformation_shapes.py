"""The shapes in which a body deforms at a level: given, elastic, affine, or principal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.estimation.body.deforming.mode_selection import log_evidence, observable_modes, observed_shapes
from forceid.estimation.body.deforming.modes import (
    Modes,
    fit_amplitudes,
    principal_deformations,
    split_rigid,
    strain_shapes,
)
from forceid.estimation.body.deforming.shapes import rank_of
from forceid.estimation.body.markers import MarkerSet
from forceid.principal import summation_operator
from forceid.records import Array, Indices
from forceid.rounding import SINGLE


@dataclass(frozen=True)
class OwnShapes:
    """Modes of a body that a record shows: which (mode,), unit shape (mode, node, 3), amplitude variance var.

    rest (dof, dof) m2: covariance of the modes left out; behind: log-likelihood by which principal
    deformations are ahead of these, for what they cost.
    """

    which: Indices
    shape: Array
    var: Array
    rest: Array
    behind: float


def deformation_shapes(markers: MarkerSet, model: str, most: int | None) -> tuple[Array, Array, Array]:
    """Unit shapes (mode, node, 3) of the model asked for, the variances of their amplitudes, and the rest.

    The rest is the covariance (dof, dof) of what deforms beside them. A modal body deforms in the modes that
    it brings with it, which take its unmarked masses along; in its principal deformations where it brings
    none, or where all its masses carry markers that show them better. most: of them, None for all that show.
    """
    body, inertia, modes, residual = markers.body, markers.inertia, markers.modes, markers.residual
    shape, weight, seen, sigma = markers.shape, markers.weight, markers.seen, markers.noise_std
    none = np.zeros((0, *shape.shape)), np.zeros(0), np.zeros((shape.size, shape.size))
    if model == "rigid" or rank_of(shape, weight > 0) < 6:
        return none
    hidden = bool((inertia.weight[~seen] > 0).any())
    if model == "affine":
        whole = hidden and inertia.nodal is not None  # what strains, strains everywhere
        raw = strain_shapes(shape) if whole else strain_shapes(shape) * seen[:, None]
        gauge = inertia.nodal if whole and inertia.nodal is not None else weight
        flat = split_rigid(raw, shape, gauge)[1].reshape(len(raw), -1)
        U, size, _ = np.linalg.svd(flat.T, full_matrices=False)
        shapes = U[:, size > SINGLE * size[0]].T.reshape(-1, *shape.shape)
        q, q_var = fit_amplitudes(residual, shapes, summation_operator(shape), sigma**2)
        if not np.isfinite(q).any(0).all():  # in no frame are markers enough
            return none
        var = np.maximum(np.nanvar(q, axis=0) - np.nanmean(q_var, axis=0), sigma**2 * 1e-3)
        return shapes, var, none[2]
    principal, var, rest = none
    if modes is None or not (hidden or body.mode_shape is not None):
        on_seen, var = principal_deformations(residual[:, seen], sigma**2, most)
        principal = np.zeros((len(on_seen), *shape.shape))
        principal[:, seen] = on_seen
    if modes is None:
        return principal, var, rest
    found = own_shapes(markers, modes, most, principal, var)
    if found is None:
        return none
    if found.behind > 0:
        return principal, var, none[2]
    return found.shape, found.var, found.rest


def own_shapes(
    markers: MarkerSet, modes: Modes, most: int | None, principal: Array, principal_var: Array
) -> OwnShapes | None:
    """The modes that the markers of a record show, beside its principal deformations; None without frames.

    most: of them, None for all that show; principal (shape, node, 3), with principal_var of their amplitudes.
    """
    inertia, shape, sigma = markers.inertia, markers.shape, markers.noise_std
    own = split_rigid(modes.shape, shape, markers.weight if inertia.nodal is None else inertia.nodal)[1]
    size = np.linalg.norm(own, axis=(1, 2))
    which = np.flatnonzero(size)
    own, size = own[which] / size[which, None, None], size[which]
    soft = None if modes.compliance is None else modes.compliance * size
    observed = observed_shapes(markers.seen, shape, np.concatenate([own, principal]))
    samples = observed.of(markers.residual)
    samples = samples[np.isfinite(samples).all(1)]
    frames = len(samples)
    if frames < 2:
        return None
    scatter = samples.T @ samples / frames
    noise = sigma**2 * np.eye(len(scatter))
    D = observed.of(own)
    kept, own_var, level = observable_modes(scatter, frames, D, soft, sigma**2, most)
    rest = np.zeros((shape.size, shape.size))
    if soft is not None:
        flat, left = np.delete(own.reshape(len(own), shape.size), kept, axis=0), np.delete(soft, kept)
        rest = flat.T @ (level * left[:, None] ** 2 * flat)
    k, dim = len(principal), len(observed.rows) - 6
    numbers = k * dim - k * (k - 1) / 2 - len(kept) - 1  # by which principal deformations cost more
    alike = D.T @ (level * soft[:, None] ** 2 * D) if soft is not None else 0.0
    gain = log_evidence(scatter, frames, observed.of(principal), principal_var, noise) - log_evidence(
        scatter, frames, D[kept], own_var, noise + alike
    )
    behind = float(gain - 0.5 * numbers * np.log(frames)) if k else 0.0
    return OwnShapes(which[kept], own[kept], own_var, rest, behind)
