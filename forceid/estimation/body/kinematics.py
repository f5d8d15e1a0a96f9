"""From a recording to what moved: mass, shape, the pose of every frame, and the deformation that shows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.config import Settings
from forceid.estimation.body.deforming.deformation_shapes import deformation_shapes
from forceid.estimation.body.deforming.hidden_mass import HiddenMass, hidden_mass
from forceid.estimation.body.deforming.modes import fit_amplitudes
from forceid.estimation.body.inertia import Inertia, inertia_of
from forceid.estimation.body.markers import ROUNDOFF, MarkerSet, markers_of
from forceid.estimation.body.mass_center import affine_center, center_of_mass, with_center
from forceid.estimation.body.rotors import momentum_inside
from forceid.estimation.body.spin import Spin
from forceid.estimation.body.thin_mass import followed_line, thinned
from forceid.estimation.body.tracks.noise_axes import as_stated, floored, rms_noise, share, uneven
from forceid.estimation.body.tracks.rounding import beside_rounding, grid_step
from forceid.flight.color import Color, Colored, LowPassed, SharedErrors
from forceid.flight.elastic_spectra import Elastic
from forceid.motion import (
    Frames,
    Pose,
    fit_frames,
    fit_pose,
    inertia_products,
    log,
    noise_variance,
    poses_about,
)
from forceid.principal import summation_operator
from forceid.records import Array, Body, Flags, KnownPart, Motion
from forceid.rounding import SOLVED
from forceid.timing import stage


@dataclass(frozen=True)
class Kinematics:
    """What a recording shows of the motion.

    shape (node, 3) m about the mass center, body axes: the mean shape; pose: of every frame; seen (node,):
    nodes that carry a marker; shapes (mode, node, 3) of unit norm, with raw amplitudes (time, mode) m
    and their noise_var; model: rigid, affine or modal; noise_root (3, 3) by variable: root of the covariance
    of its noise, world axes, stated: whether the user stated it; attitude: whether the markers fix the
    rotation; frames: what every frame says of pose and amplitudes together, and beside (dof, k) m what it
    counts as noise of deformation beside the shapes, one standard deviation each, None of a mean motion;
    spin: of a slender body, whose pose follows its line without it, None where it has none or none is seen;
    apart: whether the mass center is known by itself, as the mean of nodes that carry all mass or by an
    affine map, so that no rotation touches the force; markers: what this goes on from, None for a mean
    motion; inside ([time,] 3) kg m2/s, body axes: angular momentum of what turns inside; known: what known
    loads do along the motion; elastic: how the shapes swing, where the body brings that; hidden: what mass
    without markers may do beside them; both None elsewhere; color: of the errors, None for white ones; loud
    (time,): variance of those of a frame over the usual one, None where all are as loud; late (time, 6) m,
    rad: what frames that come early or late are off by, one standard deviation, None where none are; shared:
    errors of the mass center that all markers share, None for none.
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
    noise_root: dict[str, Array]
    stated: dict[str, bool]
    attitude: bool
    frames: Frames | None = None
    beside: Array | None = None
    spin: Spin | None = None
    apart: bool = False
    markers: MarkerSet | None = None
    inside: Array = field(default_factory=lambda: np.zeros(3))
    known: KnownPart | None = None
    elastic: Elastic | None = None
    hidden: HiddenMass | None = None
    color: Colored | None = None
    loud: Array | None = None
    late: Array | None = None
    shared: SharedErrors | None = None

    @property
    def noise(self) -> dict[str, float]:
        """Standard deviation of the noise by variable, in the mean square over the axes."""
        return {name: rms_noise(root) for name, root in self.noise_root.items()}

    def share(self, name: str) -> Array:
        """Covariance (3, 3) of the noise of a variable along world axes, over its mean variance."""
        return share(self.noise_root[name])

    @property
    def every(self) -> int:
        """Frames from one to the next that tells something new: more than one of low-passed tracks."""
        return self.color.every if isinstance(self.color, LowPassed) else 1

    @property
    def counted_cov(self) -> Array:
        """Covariance (time, 6, 6) that the pose of a frame counts with, of errors as they are there."""
        cov = self.pose.cov if self.loud is None else self.pose.cov * self.loud[:, None, None]
        cov = cov if self.late is None else cov + self.late[:, :, None] * self.late[:, None, :]
        cov = cov * self.color.counted if isinstance(self.color, LowPassed) else cov
        return cov if self.shared is None else cov + self.shared.cov

    @property
    def memory(self) -> Color | None:
        """The color of errors that have a memory of their own, None where they are white or low-passed."""
        return self.color if isinstance(self.color, Color) else None

    @property
    def of_center(self) -> Color | None:
        """The color of the errors of the mass center, None where they are white or low-passed."""
        if self.shared is None:
            return self.memory
        return self.shared.beside(np.einsum("taa->t", self.counted_cov[:, :3, :3]) / 3)

    @property
    def gauge(self) -> Array:
        """The shape (node, 3) m that rotations are fitted to: the mean one, unless that hardly holds them."""
        m = self.markers
        return self.shape if m is None or m.gauge is m.shape else m.gauge

    @property
    def deforms(self) -> bool:
        """Whether the poses allow for a deformation, in shapes or beside them."""
        return bool(len(self.shapes)) or (self.beside is not None and bool(self.beside.size))

    @property
    def unfollowed(self) -> Flags:
        """Nodes (node,) with mass that neither a marker nor a shape follows as the body deforms."""
        return (self.inertia.weight > 0) & ~self.seen & ~self.shapes.any(axis=(0, 2))

    def about(self, path: tuple[Array, Array]) -> Kinematics:
        """The same with its poses linearized about a path, center (time, 3) and rotation (time, 3, 3)."""
        m = self.markers
        assert m is not None
        noise = m.white, uneven(m.root)
        pose = poses_about(self.pose, m.measured, m.shape, m.weight, noise[0], path, noise[1])
        return replace(self, pose=pose)


