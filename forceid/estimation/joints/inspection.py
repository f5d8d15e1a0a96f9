"""Which forces between parts the motion can tell, before any is estimated.

From the poses of single frames: what the joints can pass there, and what of it the balances of the parts
fix. Source: principal equations 2.8, 2.11 A, 4h.
"""

from __future__ import annotations

import numpy as np

from forceid.config import Settings
from forceid.estimation.body.kinematics import Kinematics, kinematics
from forceid.estimation.joints.forces import empty_interface, judge_joints, of_part
from forceid.estimation.joints.linkage import Linkage, balances, linkage_at, passed
from forceid.estimation.joints.parts import Joint, Part, parts_of
from forceid.estimation.joints.prospects import (
    JointProspect,
    JointProspects,
    PartProspect,
    column_space,
    trading_joints,
    undetermined_components,
)
from forceid.estimation.loads.rough_look import bandwidths
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import judge_recording, refusing
from forceid.estimation.verdict.leakage import LOOKED
from forceid.partition import link_resultants
from forceid.partition.coupling.resultants import loop_count
from forceid.principal import transport_matrix
from forceid.records import Array, Recording, Verdict
from forceid.rounding import SINGLE
from forceid.significance import WILD


def inspect_linkage(recording: Recording, settings: Settings) -> JointProspects:
    """Parts, joints and what the motion tells of them; ConfigError for what does not fit the recording."""
    parts, joints = parts_of(recording, settings)
    alone = settings.model_copy(update={"part": (), "joint": (), "load": (), "moment_about": "mass_center"})
    kins = [kinematics(p.recording.body, p.recording.motion, alone) for p in parts]
    judged = [judge_recording(kin) for kin in kins]
    findings = [
        of_part(f, part.name, f.level) for part, found in zip(parts, judged, strict=True) for f in found
    ]
    poses = poses_of(kins)
    frames = len(poses[0])
    passes = [passed(joint, np.eye(3)[None]).shape[2] for joint in joints]
    null, told = np.zeros((len(joints), 6, 0)), 0
    own = [np.eye(6)[:, :0]] * len(joints)
    if frames:
        linkage = linkage_at(parts, joints, poses, [None] * len(parts))
        center, rotation, cov = (a[frames // 2 : frames // 2 + 1] for a in poses)
        frame = linkage_at(parts, joints, (center, rotation, cov), [None] * len(parts))
        null, told = undetermined_wrenches(frame, cov[0], len(joints))
        own = in_part_axes(joints, frame, rotation[0], null)
        none = np.zeros((frames, len(parts), 6))
        found = link_resultants(linkage.links, none, None, linkage.passes)  # poses are taken at their word
        determined = found.determined[: len(joints)]
        empty = empty_interface(joints, parts, linkage.point, linkage.gap, determined, Verdict())
        findings += judge_joints(empty, linkage.gap_cov, none)
        # joints that the estimate tells, with errors without bound, since noise alone opens a loop
        blocks = zip(joints, determined, own, strict=True)
        if hidden := [joint.name for joint, known, block in blocks if known and block.size]:
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
                passes[k], passes[k] - own[k].shape[1] if frames else 0,
                undetermined_components(own[k]),
            )
            for k, (joint, setting) in enumerate(zip(joints, settings.joint, strict=True))
        ),
        resultants=sum(passes) + 6 * sum(part.external for part in parts),
        told=told,
        spare=6 * len(parts) - told if frames else 0,
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


def poses_of(kins: list[Kinematics]) -> tuple[Array, Array, Array]:
    """Centers (time, part, 3) m, rotations and covariances of all parts in some frames that show them all."""
    poses = [k.pose for k in kins]
    center, rotation, cov = (
        np.stack(a, 1) for a in zip(*((p.center, p.rotation, p.cov) for p in poses), strict=True)
    )
    shown = np.flatnonzero(
        np.isfinite(center).all((1, 2))
        & np.isfinite(rotation).all((1, 2, 3))
        & np.isfinite(cov).all((1, 2, 3))
    )
    some = shown[np.unique(np.linspace(0, len(shown) - 1, LOOKED).astype(int))] if len(shown) else shown
    return center[some], rotation[some], cov[some]


def undetermined_wrenches(frame: Linkage, cov: Array, count: int) -> tuple[Array, int]:
    """What of `count` joints is open in one frame (joint, 6, k), about the center of all; resultants told.

    Told is what noise of the poses, cov (part, 6, 6), cannot undo: a loop that it alone keeps from closing is
    one.
    """
    A, E, length = balances(frame)
    _, s, Vt = np.linalg.svd(A[0])
    turn = np.repeat([1 / length, 1.0], 3)[:, None]  # what poses are off by, arms over the same length
    noise = np.trace(turn * cov * turn.T, axis1=1, axis2=2).max() / 6
    rank = int((s > max(WILD * np.sqrt(noise), SINGLE)).sum())
    return (E[0] @ Vt[rank:].T).reshape(len(frame.links), 6, -1)[:count], rank


def in_part_axes(
    joints: tuple[Joint, ...], frame: Linkage, rotation: Array, null_space: Array
) -> list[Array]:
    """Orthonormal columns (6, k) that span what is open of each joint in one frame, about the joint and in
    the axes of the part before it; null_space (joint, 6, k): the same about the center of all.
    """
    found = []
    for k, joint in enumerate(joints):
        about = transport_matrix(frame.center[0] - frame.point[0, k]) @ null_space[k]
        R = rotation[joint.moving[0]].T
        found.append(column_space(np.concatenate([R @ about[:3], R @ about[3:]])))
    return found
