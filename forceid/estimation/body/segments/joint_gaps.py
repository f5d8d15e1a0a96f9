"""Joint gaps: by how much two segments differ about the place of the joint that they share.

The markers of a segment, fitted to where they are in the reference pose, carry every point of it along, its
joints too. Where two segments meet there are two views of one point: what they differ by is error alone, of
both, whatever the motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.motion import fit_rotation
from forceid.records import Array, Body, Indices, Motion

FIXED_BY = 3  # markers that fix how a segment stands
MISPLACED = 0.03  # m, by which a joint may be off in a segment: half the width of a limb
LASTING = 10  # samples that an error of the skin lasts: of as many one counts


def shows_segments(body: Body, motion: Motion) -> bool:
    """Whether a recording has markers on segments that meet at joints."""
    tracks = motion.marker_position
    return body.joint_segment is not None and tracks is not None and len(tracks) == len(motion.time)


@dataclass(frozen=True)
class SegmentPoses:
    """How segments (segment,), by the nodes that they are of, stand as their markers show it.

    rotation (time, segment, 3, 3) from the reference pose to the world, and origin (time, segment, 3) m,
    where the origin of that pose went; NaN where fewer than three markers of a segment are seen.
    """

    segment: Indices
    rotation: Array
    origin: Array

    def carried(self, k: int, X: Array) -> Array:
        """Where a point X (3,) m of the reference pose is (time, 3) m, carried by segment k of these."""
        return np.asarray(self.origin[:, k] + self.rotation[:, k] @ X)


def segment_poses(body: Body, motion: Motion) -> SegmentPoses:
    """The poses of all segments that have markers, by fits to where these are in the reference pose."""
    tracks, owner, shape = motion.marker_position, body.marker_segment, body.marker_shape
    assert tracks is not None
    assert owner is not None
    assert shape is not None
    segment = np.unique(owner[owner >= 0]).astype(int)
    rotation = np.full((len(tracks), len(segment), 3, 3), np.nan)
    origin = np.full((len(tracks), len(segment), 3), np.nan)
    for k, of in enumerate(segment):
        own = owner == of
        center, R = fit_rotation(tracks[:, own], shape[own], np.ones(int(own.sum())))
        seen = np.isfinite(tracks[:, own]).all(2).sum(1) >= FIXED_BY
        rotation[seen, k], origin[seen, k] = R[seen], center[seen]
    return SegmentPoses(segment, rotation, origin)


def joint_gaps(body: Body, poses: SegmentPoses) -> Array:
    """The view of its second segment less that of the first, of every joint (time, joint, 3) m, world axes.

    About the mean, with each joint where in either segment it moves least, near to where it is said to be: a
    joint that is misplaced would turn with its segments, and pass for their errors. NaN where one of the
    segments is not known. Source: symmetrical center of rotation estimation, Ehrig et al., J. Biomechanics 39
    (2006) 2798.
    """
    assert body.joint_shape is not None
    assert body.joint_segment is not None
    sides = np.searchsorted(poses.segment, body.joint_segment.astype(int))
    gaps = []
    for (first, second), X in zip(sides.tolist(), body.joint_shape, strict=True):
        gap = poses.carried(second, X) - poses.carried(first, X)
        turns = np.concatenate([poses.rotation[:, second], poses.rotation[:, first]], 2)
        gaps.append(without_misplacement(gap, turns))
    return np.stack(gaps, 1)


def without_misplacement(gap: Array, turns: Array) -> Array:
    """A gap (time, 3) m about its mean, less the best combination of columns turns (time, 3, column).

    Each of a size that is MISPLACED at most or so.
    """
    seen = np.asarray(np.isfinite(gap).all(1) & np.isfinite(turns).all((1, 2)))
    out = np.full_like(gap, np.nan)
    if seen.any():
        g, A = gap[seen] - gap[seen].mean(0), turns[seen] - turns[seen].mean(0)
        faint = np.sqrt(LASTING) * float(g.std()) / MISPLACED * np.eye(A.shape[2])
        rows = np.concatenate([A.reshape(-1, A.shape[2]), faint])
        places = np.linalg.lstsq(rows, np.concatenate([g.ravel(), np.zeros(A.shape[2])]))[0]
        out[seen] = g - A @ places
    return out
