"""What the markers of every frame say of pose and deformation together, in 6 + m numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.motion.pose import Pose, body_axes, exp, frames_seen_alike, pose_gain, through_fit
from forceid.principal import summation_operator
from forceid.records import Array, Flags, Indices
from forceid.rounding import SOLVED


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


def fit_frames(
    position: Array,
    pose: Pose,
    shape: Array,
    shapes: Array,
    cov: Array,
    own: Array | None = None,
    uneven: Array | None = None,
) -> Frames:
    """The pose and the further numbers of every frame, from markers near a pose.

    position (time, node, 3), NaN = not seen; shape (node, 3) about the mass center; shapes (mode, node, 3);
    cov (3 node, 3 node), body axes: of marker noise and of what deforms beside the shapes; own (time, node):
    variance of single readings beside; uneven as for `fit_pose`. Generalized least squares: what the fit of
    the pose leaves is independent of it, and shows the amplitudes with the information Phi^T (V^-1 - V^-1 S C
    S^T V^-1) Phi, whose square root the rows are. So nothing is lost where markers show less than m
    amplitudes, or none. Source: principal equations 4b, 4d.
    """
    T, m = len(position), len(shapes)
    center, R = pose.center.copy(), pose.rotation.copy()
    flat, S = shapes.reshape(m, -1).T, summation_operator(shape)
    leak, rows, observed = np.zeros((T, 6, m)), np.zeros((T, m, m)), np.full((T, m), np.nan)
    out = np.full((T, 6, 6), np.nan)
    for pattern, more, frames in frames_seen_alike(position, own):
        at = frames[np.isfinite(center[frames]).all(1)]
        gain = pose_gain(S, pattern, cov + more) if len(at) else None
        if gain is None:
            continue
        K, C, _ = gain
        seen = np.repeat(pattern, 3)

        def left(at: Indices = at, pattern: Flags = pattern) -> Array:
            return (body_axes(position[at], center[at], R[at]) - shape)[:, pattern].reshape(len(at), -1)

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


def beyond_pose(gain: tuple[Array, Array, Array], flat: Array, S: Array) -> tuple[Array, Array, Array]:
    """Leak (6, mode) of amplitudes q into a pose, rows (shown, mode), and what reads rows q (channel, shown).

    gain as of `pose_gain`; flat (channel, mode) shapes and S (channel, 6) rigid motions, as markers see them.
    A residual behind the fit of the pose, times what reads, is rows q with noise of unit variance.
    """
    K, _, V_inv = gain
    leak, weighed = K @ flat, flat.T @ V_inv
    information = weighed @ (flat - S @ leak)
    size, axes = np.linalg.eigh(0.5 * (information + information.T))
    known = size > SOLVED * size.max(initial=0.0)
    root = np.sqrt(size[known])
    return leak, (axes[:, known] * root).T, weighed.T @ (axes[:, known] / root)
