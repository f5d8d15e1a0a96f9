"""The mass center of a body whose mass is all seen: a mean, which no rotation, shape or model can touch.

c = sum m_i x_i / sum m_i
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.estimation.body.affine_fit import fit_affine
from forceid.estimation.body.inertia import Inertia, inertia_of
from forceid.estimation.body.tracks.bridging import bridged
from forceid.motion import Frames, Pose
from forceid.records import Array, Body, Flags, Motion, all_finite


@dataclass(frozen=True)
class MassCenter:
    """center (time, 3) m and its variance var (time,) m2 along every axis, NaN where nothing is seen."""

    center: Array
    var: Array


def carriers(inertia: Inertia, position: Array) -> Flags | None:
    """Nodes (node,) that carry all the mass, or None where tracks (time, node, 3) never show one of them."""
    massive = inertia.weight != 0
    observed = np.any(all_finite(position), axis=0)
    return massive if inertia.nodal is not None and massive.any() and observed[massive].all() else None


def without_gaps(body: Body, motion: Motion) -> Motion:
    """The motion with nodes that carry mass bridged where they are lost, if all mass is seen at some time.

    A node that is lost for a while moves on beside its neighbors, as gaps of that length made elsewhere in
    the record tell best. So a lost marker moves neither the mass center nor the mean rotation.
    """
    if motion.position is None or motion.bridged is not None:
        return motion
    nodes = carriers(inertia_of(body), motion.position)
    if nodes is None:
        return motion
    filled = bridged(motion.time, motion.position, nodes)
    return replace(motion, position=filled.position, bridged=filled.error_var)


def tracked_mass_center(motion: Motion, inertia: Inertia, noise_var: float) -> MassCenter | None:
    """The mass center of marker tracks; None where a mass is never seen, or gaps were not bridged.

    noise_var (m2): of one coordinate of a marker.

    >>> body = Body(("a", "b"), np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([1.0, 3.0]))
    >>> seen = Motion(np.arange(5.0), np.tile(body.position, (5, 1, 1)))
    >>> found = tracked_mass_center(without_gaps(body, seen), inertia_of(body), 1e-6)
    >>> found.center[0].tolist(), round(float(found.var[0]), 10)
    ([0.75, 0.0, 0.0], 6.25e-07)
    """
    if motion.position is None or motion.bridged is None:
        return None
    nodes = carriers(inertia, motion.position)
    if nodes is None:
        return None
    share = inertia.weight[nodes] / inertia.mass
    center = np.einsum("n,tna->ta", share, motion.position[:, nodes])
    return MassCenter(center, (noise_var + motion.bridged[:, nodes]) @ share**2)


def affine_center(position: Array, shape: Array, noise_var: float) -> MassCenter | None:
    """The mass center of a body that moves by an affine map, c = mean x - F mean X; None where none shows it.

    position (time, node, 3) m; shape (node, 3) m of the markers in the reference, about the mass center.
    Exact for any stretch and any place of the markers, which no rotation fit is. Source: pseudo-rigid bodies,
    section 0.
    """
    fit = fit_affine(position, shape, noise_var)
    if fit.off or not np.isfinite(fit.center).any():
        return None
    return MassCenter(fit.center, fit.cov[:, 0, 0])


def with_center(
    pose: Pose, frames: Frames | None, mean: MassCenter, share: Array
) -> tuple[Pose, Frames | None]:
    """Poses, and what frames say of deformation, about a mass center known by itself.

    share (3, 3): covariance of its noise along world axes over its mean variance.
    """
    if frames is not None:
        leak = frames.leak.copy()
        leak[:, :3] = 0.0
        frames = replace(frames, center=mean.center, cov=apart(frames.cov, mean, share), leak=leak)
    return replace(pose, center=mean.center, cov=apart(pose.cov, mean, share)), frames


def apart(cov: Array, mean: MassCenter, share: Array) -> Array:
    """Covariances (time, 6, 6) of poses whose center is `mean`, apart from the rotation."""
    found = cov.copy()
    found[:, :3, :3] = mean.var[:, None, None] * share
    found[:, :3, 3:] = found[:, 3:, :3] = 0.0
    return found


def center_of_mass(position: Array, shape: Array, weight: Array, noise_var: float) -> tuple[Array, Array]:
    """Mass center (time, 3) without a rotation fit, and its variance per axis (time,); NaN where unseen.

    The mass-weighted mean where every node with weight is seen; else, for a rigid body, the combination
    of markers whose affine span holds the mass center, the origin of `shape` (node, 3).
    """
    seen = all_finite(position)
    center, var = np.full((len(position), 3), np.nan), np.full(len(position), np.nan)
    patterns, which = np.unique(seen, axis=0, return_inverse=True)
    for i, pattern in enumerate(patterns):
        at = which.ravel() == i
        w = weight[pattern]
        if not w.sum() > 0 or w.sum() < weight.sum() * (1 - 1e-9):
            span = np.vstack([shape[pattern].T, np.ones(pattern.sum())])
            w = np.linalg.pinv(span) @ np.array([0.0, 0.0, 0.0, 1.0])
            if not np.allclose(span @ w, [0.0, 0.0, 0.0, 1.0], atol=1e-9):
                continue
        w = w / w.sum()
        center[at] = np.einsum("n,tna->ta", w, position[at][:, pattern])
        var[at] = noise_var * (w @ w)
    return center, var
