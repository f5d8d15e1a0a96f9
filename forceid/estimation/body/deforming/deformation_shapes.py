"""The shapes in which a body deforms at a level: given, elastic, affine, or principal."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.body.deforming.mode_selection import (
    ObservedShapes,
    common_level,
    observable_modes,
    observed_shapes,
)
from forceid.estimation.body.deforming.modes import (
    Modes,
    fit_amplitudes,
    mean_spin,
    principal_deformations,
    split_rigid,
)
from forceid.estimation.body.deforming.strains import affine_shapes
from forceid.estimation.body.markers import MarkerSet, rank_of
from forceid.flight.elastic_spectra import Elastic
from forceid.motion import fit_rotation
from forceid.principal import summation_operator
from forceid.records import Array, Indices
from forceid.significance import TENTH

FOLLOWED = 20  # elastic modes with states in a flight: as many again cost eight times the arithmetic


@dataclass(frozen=True)
class Shapes:
    """Shapes (mode, node, 3) of unit norm in which a body deforms, with variances var (mode,) m2.

    rest (dof, k) m: what deforms beside them, one standard deviation each; elastic: their frequencies where
    the body brings these, None for shapes of which nobody knows how they swing.
    """

    shape: Array
    var: Array
    rest: Array
    elastic: Elastic | None = None


def deformation_shapes(markers: MarkerSet, model: str, most: int | None) -> Shapes:
    """The shapes of the model asked for.

    A modal body deforms in the modes that it brings with it, which take its unmarked masses along; in its
    principal deformations where it brings none. most: of them, None for all that show.
    """
    modes, residual = markers.modes, markers.residual
    shape, weight, seen, sigma = markers.shape, markers.weight, markers.seen, markers.noise_std
    none = Shapes(np.zeros((0, *shape.shape)), np.zeros(0), np.zeros((shape.size, 0)))
    if model == "rigid" or rank_of(shape, weight > 0) < 6:
        return none
    if model == "affine":
        shapes = affine_shapes(markers)
        if not len(shapes):  # in no frame are markers enough
            return none
        q, q_var = fit_amplitudes(residual, shapes, summation_operator(shape), markers.white)
        var = np.maximum(np.nanvar(q, axis=0) - np.nanmean(q_var, axis=0), sigma**2 * 1e-3)
        return replace(none, shape=shapes, var=var)
    if modes is not None and modes.compliance is not None:
        return elastic_shapes(markers, modes, modes.compliance, most)
    if modes is None:
        on_seen, var = principal_deformations(residual[:, seen], sigma**2, most)
        principal = np.zeros((len(on_seen), *shape.shape))
        principal[:, seen] = on_seen
        return replace(none, shape=principal, var=var)
    _, own, _ = in_gauge(markers, modes)  # given, without a frequency that a record shows
    observed, scatter, frames = scatter_of(markers, own)
    if frames < 2:
        return none
    kept, var = observable_modes(scatter, frames, observed.of(own), sigma**2, most)
    return replace(none, shape=own[kept], var=var)


def in_gauge(markers: MarkerSet, modes: Modes) -> tuple[Indices, Array, Array]:
    """Which modes (mode,) deform the body, unit shapes (mode, node, 3) of them in its gauge, their norms."""
    gauge = markers.weight if markers.inertia.nodal is None else markers.inertia.nodal
    own = split_rigid(modes.shape, markers.shape, gauge)[1]
    size = np.linalg.norm(own, axis=(1, 2))
    which = np.flatnonzero(size)
    return which, own[which] / size[which, None, None], size[which]


def scatter_of(markers: MarkerSet, own: Array) -> tuple[ObservedShapes, Array, int]:
    """What markers show of unit shapes own, the mean square (shown, shown) of it, and of how many frames."""
    observed = observed_shapes(markers.seen, markers.shape, own)
    samples = observed.of(markers.residual)
    samples = samples[np.isfinite(samples).all(1)]
    return observed, samples.T @ samples / max(len(samples), 1), len(samples)


def elastic_shapes(markers: MarkerSet, modes: Modes, compliance: Array, most: int | None) -> Shapes:
    """The elastic modes that loads alike on all would move most, softest first, and the others as noise.

    As many as leave less than a tenth of the noise of a marker to the others.
    """
    which, own, size = in_gauge(markers, modes)
    soft = compliance[which] * size
    observed, scatter, frames = scatter_of(markers, own)
    if not frames or not len(own):
        return Shapes(own[:0], soft[:0], np.zeros((markers.shape.size, 0)))
    D, noise_var = observed.of(own), markers.noise_std**2
    alike = D.T @ (soft[:, None] ** 2 * D)
    var = common_level(scatter, alike, noise_var) * soft**2
    order = np.argsort(-compliance[which])
    moved = np.einsum("k,kna->k", var, own[:, markers.seen] ** 2)[order] / (3 * markers.seen.sum())
    left = moved.sum() - np.cumsum(moved)
    needed = int((left > TENTH**2 * noise_var).sum()) + 1
    kept = np.sort(order[: min(needed, FOLLOWED) if most is None else most])
    beside = np.delete(np.arange(len(own)), kept)
    flat = own[beside].reshape(len(beside), markers.shape.size)
    damping = markers.body.mode_damping if markers.body.mode_shape is not None else None
    frequency = 1 / np.sqrt(compliance[which][kept])
    told, given = np.ones(len(kept)), markers.body.mode_shape
    if given is not None:  # as they are given
        told = np.linalg.norm(split_rigid(given, markers.X, markers.weight)[1], axis=(1, 2))[which][kept]
    # the pull of a spin is a stiffness of about the mass times its square
    center, R = fit_rotation(markers.tracks, markers.shape, markers.weight)
    seen = np.isfinite(R).all((1, 2)) & np.isfinite(center).all(1)
    spin = float(np.trace(mean_spin(markers.time[seen], R[seen])))
    known = None if damping is None else damping[which][kept]
    elastic = Elastic(frequency, known, size[kept], told, spin / frequency**2)
    return Shapes(own[kept], var[kept], flat.T * np.sqrt(var[beside]), elastic)
