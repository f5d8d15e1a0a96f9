"""Whether joint forces can be believed: loops, balances that do not close, parts apart at a joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from forceid.estimation.joints.parts import Joint, Part
from forceid.estimation.verdict.catalogue import note
from forceid.records import Array, Finding, Flags, Interface, Level, Verdict
from forceid.significance import DENIED, SIGMAS, WILD


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


def chance_limit(series: Array, dof: int) -> float:
    """The mean square per degree of freedom, of `dof` a sample, that chance reaches in one honest record in
    ten thousand; series (time, column) turns about its mean as often as its samples are independent.

    >>> slow = np.sin(np.arange(400.0)[:, None] / 40)
    >>> chance_limit(slow, 3) > chance_limit(slow[:, [0]] * (-1) ** np.arange(400)[:, None], 3) > 1
    True
    """
    turns = np.diff(np.sign(series - series.mean(0)), axis=0) != 0
    independent = max(1.0, float(turns.sum(0).mean()))
    return float(chdtri(dof * independent, DENIED) / (dof * independent))


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