@stage("kinematics")
def kinematics(
    body: Body, motion: Motion, settings: Settings, noise: dict[str, Array] | None = None
) -> Kinematics:
    """Poses and deformation of a recording.

    noise: roots (3, 3) of covariances by variable that replace those of the file, from an earlier tuning.
    """
    stated = motion.noise_std | settings.noise_std
    if motion.position is not None and "position" in stated:
        stated["position"] = beside_rounding(stated["position"], grid_step(motion.position))
    noise = noise or as_stated(stated, motion)
    if motion.position is not None:
        return at_level(markers_of(body, motion, noise, "position" in stated), settings)
    return from_mean_motion(body, motion, stated, noise)


@stage("kinematics")
def at_level(markers: MarkerSet, settings: Settings) -> Kinematics:
    """Poses and deformation of marker tracks at the level that settings.model and settings.modes name."""
    thin, X, x, measured = markers.thin, markers.X, markers.tracks, markers.measured
    if not markers.oriented:
        return without_rotation(markers)
    time, inertia, shape, weight = markers.time, markers.inertia, markers.shape, markers.weight
    sigma, along = markers.noise_std, share(markers.root)
    # of mass on a line a shape would give it the inertia that it has not
    model = "rigid" if thin.on_line or thin.point else str(settings.model)
    found = deformation_shapes(markers, model, settings.modes)
    shapes, var, rest, white = found.shape, found.var, found.rest, markers.white
    if model == "auto":
        model = "modal" if len(shapes) else "rigid"
    flat, often = shapes.reshape(len(shapes), X.size), np.sqrt(markers.period)
    deforming = np.concatenate([rest, flat.T * np.sqrt(var)], 1)
    # smoothing takes white noise down by the number of frames it spans, a vibration only past its period:
    # as noise of one frame, deformation counts as often
    # a body that does not deform needs no bridges: the markers that a frame shows fix its pose
    observed, own = (x, markers.filled) if len(shapes) else (measured, None)
    beyond = uneven(markers.root)
    begin = markers.gauge if len(shapes) else shape
    pose = fit_pose(observed, shape, weight, white.beside(often * deforming), own, beyond, begin)
    loose = var if found.elastic is not None else None
    q, q_var = fit_amplitudes(
        pose.residual, shapes, summation_operator(shape), white.beside(rest), own, loose
    )
    if thin.line is not None and not thin.on_line and inertia.nodal is not None:  # of the shape it moves in
        none = np.zeros((0, *X.shape))
        thin = thinned(replace(inertia, tensor=inertia_products(inertia.nodal, shape, none).inertia[0, 0]), X)
    if not len(shapes):
        inertia = thin
    spin, frames, hidden, beside = None, None, None, often * rest
    if inertia.line is not None:
        pose, spin = followed_line(time, pose, x, shape, inertia, sigma)
    if len(shapes):
        frames = fit_frames(observed, pose, shape, shapes, white.beside(beside), own, beyond)
    if frames is not None and model == "modal" and markers.modes is None:
        hidden = hidden_mass(markers)
        frames = frames if hidden is None else hidden.beside(frames)
    known_center = markers.mean
    if model == "affine" and known_center is None:
        known_center = affine_center(measured, X, sigma**2)
    if known_center is not None:
        pose, frames = with_center(pose, frames, known_center, along)
    return Kinematics(
        time, inertia, shape, markers.seen, pose, shapes, q, q_var, model, {"position": markers.root},
        {"position": markers.stated}, not inertia.point, frames, beside, spin, known_center is not None,
        markers, markers.inside, markers.known, found.elastic, hidden,
    )  # fmt: skip


