"""Mean rotation and mass center of frames that see the same markers, with covariance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from forceid.compiled import engine as compiled
from forceid.motion.reading_cov import ReadingCov
from forceid.principal import summation_operator
from forceid.records import Array, Flags, Indices, all_finite
from forceid.rounding import ITERATIONS, SINGLE
from forceid.significance import THOUSANDTH

PoseGain = tuple[Array, Array, ReadingCov]  # gain (6, channel), covariance (6, 6), that of the channels
ONLY = np.zeros(1, np.intp)  # the frame in a stack of one


def fit_rotation(position: Array, shape: Array, weight: Array) -> tuple[Array, Array]:
    """Weighted rotation fit (Kabsch) of every frame: center (time, 3) and rotation (time, 3, 3).

    position (time, node, 3), NaN = not seen; shape (node, 3); weight (node,). Maximizes tr(R^T G), G = sum w
    rho X^T, over the markers seen. `center` is where the origin of `shape` went. Source: principal equations
    4b, item 2.

    >>> turned = np.array([[[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]])
    >>> fit_rotation(turned, np.eye(3), np.ones(3))[1][0].round(9) + 0.0
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    if compiled is None:
        return fit_rotation_in_numpy(position, shape, weight)
    center, R, arrived = compiled.kabsch(position, shape, weight)
    if len(hard := np.flatnonzero(arrived != 1)):
        center[hard], R[hard] = fit_rotation_in_numpy(position[hard], shape, weight)
    return center, R


def fit_rotation_in_numpy(position: Array, shape: Array, weight: Array) -> tuple[Array, Array]:
    """`fit_rotation`, of all frames at once."""
    w = np.where(all_finite(position), weight, 0.0)
    x = np.where(w[..., None] > 0, position, 0.0)
    total = np.maximum(w.sum(1), 1e-300)[:, None]
    weighed = (w[..., None] * x).mT
    x_mean, X_mean = weighed.sum(-1) / total, w @ shape / total
    G = weighed @ shape - total[..., None] * x_mean[:, :, None] * X_mean[:, None]
    U, _, Vt = np.linalg.svd(G)
    U[..., 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    R = U @ Vt
    return x_mean - np.einsum("tab,tb->ta", R, X_mean), R


def frames_seen_alike(
    position: Array, own: Array | None = None
) -> Iterator[tuple[Flags, Array | None, Indices]]:
    """Frames of position (time, node, 3) that see the same markers equally well.

    The markers seen (node,), the variance (node,) of their readings by own (time, node), None where they have
    none beside that of all, and which frames.
    """
    patterns, which = seen_together(position)
    for i, pattern in enumerate(patterns):
        at = np.flatnonzero(which == i)
        if own is None or not own[at].any():
            yield pattern, None, at
            continue
        each, of = np.unique(np.where(pattern, own[at], 0.0), axis=0, return_inverse=True)
        for j, var in enumerate(each):
            yield pattern, var, at[of.ravel() == j]


def seen_together(position: Array) -> tuple[Flags, Indices]:
    """Sets of markers (pattern, node) that frames see, and which of them each frame does, (time,)."""
    if np.isfinite(position).all():
        return np.ones((1, position.shape[1]), bool), np.zeros(len(position), np.intp)
    seen = all_finite(position)
    packed = np.packbits(seen, axis=1)
    keys = np.ascontiguousarray(packed).view(np.dtype((np.void, packed.shape[1]))).ravel()
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    return seen[first], which


@dataclass(frozen=True)
class FrameFit:
    """What the pose of frames takes that see the markers of `pattern` (node,): prepared once for all of them.

    shape (node, 3) m about the mass center; start (node,): weights of the rotation fit that begins, to the
    shape begin (node, 3); gain: gain (6, channel), covariance (6, 6) of the pose in body axes, and that of
    the channels; nodes: of the pattern.
    """

    pattern: Flags
    shape: Array
    start: Array
    begin: Array
    gain: PoseGain
    nodes: Indices

    @property
    def cov(self) -> Array:
        """Covariance (6, 6) of the pose, body axes, rotation as a right error."""
        return self.gain[1]


def frame_fit(
    shape: Array,
    weight: Array,
    pattern: Flags,
    cov: ReadingCov,
    own: Array | None = None,
    begin: Array | None = None,
) -> FrameFit | None:
    """The fit of frames that see the markers of a pattern; None where they do not fix a rotation.

    weight (node,) of the rotation fit that begins; cov, own (node,), begin: as for `fit_pose`.

    >>> fit = frame_fit(np.eye(3), np.ones(3), np.ones(3, bool), ReadingCov.of(np.eye(9)))
    >>> fit_one(fit, np.eye(3) + 2.0)[0].round(9).tolist()
    [2.0, 2.0, 2.0]
    """
    gain = pose_gain(summation_operator(shape), pattern, cov, own)
    if gain is None:
        return None
    # every marker counts in the start: those with mass need not fix the rotation where one of them is lost
    begin = shape if begin is None else begin
    return FrameFit(pattern, shape, weight + weight.max(), begin, gain, np.flatnonzero(pattern))


def fit_one(fit: FrameFit, position: Array) -> tuple[Array, Array, Array]:
    """Center (3,), rotation (3, 3) and residual (node, 3), body axes, of one frame (node, 3)."""
    center, R, _, residual = fitted_poses(fit, position[None], ONLY)
    return center[0], R[0], residual[0]


def fitted(fit: FrameFit, position: Array, at: Indices) -> tuple[Array, Array, Array, Array, Array]:
    """Poses of frames `at` that see the pattern of the fit: center, rotation, cov, residual, chi_square."""
    center, R, cov, residual = fitted_poses(fit, position, at)
    return center, R, cov, residual, chi_squares(residual, fit.pattern, fit.gain[2])


def fitted_poses(fit: FrameFit, position: Array, at: Indices) -> tuple[Array, Array, Array, Array]:
    """`fitted` without chi_square. Compiled where a compiler was."""
    if compiled is None:
        return fitted_in_numpy(fit, position[at])
    A, C, _ = fit.gain
    start = fit.start[fit.nodes]
    *found, arrived = compiled.fitted(position, at, fit.nodes, fit.shape, fit.begin, start, A, C)
    if len(hard := np.flatnonzero(arrived != 1)):
        for whole, part in zip(found, fitted_in_numpy(fit, position[at[hard]]), strict=True):
            whole[hard] = part
    center, R, cov, residual = found
    return center, R, cov, residual


def chi_squares(residual: Array, pattern: Flags, noise: ReadingCov) -> Array:
    """Chi-square (time,) of residuals (time, node, 3) of the markers of a pattern (node,)."""
    whole = residual if pattern.all() else residual[:, pattern]
    z = noise.whitened(whole.reshape(len(whole), -1))
    return np.asarray(np.einsum("ti,ti->t", z, z))


def fitted_in_numpy(fit: FrameFit, position: Array) -> tuple[Array, Array, Array, Array]:
    """`fitted`, of all frames at once, without chi_square."""
    pattern, shape, (A, C, _) = fit.pattern, fit.shape, fit.gain
    center, R = first_poses(fit, position)
    levers = A.reshape(6, -1, 3)
    moving = np.arange(len(position))
    for step in range(ITERATIONS):  # Newton: a body that is strained turns about the shape that it has
        e = (body_axes(position[moving], center[moving], R[moving]) - shape)[:, pattern]
        d = e.reshape(len(e), -1) @ A.T
        turned = np.cross(e[:, :, None], levers.swapaxes(0, 1)).sum(1)  # (frame, 6, 3)
        d[:, 3:] = np.linalg.solve(np.eye(3) + turned[:, 3:], d[:, 3:, None])[..., 0]
        d[:, :3] -= np.einsum("tab,tb->ta", turned[:, :3], d[:, 3:])
        center[moving] += np.einsum("tab,tb->ta", R[moving], d[:, :3])
        R[moving] = R[moving] @ exp(d[:, 3:])
        if step:
            moving = moving[(d**2 > THOUSANDTH**2 * np.diagonal(C)).any(1)]
        if not len(moving):
            break
    own = np.broadcast_to(C, (len(position), 6, 6)).copy()
    for t in moving:
        center[t], R[t], left = nearest_pose(fit, position[t])
        own[t] += np.outer(left, left)
    residual = body_axes(position, center, R) - shape
    turn = np.zeros((len(position), 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = R
    return center, R, turn @ own @ turn.swapaxes(1, 2), residual


def first_poses(fit: FrameFit, position: Array) -> tuple[Array, Array]:
    """Center (time, 3) and rotation (time, 3, 3) that the fit of frames (time, node, 3) begins with."""
    center, R = fit_rotation(position, fit.begin, fit.start)
    own = fit.start * fit.pattern
    return center + R @ (own @ (fit.begin - fit.shape) / own.sum()), R


def nearest_pose(fit: FrameFit, position: Array) -> tuple[Array, Array, Array]:
    """The pose that comes nearest to the fit of a frame (node, 3) that no pose meets, and what is left (6,).

    So where shapes bend markers so far that a turn undoes none of it. Nearest in standard deviations; what
    is left is an error of this pose, body axes, beside its covariance.
    """
    (first,), (turned,) = first_poses(fit, position[None])
    A, C, _ = fit.gain
    std = np.sqrt(np.diagonal(C))
    size, axes = np.linalg.eigh(C / std / std[:, None])
    unit = (axes / np.sqrt(np.maximum(size, SINGLE))).T / std

    def pose(move: Array) -> tuple[Array, Array]:
        return first + turned @ move[:3], turned @ exp(move[3:])

    def error(move: Array) -> Array:
        center, R = pose(move)
        return np.asarray((position - center) @ R - fit.shape)[fit.pattern].ravel()

    def weighed(move: Array) -> Array:
        return np.asarray(unit @ (A @ error(move)))

    found = least_squares(weighed, np.zeros(6), x_scale=std)
    return *pose(found.x), A @ error(found.x)


def pose_gain(S: Array, seen: Flags, cov: ReadingCov, own: Array | None = None) -> PoseGain | None:
    """Gain (6, channel), covariance (6, 6) of the pose errors, and that of the readings seen (node,).

    S (3 node, 6): rigid-body modes; cov, own (node,): as for `fit_pose`. None if their rank is below 6.
    """
    Ss, noise = S[np.repeat(seen, 3)], cov.seen(seen, own)
    if not seen.any() or pose_rank(Ss) < 6:
        return None
    unit = noise.whitened(Ss.T)
    C = np.linalg.inv(unit @ unit.T)
    return C @ noise.reading(unit), np.asarray(C), noise


def pose_rank(S: Array) -> int:
    """Rank of the rigid-body modes (channel, 6) that markers see, lengths in units of the body.

    >>> line = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
    >>> pose_rank(summation_operator(line)), pose_rank(summation_operator(np.eye(3)))
    (5, 6)
    """
    blocks = S.reshape(-1, 3, 6)
    lever = blocks[..., 3:] - blocks[..., 3:].mean(0)
    size = np.sqrt((lever**2).sum((1, 2)).mean())
    scaled = np.concatenate([blocks[..., :3], lever / size if size > 0 else lever], -1).reshape(-1, 6)
    s = np.linalg.svd(scaled, compute_uv=False)
    return int((s > SINGLE * s[0]).sum())


def body_axes(position: Array, center: Array, R: Array) -> Array:
    """R^T (x - c) of every node: (time, node, 3)."""
    return np.asarray((position - center[:, None]) @ R)


def exp(phi: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    return np.asarray(Rotation.from_rotvec(phi).as_matrix())


def log(R: Array) -> Array:
    """Rotation vectors (..., 3) of rotation matrices (..., 3, 3)."""
    return np.asarray(Rotation.from_matrix(R).as_rotvec())
