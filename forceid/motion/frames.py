"""Pose of every frame, with covariance, from the markers seen in it; and of pose and deformation together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from forceid.motion.pose import PoseGain, body_axes, exp, fitted, frame_fit, frames_seen_alike, pose_gain
from forceid.motion.reading_cov import ReadingCov
from forceid.principal import summation_operator
from forceid.records import Array, Flags, Indices
from forceid.rounding import SOLVED


@dataclass(frozen=True)
class Pose:
    """center (time, 3) m and rotation (time, 3, 3), body to world; NaN where the markers do not fix them.

    cov (time, 6, 6): center, then rotation as an error on the left (rad), world axes. residual (time,
    node, 3) m, body axes: what is left of the markers. chi_square (time,): its square in units of the
    covariance the fit was given, with dof (time,) degrees of freedom.
    """

    center: Array
    rotation: Array
    cov: Array
    residual: Array
    chi_square: Array
    dof: Array


@dataclass(frozen=True)
class Frames:
    """A pose and m numbers for every frame, which hold all that its markers say of pose and amplitudes q.

    center (time, 3) m, rotation (time, 3, 3), NaN where not fixed: those of a rigid body, with covariance cov
    (time, 6, 6) of marker noise alone, as in `Pose`; deformation bends them by leak q, leak (time, 6, mode)
    in world axes. observed (time, mode) = rows q + noise of unit variance, rows (time, mode, mode), NaN where
    there is no further number; that noise is independent of the pose's.
    """

    center: Array
    rotation: Array
    cov: Array
    leak: Array
    observed: Array
    rows: Array


def fit_pose(
    position: Array,
    shape: Array,
    weight: Array,
    cov: Array | ReadingCov,
    own: Array | None = None,
    uneven: Array | None = None,
    begin: Array | None = None,
) -> Pose:
    """Pose of every frame by generalized least squares from the markers seen in it.

    position (time, node, 3), NaN = not seen; shape (node, 3) about the mass center; weight (node,) of the
    rotation fit that it starts from, to the shape begin (node, 3) where one is given; cov, or a matrix of
    it (3 node, 3 node), body axes: of marker noise, plus of the deformation, if there is one. With the
    deformation in the mass gauge in `cov`, a marker lost biases neither center nor rotation. own (time,
    node) m2: variance that single readings have beside. uneven (3, 3) m2: covariance of the noise of every
    marker beside, world axes; it moves no weight of the fit, and is in the covariance of the pose. Source:
    principal equations 2.5, 4b.
    """
    T, cov = len(position), ReadingCov.of(cov)
    center, R, cov6 = np.full((T, 3), np.nan), np.full((T, 3, 3), np.nan), np.full((T, 6, 6), np.nan)
    out = Pose(center, R, cov6, np.full_like(position, np.nan), np.full(T, np.nan), np.zeros(T))
    for pattern, more, at in frames_seen_alike(position, own):
        fit = frame_fit(shape, weight, pattern, cov, more, begin)
        if fit is None:
            continue
        found = fitted(fit, position, at)
        if uneven is not None:
            found = (*found[:2], found[2] + through_fit(fit.gain[0], found[1], uneven), *found[3:])
        dof = np.full(len(at), 3.0 * pattern.sum() - 6)
        if len(at) == T:
            return Pose(*found, dof)
        for whole, part in zip(
            (center, R, cov6, out.residual, out.chi_square, out.dof), (*found, dof), strict=True
        ):
            whole[at] = part
    return out


def poses_about(
    pose: Pose,
    position: Array,
    shape: Array,
    weight: Array,
    cov: Array | ReadingCov,
    path: tuple[Array, Array],
    uneven: Array | None = None,
) -> Pose:
    """The poses of `fit_pose` linearized about a path, center (time, 3) and rotation (time, 3, 3).

    A pose by itself is linearized where its own errors have brought it. About a path that is better known
    markers are linear in their errors, however far these turn the pose of a frame. The rest as of `fit_pose`;
    what is left of the markers stays. Source: the smoother of Bell, SIAM J. Optim. 4 (1994) 626.
    """
    center, R, C, cov = pose.center.copy(), pose.rotation.copy(), pose.cov.copy(), ReadingCov.of(cov)
    for pattern, _, at in frames_seen_alike(position):
        fit = frame_fit(shape, weight, pattern, cov)
        if fit is None:
            continue
        about = path[1][at]
        left = (body_axes(position[at], path[0][at], about) - shape)[:, pattern].reshape(len(at), -1)
        d = left @ fit.gain[0].T
        center[at] = path[0][at] + np.einsum("tab,tb->ta", about, d[:, :3])
        R[at], turn = about @ exp(d[:, 3:]), np.zeros((len(at), 6, 6))
        turn[:, :3, :3] = turn[:, 3:, 3:] = about
        C[at] = turn @ fit.cov @ turn.mT
        if uneven is not None:
            C[at] += through_fit(fit.gain[0], about, uneven)
    return replace(pose, center=center, rotation=R, cov=C)


def second_order(cov: Array, turn: Array | None = None) -> Array:
    """How far (time,) a turn of a pose moves the mass center in second order, in standard deviations of it.

    Of those it has where the rotation is known. cov (time, 6, 6): of poses, turn (time, 3) rad, world axes:
    one standard deviation about the axis that is known worst if not given.

    >>> cov = np.diag([1.01, 1e-2, 1e-2, 1e-4, 1e-4, 1e-2])
    >>> cov[0, 5] = cov[5, 0] = 0.1  # a mass center that a turn about z moves by 10 m/rad along x
    >>> second_order(cov[None]).round(9).tolist()
    [0.5]
    """
    by_turn = cov[:, :3, 3:] @ np.linalg.inv(cov[:, 3:, 3:])
    if turn is None:
        square, axes = np.linalg.eigh(cov[:, 3:, 3:])
        turn = np.sqrt(square[:, -1:]) * axes[:, :, -1]
    moved = 0.5 * np.cross(turn, (by_turn @ turn[..., None])[..., 0])
    known = cov[:, :3, :3] - by_turn @ cov[:, 3:, :3]
    return np.asarray(np.sqrt(np.einsum("ta,ta->t", moved, np.linalg.solve(known, moved[..., None])[..., 0])))


def fit_frames(
    position: Array,
    pose: Pose,
    shape: Array,
    shapes: Array,
    cov: Array | ReadingCov,
    own: Array | None = None,
    uneven: Array | None = None,
) -> Frames:
    """The pose and the further numbers of every frame, from markers near a pose.

    position (time, node, 3), NaN = not seen; shape (node, 3) about the mass center; shapes (mode, node, 3);
    cov as for `fit_pose`: of marker noise and of what deforms beside the shapes; own (time, node): variance
    of single readings beside; uneven as for `fit_pose`. Generalized least squares: what the fit of
    the pose leaves is independent of it, and shows the amplitudes with the information Phi^T (V^-1 - V^-1 S C
    S^T V^-1) Phi, whose square root the rows are. So nothing is lost where markers show less than m
    amplitudes, or none. Source: principal equations 4b, 4d.
    """
    T, m, cov = len(position), len(shapes), ReadingCov.of(cov)
    center, R = pose.center.copy(), pose.rotation.copy()
    flat, S = shapes.reshape(m, -1).T, summation_operator(shape)
    leak, rows, observed = np.zeros((T, 6, m)), np.zeros((T, m, m)), np.full((T, m), np.nan)
    out = np.full((T, 6, 6), np.nan)
    for pattern, more, frames in frames_seen_alike(position, own):
        at = frames[np.isfinite(center[frames]).all(1)]
        gain = pose_gain(S, pattern, cov, more) if len(at) else None
        if gain is None:
            continue
        K, C, _ = gain
        seen = np.repeat(pattern, 3)

        def left(at: Indices = at, pattern: Flags = pattern) -> Array:
            beside = body_axes(position[at], center[at], R[at])
            beside -= shape
            return (beside if pattern.all() else beside[:, pattern]).reshape(len(at), -1)

        d = left() @ K.T
        center[at] += np.einsum("tab,tb->ta", R[at], d[:, :3])
        R[at] = R[at] @ exp(d[:, 3:])
        turn = np.zeros((len(at), 6, 6))
        turn[:, :3, :3] = turn[:, 3:, 3:] = R[at]
        off, shown, read = beyond_pose(gain, flat[seen], S[seen])
        out[at], leak[at] = turn @ C @ turn.swapaxes(1, 2), turn @ off
        if uneven is not None:
            out[at] += through_fit(K, R[at], uneven)
        rows[at, : len(shown)], observed[at, : len(shown)] = shown, left() @ read
    return Frames(center, R, out, leak, observed, rows)


def through_fit(gain: Array, rotation: Array, noise_cov: Array) -> Array:
    """Covariance (time, 6, 6), world axes, of poses under noise of markers with noise_cov (3, 3), world axes.

    gain (6, channel): of the fit, body axes; rotation (time, 3, 3).
    """
    each = gain.reshape(6, -1, 3).swapaxes(0, 1)
    seen = rotation.swapaxes(1, 2) @ noise_cov @ rotation
    made = np.einsum("nia,njb->ijab", each, each)
    body = np.einsum("ijab,tab->tij", made, seen)
    turn = np.zeros((len(rotation), 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = rotation
    return np.asarray(turn @ body @ turn.swapaxes(1, 2))


def beyond_pose(gain: PoseGain, flat: Array, S: Array) -> tuple[Array, Array, Array]:
    """Leak (6, mode) of amplitudes q into a pose, rows (shown, mode), and what reads rows q (channel, shown).

    gain as of `pose_gain`; flat (channel, mode) shapes and S (channel, 6) rigid motions, as markers see them.
    A residual behind the fit of the pose, times what reads, is rows q with noise of unit variance.
    """
    K, _, noise = gain
    leak, unit = K @ flat, noise.whitened(flat.T)
    information = unit @ noise.whitened((flat - S @ leak).T).T
    size, axes = np.linalg.eigh(0.5 * (information + information.T))
    known = size > SOLVED * size.max(initial=0.0)
    root = np.sqrt(size[known])
    return leak, (axes[:, known] * root).T, noise.reading(unit).T @ (axes[:, known] / root)