def without_rotation(markers: MarkerSet) -> Kinematics:
    """Kinematics of markers too few, or too near to a line, for a rotation: the mass center, or the line."""
    time, inertia, X, x = markers.time, markers.thin, markers.X, markers.tracks
    sigma, mean, T, spin = markers.noise_std, markers.mean, len(markers.time), None
    center, var = center_of_mass(x, X, inertia.weight, sigma**2) if mean is None else (mean.center, mean.var)
    cov, empty = np.full((T, 6, 6), np.nan), np.zeros((T, 0))
    cov[:, :3, :3] = var[:, None, None] * share(markers.root)
    unseen, lost = np.full((T, 3, 3), np.nan), np.full_like(x, np.nan)
    pose = Pose(center, unseen, cov, lost, np.full(T, np.nan), np.zeros(T))
    if inertia.line is not None:
        pose, spin = followed_line(time, pose, x, X, inertia, sigma)
    observed = np.isfinite(pose.rotation).all((1, 2)).sum() > 1
    return Kinematics(
        time, inertia, X, markers.seen, pose, np.zeros((0, *X.shape)), empty, empty, "rigid",
        {"position": markers.root}, {"position": markers.stated}, bool(observed), spin=spin,
        apart=mean is not None, markers=markers,
        inside=markers.inside, known=markers.known,
    )  # fmt: skip


def from_mean_motion(
    body: Body, motion: Motion, stated: dict[str, float], noise: dict[str, Array]
) -> Kinematics:
    """Kinematics of a measured mean motion: center and, where given, orientation."""
    assert motion.center is not None
    inertia = inertia_of(body)
    T, time, nodes = len(motion.time), motion.time, len(body.node)
    root = noise["center"] if "center" in noise else np.sqrt(noise_variance(time, motion.center)) * np.eye(3)
    root = floored(root, ROUNDOFF * float(np.nanmax(np.ptp(motion.center, axis=0), initial=1e-9)))
    cov, c_std = np.zeros((T, 6, 6)), rms_noise(root)
    cov[:, :3, :3] = root @ root.T
    X = np.zeros((nodes, 3)) if body.position is None else body.position - inertia.center
    inertia, spin = thinned(inertia, X), None
    levels = {"center": root}
    R = np.full((T, 3, 3), np.nan)
    attitude = motion.orientation is not None and bool(np.isfinite(inertia.tensor).all())
    attitude = attitude and not inertia.point
    if motion.orientation is not None:
        R = rotations(motion.orientation)
        whole: Flags = np.asarray(np.isfinite(R).all((1, 2)))
        pair, steps = whole[1:] & whole[:-1], np.zeros((T, 3))
        steps[1:][pair] = log((R[1:] @ R[:-1].swapaxes(1, 2))[pair])
        angle = np.where(whole[:, None], np.cumsum(steps, axis=0), np.nan)
        turn = noise.get("orientation")
        if turn is None:
            turn = np.sqrt(noise_variance(time, angle)) * np.eye(3)
        levels["orientation"] = turn = floored(turn, ROUNDOFF)
        cov[:, 3:, 3:] = turn @ turn.T
    empty = np.zeros((T, 0))
    pose = Pose(motion.center, R, cov, np.zeros((T, nodes, 3)), np.full(T, np.nan), np.zeros(T))
    if inertia.line is not None and attitude:
        pose, spin = followed_line(time, pose, None, X, inertia, c_std)
    known, none = {name: name in stated for name in levels}, np.zeros((0, nodes, 3))
    return Kinematics(
        time, inertia, X, np.zeros(nodes, bool), pose, none, empty, empty, "rigid", levels, known, attitude,
        spin=spin, inside=momentum_inside(body, motion), known=motion.known,
    )  # fmt: skip


def rotations(quaternion: Array) -> Array:
    """Rotation matrices (time, 3, 3), NaN where the quaternion is."""
    R = np.full((len(quaternion), 3, 3), np.nan)
    seen = np.isfinite(quaternion).all(1)
    if seen.any():
        R[seen] = Rotation.from_quat(quaternion[seen]).as_matrix()
    return R


def scaled_noise(kin: Kinematics, factor: dict[str, Array]) -> dict[str, Array]:
    """Noise of a record, each times the factor (3, 3) along world axes that tuning found for it."""
    roots = {name: root @ factor.get(name, np.eye(3)) for name, root in kin.noise_root.items()}
    return {name: 0.5 * (root + root.T) for name, root in roots.items()}


def shape_at(kin: Kinematics, amplitude: Array) -> Array:
    """Shape (time, node, 3) about the mass center, body axes, at mode amplitudes (time, mode)."""
    return np.asarray(kin.shape + np.einsum("tk,kna->tna", amplitude, kin.shapes))


def mapped(mean: Array, shape: Array) -> Array:
    """The linear maps (time, 3, 3) that take a mean shape (node, 3), with a shift, nearest to shapes (time,
    node, 3).
    """
    spread = mean - mean.mean(0)
    back = np.linalg.pinv(spread, rcond=SOLVED)
    return np.asarray(np.eye(3) + np.einsum("tna,bn->tab", shape - mean, back, optimize=True))
