"""Joint forces of a body in parts: what must pass through the joints for every part to move as it did.

Each part is estimated as a body of its own, which gives the wrench on it, weight excluded. The joints and the
loads from outside that are allowed for have to make up all of these wrenches: least squares on the graph of
the parts. Where the parts were smoothed they are smoothed again, together. Source: principal equations 2.8,
2.11 A, 4h.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.estimation.joints.holding import chance_limit
from forceid.estimation.joints.link_loads import unseen_ringing
from forceid.estimation.joints.linkage import about_center, at_joints, linkage_of, split
from forceid.estimation.joints.parts import Joint, Part, parts_of
from forceid.estimation.joints.together import smooth_linked_parts
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import judge, refusing
from forceid.partition import link_resultants
from forceid.principal import transport, transport_cov
from forceid.records import Array, Estimate, Finding, Flags, Interface, Level, Recording, Verdict
from forceid.significance import SIGMAS, WILD
from forceid.timing import stage

SolveRecording = Callable[[Recording, Settings], tuple[Estimate, Solution | None]]
# wrenches (time, part, 6) about the centers of parts that are told, and covariances (time, part, 6, 6)
Told = Callable[[tuple[Part, ...], list[Estimate]], tuple[Array, Array] | None]


@stage("joints")
def joint_forces(
    recording: Recording, settings: Settings, solve: SolveRecording, told: Told | None = None
) -> Interface:
    """Wrench of every joint in the settings, from each part estimated by `solve` as a body of its own.

    told: loads from outside that are known, or follow from a rule. Parts with such are not smoothed together,
    as a load that begins with a step of a foot has no place among those of joints.
    Raises ConfigError for parts and joints that do not fit the recording; where a part is refused all is NaN.
    """
    parts, joints = parts_of(recording, settings)
    own = {"part": (), "joint": (), "load": (), "known_load": (), "foot": (), "moment_about": "mass_center"}
    if settings.load_axes == "auto":  # what a joint passes stands in the axes of either part, or of none
        own["load_axes"] = "world"
    alone = settings.model_copy(update=own)
    rigid = alone.model_copy(update={"model": "rigid"})
    solved = [solve(part.recording, rigid if part.rigid else alone) for part in parts]
    findings = [
        of_part(finding, part.name, estimate.verdict.level)
        for part, (estimate, _) in zip(parts, solved, strict=True)
        for finding in estimate.verdict.findings
    ]

    def refused(findings: list[Finding]) -> Interface:
        none = np.full((len(recording.motion.time), len(joints), 3), np.nan)
        return empty_interface(joints, parts, none, none, np.zeros(len(joints), bool), judge(findings))

    if refusing(findings):
        return refused(findings)
    estimates = [estimate for estimate, _ in solved]
    if blind := [p.name for p, e in zip(parts, estimates, strict=True) if not np.isfinite(e.moment).any()]:
        return refused([*findings, note("part-without-moment", part=blind[0])])
    linkage = linkage_of(parts, joints, estimates, [solution for _, solution in solved])
    wrench, cov = about_center(linkage, estimates)
    outside = None if told is None else told(parts, estimates)
    if outside is not None:
        wrench = wrench - transport(outside[0], linkage.arms)
        cov = cov + transport_cov(outside[1], linkage.arms)
    found = link_resultants(linkage.links, -wrench, cov, linkage.passes)
    g, C = found.wrench, found.joint_cov
    assert C is not None
    together = None
    solutions = [solution for _, solution in solved]
    misfit = found.chi_square[np.isfinite(found.chi_square)]
    contradict = found.dof and misfit.size and misfit.mean() >= WILD**2 * found.dof
    if outside is None and not contradict:
        together, said = smooth_linked_parts(linkage, parts, joints, estimates, solutions, settings)
        findings += said
    if together is not None:
        to_joints = -split(linkage)
        g = np.einsum("tij,tj->ti", to_joints, together.wrench.reshape(len(g), -1)).reshape(g.shape)
        C = to_joints @ together.cov @ to_joints.mT
    if not all(part.rigid for part in parts):
        loads = None if together is None else together.loads
        looks = [{} if solution is None else solution.looks for solution in solutions]
        C = C + unseen_ringing(linkage, loads, looks)
    count = len(joints)
    null = found.null_space.reshape(len(linkage.links), 6, -1)
    determined = found.determined[:count]
    force, moment, covs = at_joints(linkage, g[:, :count], C)
    for a in (force, moment, covs):
        a[:, ~determined] = np.nan
    # no number without what it is worth, which rounding may swamp
    lost = ~np.isfinite(covs).all((2, 3)) | (np.diagonal(covs, axis1=2, axis2=3) < 0).any(2)
    force[lost], moment[lost], covs[lost] = np.nan, np.nan, np.nan
    result = replace(
        empty_interface(joints, parts, linkage.point, linkage.gap, determined, judge([])),
        force=force, moment=moment, wrench_cov=covs, null_space=null[:count],
        chi_square=found.chi_square, dof=found.dof,
    )  # fmt: skip
    findings += judge_joints(result, linkage.gap_cov, wrench)
    return replace(result, verdict=judge(findings))


def judge_joints(found: Interface, gap_cov: Array, wrench: Array) -> list[Finding]:
    """Joints that the motion does not tell, balances that do not close, and parts apart at their joint.

    gap_cov (time, joint, 3, 3) m2 of the gaps; wrench (time, part, 6): of the parts, from which the joints'
    were found. Two parts smooth a load between them alike, so that balances close better than claimed.
    """
    findings = []
    if not found.determined.all():
        names = ", ".join(n for n, known in zip(found.name, found.determined, strict=True) if not known)
        findings.append(
            note("joint-undetermined", None if found.determined.any() else "refused", names=names)
        )
    seen = np.isfinite(found.chi_square)
    if found.dof and seen.any():
        limit = chance_limit(wrench[seen].reshape(seen.sum(), -1), found.dof)
        if found.consistency > limit:
            level: Level = "refused" if found.consistency > WILD**2 else "degraded"
            findings.append(note("balances-open", level, left=found.consistency, limit=limit))
    apart = np.sqrt((found.gap**2).sum(2).mean(0))
    noise = np.sqrt(np.einsum("tjaa->tj", gap_cov).mean(0))
    for name, off, size in zip(found.name, apart, noise, strict=True):
        if off > SIGMAS * size:
            findings.append(note("joint-apart", joint=name, off_mm=1e3 * off, noise_mm=1e3 * size))
    return findings


def of_part(finding: Finding, part: str, verdict: Level) -> Finding:
    """A finding on a part, by its name, as one on the joints: refused where the verdict on the part is."""
    return replace(
        finding,
        level="refused" if verdict == "refused" else "degraded",
        values={**finding.values, "part": part},
        text=f"part {part}: {finding.text}",
    )


def empty_interface(
    joints: Sequence[Joint], parts: Sequence[Part], point: Array, gap: Array, determined: Flags, said: Verdict
) -> Interface:
    """Joints at point (time, joint, 3), apart by a gap, of which no force is known."""
    none = np.full(point.shape, np.nan)
    return Interface(
        name=tuple(j.name for j in joints),
        parts=tuple(j.names(parts) for j in joints),
        force=none, moment=none, wrench_cov=np.full((*none.shape[:2], 6, 6), np.nan), point=point,
        determined=determined, null_space=np.zeros((len(joints), 6, 0)), gap=gap,
        chi_square=np.full(len(point), np.nan), dof=0, verdict=said,
    )  # fmt: skip
