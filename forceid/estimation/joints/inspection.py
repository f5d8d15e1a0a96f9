"""Which forces between parts the motion can tell, before any is estimated.

From the poses of single frames: what the joints can pass there, and what of it the balances of the parts
fix. Source: principal equations 2.8, 2.11 A, 4h.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.config import Settings
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.joints.bending import carried
from forceid.estimation.joints.checks import empty_interface, judge_joints, of_part
from forceid.estimation.joints.linkage import joint_ends, passed
from forceid.estimation.joints.null_space import column_space, trading_joints, undetermined_components
from forceid.estimation.joints.parts import Joint, Part, parts_of
from forceid.estimation.joints.prospects import JointProspect, JointProspects, PartProspect
from forceid.estimation.loads.bandwidth import bandwidths
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import judge_recording, refusing
from forceid.estimation.verdict.leakage import LOOKED
from forceid.partition import link_resultants
from forceid.partition.coupling.resultants import GROUND, incidence, loop_count, transmitted
from forceid.principal import transport_matrix
from forceid.records import Array, Recording, Verdict
from forceid.rounding import SINGLE
from forceid.significance import WILD


@dataclass(frozen=True)
class Poses:
    """Frames (time) that show every part: its center (time, part, 3) m, its rotation (time, part, 3, 3) and
    their covariance (time, part, 6, 6); mass (part,) kg.
    """

    center: Array
    rotation: Array
    cov: Array
    mass: Array

    @property
    def middle(self) -> Poses:
        """The frame in the middle."""
        k = len(self.center) // 2
        return Poses(self.center[k : k + 1], self.rotation[k : k + 1], self.cov[k : k + 1], self.mass)

    @property
    def whole(self) -> Array:
        """The mass center of all parts (time, 3) m."""
        return np.asarray(np.einsum("p,tpa->ta", self.mass / self.mass.sum(), self.center))

    @property
    def arms(self) -> Array:
        """From there to those of the parts (time, part, 3) m."""
        return np.asarray(self.center - self.whole[:, None])

    @property
    def length(self) -> float:
        """The size of these arms (m)."""
        return float(np.sqrt((self.arms**2).sum(-1).mean())) or 1.0


def inspect_linkage(recording: Recording, settings: Settings) -> JointProspects:
    """Parts, joints and what the motion tells of them; ConfigError for what does not fit the recording."""
    parts, joints = parts_of(recording, settings)
    alone = settings.model_copy(update={"part": (), "joint": (), "load": (), "moment_about": "mass_center"})
    kins = [kinematics(p.recording.body, p.recording.motion, alone) for p in parts]
    judged = [judge_recording(kin) for kin in kins]
    findings = [
        of_part(f, part.name, f.level) for part, found in zip(parts, judged, strict=True) for f in found
    ]
    poses = poses_of(parts, kins)
    passes = [passed(joint, np.eye(3)[None]).shape[2] for joint in joints]
    null, told = np.zeros((len(joints), 6, 0)), 0
    own = [np.eye(6)[:, :0]] * len(joints)
    if len(poses.center):
        point, gap, gap_cov = joint_points(joints, parts, poses)
        null, told = undetermined_wrenches(joints, parts, poses.middle)
        own = in_part_axes(joints, parts, poses.middle, null)
        links, each = passes_of(joints, parts, poses)  # the poses are taken at their word
        found = link_resultants(links, np.zeros((len(point), len(parts), 6)), None, each)
        determined = found.determined[: len(joints)]
        empty = empty_interface(joints, parts, point, gap, determined, Verdict())
        findings += judge_joints(empty, gap_cov, np.zeros((len(point), len(parts), 6)))
        # joints that the estimate tells, with errors without bound, since noise alone opens a loop
        if hidden := [
            j.name for j, known, o in zip(joints, determined, own, strict=True) if known and o.size
        ]:
            findings.append(note("joint-nearly-undetermined", names=", ".join(hidden)))
    elif not refusing(findings):
        findings.append(note("no-common-frame"))
    return JointProspects(
        part=tuple(
            part_prospect(part, kin, not refusing(found))
            for part, kin, found in zip(parts, kins, judged, strict=True)
        ),
        joint=tuple(
            JointProspect(
                setting.name, setting.parts, setting.kind, setting.driven, tuple(joint.at.tolist()),
                passes[k], passes[k] - own[k].shape[1] if len(poses.center) else 0,
                undetermined_components(own[k]),
            )
            for k, (joint, setting) in enumerate(zip(joints, settings.joint, strict=True))
        ),
        resultants=sum(passes) + 6 * sum(part.external for part in parts),
        told=told,
        spare=6 * len(parts) - told if len(poses.center) else 0,
        loops=loop_count([(j.before, j.behind) for j in joints], len(parts)),
        trading=tuple(tuple(joints[k].name for k in group) for group in trading_joints(null)),
        findings=tuple(findings),
    )  # fmt: skip


def part_prospect(part: Part, kin: Kinematics, force: bool) -> PartProspect:
    """What can be identified of a part by itself."""
    force = force and bool(np.isfinite(kin.pose.center).any())
    reach = bandwidths(kin, part.recording.motion.gravity, force)
    seen = int(kin.seen.sum())
    return PartProspect(
        part.name, part.mass, len(kin.seen), seen, part.external, force, force and kin.attitude, *reach
    )


def poses_of(parts: tuple[Part, ...], kins: list[Kinematics]) -> Poses:
    """Poses of all parts in some of the frames that show them all."""
    center = np.stack([k.pose.center for k in kins], 1)
    rotation, cov = np.stack([k.pose.rotation for k in kins], 1), np.stack([k.pose.cov for k in kins], 1)
    shown = np.flatnonzero(
        np.isfinite(center).all((1, 2))
        & np.isfinite(rotation).all((1, 2, 3))
        & np.isfinite(cov).all((1, 2, 3))
    )
    some = shown[np.unique(np.linspace(0, len(shown) - 1, LOOKED).astype(int))] if len(shown) else shown
    return Poses(center[some], rotation[some], cov[some], np.array([p.mass for p in parts]))


def joint_points(joints: tuple[Joint, ...], parts: tuple[Part, ...], poses: Poses) -> tuple[Array, ...]:
    """Place (time, joint, 3) m of every joint, its gap, and the covariance of that (time, joint, 3, 3) m2."""
    time = len(poses.center)
    each = [
        joint_ends(
            j,
            {k: carried(j, parts[k], None, time) for k in j.moving},
            poses.center,
            poses.rotation,
            poses.cov,
        )
        for j in joints
    ]
    ends, cov = (np.stack(a, 1) for a in zip(*each, strict=True))
    return ends.mean(2), ends[:, :, 1] - ends[:, :, 0], cov.sum(2)


def passes_of(
    joints: tuple[Joint, ...], parts: tuple[Part, ...], poses: Poses
) -> tuple[list[tuple[int, int]], list[Array]]:
    """Links of joints and of loads from outside, and what they pass (time, 6, k) about the center of all."""
    point, _, _ = joint_points(joints, parts, poses)
    arm = point - poses.whole[:, None]
    outside = [k for k, part in enumerate(parts) if part.external]
    every = np.broadcast_to(np.eye(6), (len(point), 6, 6))
    passes = [
        transport_matrix(arm[:, k]) @ passed(j, poses.rotation[:, j.moving[0]]) for k, j in enumerate(joints)
    ]
    links = [(j.before, j.behind) for j in joints] + [(GROUND, k) for k in outside]
    return links, passes + [every for _ in outside]


def undetermined_wrenches(
    joints: tuple[Joint, ...], parts: tuple[Part, ...], frame: Poses
) -> tuple[Array, int]:
    """What of one frame is open (joint, 6, k), about the center of all, and how many resultants are told.

    Told is what noise of the poses cannot undo: a loop that it alone keeps from closing is one.
    """
    links, passes = passes_of(joints, parts, frame)
    scale = np.repeat([1.0, 1 / frame.length], 3)[:, None]
    E = transmitted([scale * columns[0] for columns in passes], len(links), 6)
    _, s, Vt = np.linalg.svd(np.kron(incidence(links, len(parts)), np.eye(6)) @ E)
    turn = scale[::-1]  # what poses are off by, arms over the same length
    noise = np.trace(turn * frame.cov[0] * turn.T, axis1=1, axis2=2).max() / 6
    rank = int((s > max(WILD * np.sqrt(noise), SINGLE)).sum())
    open_ = (E @ Vt[rank:].T).reshape(len(links), 6, -1) / scale
    return open_[: len(joints)], rank


def in_part_axes(
    joints: tuple[Joint, ...], parts: tuple[Part, ...], frame: Poses, null_space: Array
) -> list[Array]:
    """Orthonormal columns (6, k) that span what is open of each joint in one frame, about the joint and in
    the axes of the part before it; null_space (joint, 6, k): the same about the center of all.
    """
    point, _, _ = joint_points(joints, parts, frame)
    found = []
    for k, joint in enumerate(joints):
        about = transport_matrix(frame.whole[0] - point[0, k]) @ null_space[k]
        R = frame.rotation[0, joint.moving[0]].T
        found.append(column_space(np.concatenate([R @ about[:3], R @ about[3:]])))
    return found
