"""From a recording to what moved: mass, shape, the pose of every frame, and the deformation that shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.config import Settings
from forceid.errors import DataError
from forceid.motion.frames import Frames, fit_frames
from forceid.motion.modes import (
    Modes,
    deflected_shape,
    elastic_modes,
    fit_amplitudes,
    given_modes,
    mean_shape,
    principal_deformations,
    split,
    stretches,
)
from forceid.motion.pose import (
    Pose,
    body_axes,
    center_of_mass,
    fit_pose,
    fit_rotation,
    log,
    pose_rank,
)
from forceid.motion.telling import log_evidence, shown_by, telling_modes
from forceid.motion.window import noise_variance
from forceid.principal.mass import mass_properties
from forceid.principal.operator import summation_operator
from forceid.records import Array, Body, Flags, Motion

SHIFT = 4.0  # standard errors by which a mean shape must leave the reference shape to replace it
SIZE = 3.0  # times the reference shape, or its third, that no body stretches to
ROUNDOFF = 1e-7  # of the size of the motion: noise below this is not believed


@dataclass(frozen=True)
class Inertia:
    """Mass kg, its center (3,) in the axes of the reference shape, and how it moves with the nodes.

    nodal: masses (node,) or matrix (dof, dof), or None for a rigid body known as a whole; weight (node,):
    mass that goes with each node, zeros for such a body; tensor (3, 3) kg m2 of the reference shape.
    """

    mass: float
    center: Array
    tensor: Array
    nodal: Array | None
    weight: Array


@dataclass(frozen=True)
class Kinematics:
    """What a recording shows of the motion.

    shape (node, 3) m about the mass center, body axes: the mean shape; pose: of every frame; seen (node,):
    nodes that carry a marker; shapes (mode, node, 3) of unit norm, with raw amplitudes (time, mode) m
    and their noise_var; model: rigid, affine or modal; noise: standard deviation by variable, stated:
    whether the user stated it; attitude: whether the markers fix the rotation; frames: what every frame says
    of pose and amplitudes together, and beside (dof, dof) m2 what it counts as noise of deformation beside
    the shapes, None for a body that does not deform.
    """

    time: Array
    inertia: Inertia
    shape: Array
    seen: Flags
    pose: Pose
    shapes: Array
    amplitude: Array
    amplitude_var: Array
    model: str
    noise: dict[str, float]
    stated: dict[str, bool]
    attitude: bool
    frames: Frames | None = None
    beside: Array | None = None

    @property
    def unfollowed(self) -> Flags:
        """Nodes (node,) with mass that neither a marker nor a shape follows as the body deforms."""
        return (self.inertia.weight > 0) & ~self.seen & ~self.shapes.any(axis=(0, 2))


def inertia_of(body: Body) -> Inertia:
    """Mass, center and inertia tensor of a body, however the file describes it."""
    nodes = len(body.node)
    if body.mass is not None or body.mass_matrix is not None:
        nodal = body.mass if body.mass is not None else body.mass_matrix
        assert nodal is not None
        assert body.position is not None
        p = mass_properties(nodal, body.position)
        weight = nodal if nodal.ndim == 1 else nodal.reshape(nodes, 3, nodes, 3)[:, 0, :, 0].sum(1)
        return Inertia(p.mass, p.center, p.inertia, nodal, weight)
    if body.total_mass is None:
        raise DataError("holds no mass", "/body", "give mass, mass_matrix, or total_mass with inertia")
    center = np.zeros(3) if body.mass_center is None else body.mass_center
    tensor = np.full((3, 3), np.nan) if body.inertia is None else body.inertia
    return Inertia(body.total_mass, center, tensor, None, np.zeros(nodes))


def kinematics(
    body: Body, motion: Motion, settings: Settings, noise: dict[str, float] | None = None
) -> Kinematics:
    """Poses and deformation of a recording.

    noise: standard deviations by variable that replace those of the file, from an earlier tuning.
    """
    stated = motion.noise_std | settings.noise_std
    if motion.position is not None:
        return from_markers(body, motion, motion.position, settings, stated, noise or stated)
    return from_mean_motion(body, motion, stated, noise or stated)


def from_markers(
    body: Body,
    motion: Motion,
    x: Array,
    settings: Settings,
    stated: dict[str, float],
    noise: dict[str, float],
) -> Kinematics:
    """Kinematics of marker tracks x (time, node, 3)."""
    inertia = inertia_of(body)
    assert body.position is not None
    X = body.position - inertia.center
    check_scale(x, X)
    seen = np.any(np.isfinite(x).all(2), axis=0)
    sigma = noise.get("position") or marker_noise(motion.time, x)
    sigma = max(sigma, ROUNDOFF * float(np.ptp(x[np.isfinite(x)])))
    level, known = {"position": sigma}, {"position": "position" in stated}
    massive = seen & (inertia.weight > 0)
    weight = inertia.weight * seen if massive.any() and rank_of(X, massive) == 6 else seen.astype(float)
    none = np.zeros((0, *X.shape))
    if rank_of(X, seen) < 6:
        center, var = center_of_mass(x, X, inertia.weight, sigma**2)
        T = len(x)
        cov, empty = np.full((T, 6, 6), np.nan), np.zeros((T, 0))
        cov[:, :3, :3] = var[:, None, None] * np.eye(3)
        unseen, lost = np.full((T, 3, 3), np.nan), np.full_like(x, np.nan)
        pose = Pose(center, unseen, cov, lost, np.full(T, np.nan), np.zeros(T))
        return Kinematics(
            motion.time, inertia, X, seen, pose, none, empty, empty, "rigid", level, known, False
        )
    modes = modes_of(body, inertia)
    shape = spinning_shape(motion.time, x, X, inertia, modes, weight, sigma)
    # in the gauge of the weights, before any marker's noise is weighed
    center, R = fit_rotation(x, shape, weight)
    residual = body_axes(x, center, R) - shape
    shapes, var, rest = deformation_shapes(
        body, inertia, modes, residual, shape, weight, seen, sigma, settings
    )
    model = settings.model
    if model == "auto":
        model = "modal" if len(shapes) else "rigid"
    flat, white = shapes.reshape(len(shapes), X.size), sigma**2 * np.eye(X.size)
    deforming = rest + flat.T @ (var[:, None] * flat)
    # smoothing takes white noise down by the number of frames it spans, a vibration only past its period:
    # as noise of one frame, deformation counts as often
    pose = fit_pose(x, shape, weight, white + period(motion, modes) * deforming)
    q, q_var = fit_amplitudes(pose.residual, shapes, summation_operator(shape), white + rest)
    frames, beside = None, period(motion, modes) * rest
    if len(shapes):
        frames = fit_frames(x, pose, shape, shapes, white + beside)
    return Kinematics(
        motion.time, inertia, shape, seen, pose, shapes, q, q_var, model, level, known, True, frames, beside
    )


def period(motion: Motion, modes: Modes | None) -> float:
    """Frames in a period of the lowest mode of a body, 1 where none is known."""
    if modes is None or modes.compliance is None or not modes.compliance.any():
        return 1.0
    longest = 2 * np.pi * np.sqrt(modes.compliance.max())
    return float(np.clip(longest / np.median(np.diff(motion.time)), 1.0, len(motion.time)))


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


def marker_noise(time: Array, x: Array) -> float:
    """Standard deviation (m) that high-order differences show, from the markers that are seen most."""
    frames = np.isfinite(x).all(2).sum(0)
    return float(np.sqrt(noise_variance(time, x[:, frames >= frames.max()].reshape(len(x), -1))))


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
        raw = stretches(shape) if whole else stretches(shape) * seen[:, None]
        gauge = inertia.nodal if whole and inertia.nodal is not None else weight
        flat = split(raw, shape, gauge)[1].reshape(len(raw), -1)
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
    own = split(modes.shape, shape, weight if inertia.nodal is None else inertia.nodal)[1]
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


def from_mean_motion(
    body: Body, motion: Motion, stated: dict[str, float], noise: dict[str, float]
) -> Kinematics:
    """Kinematics of a measured mean motion: center and, where given, orientation."""
    assert motion.center is not None
    inertia = inertia_of(body)
    T, time = len(motion.time), motion.time
    c_std = noise.get("center") or float(np.sqrt(noise_variance(motion.time, motion.center)))
    c_std = max(c_std, ROUNDOFF * float(np.nanmax(np.ptp(motion.center, axis=0), initial=1e-9)))
    cov = np.zeros((T, 6, 6))
    cov[:, :3, :3] = c_std**2 * np.eye(3)
    levels = {"center": c_std}
    R = np.full((T, 3, 3), np.nan)
    attitude = motion.orientation is not None and bool(np.isfinite(inertia.tensor).all())
    if motion.orientation is not None:
        whole = np.all(np.isfinite(motion.orientation), axis=1)
        R[whole] = Rotation.from_quat(motion.orientation[whole]).as_matrix()
        pair, steps = whole[1:] & whole[:-1], np.zeros((T, 3))
        steps[1:][pair] = log((R[1:] @ R[:-1].swapaxes(1, 2))[pair])
        angle = np.where(whole[:, None], np.cumsum(steps, axis=0), np.nan)
        r_std = noise.get("orientation") or float(np.sqrt(noise_variance(time, angle)))
        levels["orientation"] = max(r_std, ROUNDOFF)
        cov[:, 3:, 3:] = levels["orientation"] ** 2 * np.eye(3)
    empty = np.zeros((T, 0))
    nodes = len(body.node)
    X = np.zeros((nodes, 3)) if body.position is None else body.position - inertia.center
    pose = Pose(motion.center, R, cov, np.zeros((T, nodes, 3)), np.full(T, np.nan), np.zeros(T))
    known, none = {name: name in stated for name in levels}, np.zeros((0, nodes, 3))
    return Kinematics(
        time, inertia, X, np.zeros(nodes, bool), pose, none, empty, empty, "rigid", levels, known, attitude
    )


def scaled(kin: Kinematics, factor: dict[str, float]) -> dict[str, float]:
    """Noise levels of a record, each times the factor that tuning found for it."""
    return {name: level * factor.get(name, 1.0) for name, level in kin.noise.items()}


def shape_at(kin: Kinematics, amplitude: Array) -> Array:
    """Shape (time, node, 3) about the mass center, body axes, at mode amplitudes (time, mode)."""
    return np.asarray(kin.shape + np.einsum("tk,kna->tna", amplitude, kin.shapes))
