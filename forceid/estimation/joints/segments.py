"""What passes the joints of a body of segments, as a person is: each holds all that hangs behind it.

The lighter side of a joint is a body of mass points of its own, found as the whole is, under the same errors
of segments. What moves it is what the joint passes to it and what the ground gives a foot on it, the rest is
weight. So the wrench of a joint is that of its lighter side less that of the feet there, both taken to the
joint; where that is, errs with the segments and by how well a joint is placed at all, a lever of the force.
Source: principal equations 2.8; Winter, Biomechanics and Motor Control of Human Movement (2009), 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from forceid.config import Settings
from forceid.errors import EstimationError
from forceid.estimation.body.cleaning import prepared
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.body.segment_noise import SegmentPoses, joint_gaps, segment_noise, segment_poses
from forceid.estimation.body.tracks.bridging import straight
from forceid.estimation.methods.in_segments import estimate_mass_points
from forceid.estimation.methods.misplaced_mass import misplaced_each
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.finding import judge
from forceid.kalman.engines import engine
from forceid.principal import cross_matrix, transport, transport_cov
from forceid.records import Array, Body, Flags, Indices, Interface, Motion, Recording, Verdict
from forceid.timing import stage

JOINT_STD = 0.01  # m, each axis: by which tables and markers misplace the middle of a joint


@dataclass(frozen=True)
class FootWrench:
    """What the ground gives a foot: its nodes, wrench (time, 6) about the mass center of all, and cov."""

    nodes: Indices
    wrench: Array
    cov: Array


@stage("joints")
def segment_joints(
    recording: Recording, settings: Settings, whole: Solution, ground: Sequence[FootWrench], verdict: Verdict
) -> Interface:
    """Force and moment of every joint that parts a body of segments in two, on its second segment.

    whole: of the body, whose verdict counts for its joints; ground: all that acts on it from outside but
    weight. EstimationError: joints show no noise, or some segments are seen in too few frames.
    """
    body, kin, passes = recording.body, whole.kinematics, engine(settings.engine)
    motion, _ = prepared(body, recording.motion, None)
    poses = segment_poses(body, motion)
    noise = segment_noise(body, motion.time, poses)
    if noise is None:
        raise EstimationError("shows its joints in too few frames", "the recording", "restore the markers")
    assert body.joint_segment is not None
    misplaced = misplaced_each(kin.inertia.weight, noise, settings)
    placed = (settings.body_std.joint or JOINT_STD) ** 2 + 0.5 * noise.var * noise.size[:, None] ** 2
    sides = lighter_sides(body, poses, noise.owner, kin.inertia.weight)
    point, gap = joint_places(body, motion.time, poses)
    wrench, covs = [], []
    for own, at, (_, second) in zip(sides, point, body.joint_segment.astype(int), strict=True):
        moved = np.asarray(own & (kin.inertia.weight > 0))
        one, some = of_some(kin, motion, moved)
        state = estimate_mass_points(
            one, some, noise.of_nodes(moved), poses, misplaced, settings, passes, whole.priors
        ).state
        w = transport(np.concatenate([state.force, state.moment], 1), state.center - at)
        cov = transport_cov(state.wrench_cov, state.center - at)
        cov = cov + settings.body_std.mass**2 * w[:, :, None] * w[:, None]
        for foot in ground:
            if own[foot.nodes].all():
                w = w - transport(foot.wrench, whole.state.center - at)
                cov = cov + transport_cov(foot.cov, whole.state.center - at)
        lever = cross_matrix(w[:, :3])
        cov[:, 3:, 3:] += (lever * placed[:, None]) @ lever.mT
        wrench.append(w if own[second] else -w)
        covs.append(cov)
    w, none = np.stack(wrench, 1), np.full(len(motion.time), np.nan)
    names = [[body.node[k] for k in pair] for pair in body.joint_segment.astype(int)]
    return Interface(
        body.joint, tuple((first, second) for first, second in names), w[..., :3], w[..., 3:],
        np.stack(covs, 1), np.stack(point, 1), np.ones(len(point), bool), np.zeros((len(point), 6, 0)),
        gap, none, 0, judge([f for f in verdict.findings if f.level != "ok"]),
    )  # fmt: skip


def lighter_sides(body: Body, poses: SegmentPoses, owner: Indices, mass: Array) -> Array:
    """The nodes (joint, node) that a joint alone holds to the rest, or the rest, whichever is lighter.

    owner (node,): the segment of each. EstimationError: other joints hold both sides together as well.
    """
    assert body.joint_segment is not None
    ends = np.searchsorted(poses.segment, body.joint_segment.astype(int))
    count, found = len(poses.segment), []
    for j, (first, second) in enumerate(ends):
        others = np.delete(ends, j, axis=0).T
        graph = sp.coo_array((np.ones(others.shape[1]), others), (count, count))
        part = connected_components(graph, directed=False)[1]
        if part[first] == part[second]:
            what = f"holds segments at {body.joint[j]} that other joints hold together as well"
            raise EstimationError(what, "the recording", "leave out the joint that closes the loop")
        each = [part[owner] == part[end] for end in (first, second)]
        found.append(min(each, key=lambda own: mass[own].sum()))
    return np.array(found)


def of_some(kin: Kinematics, motion: Motion, own: Flags) -> tuple[Kinematics, Motion]:
    """A body and its motion as some of its nodes (node,) alone."""
    assert motion.position is not None
    mass, x = kin.inertia.weight[own], motion.position[:, own]
    filled = None if motion.bridged is None else motion.bridged[:, own]
    inertia = replace(kin.inertia, mass=float(mass.sum()), weight=mass)
    pose = replace(kin.pose, center=np.einsum("n,tna->ta", mass / mass.sum(), x))
    return replace(kin, inertia=inertia, pose=pose), replace(motion, position=x, bridged=filled)


def joint_places(body: Body, time: Array, poses: SegmentPoses) -> tuple[list[Array], Array]:
    """Where every joint is (time, 3) m, halfway between both views, and these apart (time, joint, 3) m."""
    assert body.joint_segment is not None
    assert body.joint_shape is not None
    ends = np.searchsorted(poses.segment, body.joint_segment.astype(int))
    point = []
    for (first, second), X in zip(ends.tolist(), body.joint_shape, strict=True):
        both = 0.5 * (poses.carried(first, X) + poses.carried(second, X))
        seen = np.isfinite(both).all(1)
        if not seen.any():
            raise EstimationError("shows a joint in no frame", "the recording", "restore the markers")
        point.append(straight(time, time[seen], both[seen]))
    return point, joint_gaps(body, poses)
