"""The errors of segments, told by the gaps at their joints: how large they are, how slow, and when.

The markers of a segment, fitted to where they are in the reference pose, carry every point of it along, its
joints too. Where two segments meet there are two views of one point, and their gap is the error of one
segment less that of its neighbor, whatever the motion. Errors of segments are taken to be alike in size
and independent, so that half of the joints have gaps of more than twice the variance of one, half of less: a
joint whose center is badly placed shows that as well, and does not rule the median. The mass center takes of
every segment the share of the mass that its markers place. What all segments have in common no gap shows.
A filter that tracks went through shows in gaps as well, and is undone; samples that then tell nothing new
are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from forceid.estimation.body.tracks.bridging import straight
from forceid.estimation.body.tracks.marker_errors import SPECTRAL
from forceid.estimation.body.tracks.segment_color import color_of, new_in, scatter, source_of
from forceid.estimation.body.tracks.source_filter import WORTH, undone
from forceid.flight.color import Color, LowPassed
from forceid.motion import fit_rotation
from forceid.principal import cross_matrix
from forceid.records import Array, Body, Flags, Indices, Motion, all_finite
from forceid.significance import TENTH

FIXED_BY = 3  # markers that fix how a segment stands
MISPLACED = 0.03  # m, by which a joint may be off in a segment: half the width of a limb
LASTING = 10  # samples that an error of the skin lasts: of as many one counts


@dataclass(frozen=True)
class SegmentNoise:
    """Errors of the segments of a body, world axes, one size and color for all.

    var (3,) m2 of a segment along each axis, in the mean over the record; most: the std of the loudest joint
    over that; doubt: variance of the logarithm of errors, from joint to joint; size (time,): how large errors
    are at a time, of mean square one; source: filter that the tracks went through, and left: what
    undoing it leaves of it, None for none; share
    (segment, node): of a node that markers of the segment place; owner (node,): the segment of each, its own
    or the one that places most of it.
    """

    var: Array
    most: float
    doubt: float
    size: Array
    color: Color
    source: LowPassed | None
    left: LowPassed | None
    share: Array
    owner: Indices

    def of_nodes(self, own: Flags) -> SegmentNoise:
        """The same of some nodes (node,) alone."""
        return replace(self, share=self.share[:, own], owner=self.owner[own])

    def of_center(self, mass: Array) -> Array:
        """Covariance (3, 3) m2 of the mass center of nodes of masses (node,), in the mean over the record."""
        part = self.share @ (mass / mass.sum())
        return np.diag(self.var) * float(part @ part)

    def numbers(self, mass: Array) -> dict[str, float]:
        """What a result file says of them: of the mass center (m), in the mean, and the color."""
        std = np.sqrt(np.diagonal(self.of_center(mass)))
        found = {f"noise_std_center_{axis}": float(value) for axis, value in zip("xyz", std, strict=True)}
        found |= {"noise_order": float(self.color.order), "noise_rate": self.color.rate}
        return found | {"noise_least_size": float(self.size.min()), "noise_most_size": float(self.size.max())}

    def of_momentum(self, mass: Array, arm: Array) -> Array:
        """Covariance (time, 3, 3) of sum m u x e, nodes at arms u (time, node, 3) from the mass center."""
        lever = cross_matrix(np.einsum("sn,n,tna->tsa", self.share, mass, arm, optimize=True))
        return np.asarray(np.einsum("tsab,b,tscb->tac", lever, self.var, lever, optimize=True))


def segment_noise(body: Body, time: Array, poses: SegmentPoses) -> SegmentNoise | None:
    """The errors of segments as the joint gaps show them; None where too few frames do."""
    gaps = bridged_gaps(time, joint_gaps(body, poses))
    if gaps is None or len(gaps) < SPECTRAL:
        return None
    step = float(np.ptp(time)) / (len(time) - 1)
    color = color_of(gaps, step)
    even = evened(gaps, step, color)
    var, size = (even**2).mean(0), local_size(even, step, color)
    doubt = scatter(var.mean(1))
    source, left = source_of(gaps, step, doubt) or (None, None)
    if (every := new_in(source)) > 1:
        color = color_of(gaps[::every], step * every)
        var = (evened(gaps[::every], step * every, color) ** 2).mean(0)
    usual = 0.5 * np.median(var, axis=0)
    most = float(np.sqrt((var.max(0) / usual).mean()))
    share = shares(body, poses)
    owner = share.argmax(0)
    owner[poses.segment] = np.arange(len(poses.segment))
    return SegmentNoise(usual, most, doubt, size, color, source, left, share, owner)


def restored(body: Body, motion: Motion) -> tuple[Motion, LowPassed | None, LowPassed | None]:
    """The motion of segments as before the filter of its tracks, that filter, and what is left of it."""
    noise, tracks = segment_noise(body, motion.time, segment_poses(body, motion)), motion.marker_position
    if noise is None or noise.source is None or noise.left is None or motion.bridged is not None:
        return motion, None, None
    if motion.position is None or tracks is None or noise.left.cut < WORTH * noise.source.cut:
        return motion, None, None
    both = noise.source, noise.left
    found = replace(motion, position=undone(motion.position, *both), marker_position=undone(tracks, *both))
    return found, *both


def bridged_gaps(time: Array, gaps: Array) -> Array | None:
    """Gaps (time, joint, 3) about their means, straight across frames that do not show one; None for none."""
    seen: Flags = all_finite(gaps)
    shown = seen.mean(0) > 0.5
    if not shown.any():
        return None
    out = np.zeros_like(gaps)
    for j in np.flatnonzero(shown):
        out[:, j] = straight(time, time[seen[:, j]], gaps[seen[:, j], j])
    return np.asarray(out - out.mean(0))


def evened(gaps: Array, step: float, color: Color) -> Array:
    """Gaps (time, joint, 3) without their color, every octave as strong, as large as errors are in the mean.

    Mirrored at their ends, where they would jump else.
    """
    n = len(gaps)
    w: Array = np.asarray(2 * np.pi * np.fft.rfftfreq(2 * n, step))
    waves = np.fft.rfft(np.concatenate([gaps, gaps[::-1]]), axis=0)
    gain = np.zeros(len(w))
    gain[2:] = 1 / np.sqrt(color.density(w[2:]) * w[2:])
    gain *= np.sqrt(n / (gain[2:] ** 2 * color.density(w[2:])).sum())
    return np.asarray(np.fft.irfft(waves * gain[:, None, None], 2 * n, axis=0)[:n])


def local_size(even: Array, step: float, color: Color) -> Array:
    """How large errors are at a time (time,), of mean square one, from gaps without their color.

    Over as long as errors remember themselves: less shows no more of them.
    """
    power = ((even / np.maximum(even.std(0), np.finfo(float).tiny)) ** 2).mean((1, 2))
    smooth = gaussian_filter1d(power, max(color.order / color.rate / step, 1.0), mode="nearest")
    return np.asarray(np.sqrt(smooth / smooth.mean()))


def shares(body: Body, poses: SegmentPoses) -> Array:
    """Share (segment, node) of every node that markers of each segment place.

    A marker on no segment counts for that of its node, or else as the other markers of the node do; where
    there are none, for all segments alike.
    """
    weight, owner = body.marker_weight, body.marker_segment
    assert weight is not None
    assert owner is not None
    placed = np.stack([weight[:, owner == k].sum(1) for k in poses.segment])
    left = 1 - placed.sum(0)
    for node in np.flatnonzero(np.abs(left) > TENTH**2):
        own = poses.segment == node
        placed[:, node] = np.where(own, placed[:, node] + left[node], placed[:, node])
        if not own.any():
            some = placed[:, node].sum()
            placed[:, node] = placed[:, node] / some if some > TENTH else 1 / len(own)
    return placed


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
        seen = all_finite(tracks[:, own]).sum(1) >= FIXED_BY
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
