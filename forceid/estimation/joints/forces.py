"""Joint forces of a body in parts: what must pass through the joints for every part to move as it did.

Each part is estimated as a body of its own, which gives the wrench on it, weight excluded. The joints and the
loads from outside that are allowed for have to make up all of these wrenches: least squares on the graph of
the parts. Where the parts were smoothed they are smoothed again, together. Source: principal equations 2.8,
2.11 A, 4h.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from forceid.config import Settings
from forceid.estimation.joints.checks import empty_interface, judge_joints, of_part
from forceid.estimation.joints.linkage import about_center, at_joints, linkage_of, split
from forceid.estimation.joints.parts import parts_of
from forceid.estimation.joints.together import smooth_linked_parts
from forceid.estimation.methods.problem import Solution
from forceid.estimation.verdict.catalogue import note
from forceid.estimation.verdict.finding import judge, refusing
from forceid.partition import link_resultants
from forceid.records import Estimate, Finding, Interface, Recording
from forceid.significance import WILD
from forceid.timing import stage

SolveRecording = Callable[[Recording, Settings], tuple[Estimate, Solution | None]]


@stage("joints")
def joint_forces(recording: Recording, settings: Settings, solve: SolveRecording) -> Interface:
    """Wrench of every joint in the settings, from each part estimated by `solve` as a body of its own.

    Raises ConfigError for parts and joints that do not fit the recording; where a part is refused all is NaN.
    """
    parts, joints = parts_of(recording, settings)
    own = {"part": (), "joint": (), "load": (), "moment_about": "mass_center"}
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
    found = link_resultants(linkage.links, -wrench, cov, linkage.passes)
    g, C = found.wrench, found.joint_cov
    assert C is not None
    smoothed = None
    misfit = found.chi_square[np.isfinite(found.chi_square)]
    if not found.dof or not misfit.size or misfit.mean() < WILD**2 * found.dof:  # else they contradict
        smoothed = smooth_linked_parts(
            linkage, parts, joints, estimates, [solution for _, solution in solved], settings
        )
    if smoothed is not None:
        to_joints, (together, together_cov, moving) = -split(linkage), smoothed
        g = np.einsum("tij,tj->ti", to_joints, together.reshape(len(g), -1)).reshape(g.shape)
        C = to_joints @ together_cov @ to_joints.swapaxes(1, 2)
        findings += moving
    count = len(joints)
    null = found.null_space.reshape(len(linkage.links), 6, -1)
    determined = found.determined[:count]
    force, moment, covs = at_joints(linkage, g[:, :count], C)
    for a in (force, moment, covs):
        a[:, ~determined] = np.nan
    lost = ~np.isfinite(covs).all((2, 3))
    force[lost], moment[lost] = np.nan, np.nan  # no number without what it is worth
    result = replace(
        empty_interface(joints, parts, linkage.point, linkage.gap, determined, judge([])),
        force=force, moment=moment, wrench_cov=covs, null_space=null[:count],
        chi_square=found.chi_square, dof=found.dof,
    )  # fmt: skip
    findings += judge_joints(result, linkage.gap_cov, wrench)
    return replace(result, verdict=judge(findings))
