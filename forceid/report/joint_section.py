"""What the page says of forces between parts: verdict, table and figure a joint, and what is not told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from forceid.estimation import listed, trading_joints, undetermined_components
from forceid.records import Array, Estimate, Interface
from forceid.report.numbers import digits, mean, plain, plus_minus, positive_or_nan, rms, typeset
from forceid.report.plots.chart import Chart
from forceid.report.plots.charts import joint_chart
from forceid.report.plots.figures import draw_joint, joint_truth
from forceid.report.plots.picture import Picture, pictured

JOINTS_DRAWN = 12  # joints that are drawn


@dataclass(frozen=True)
class JointSection:
    """The table of joints with its heads, facts as name and value, and pictures with their charts by name."""

    heads: tuple[str, ...]
    rows: list[list[str]]
    facts: list[tuple[str, str]]
    pictures: list[Picture]
    charts: dict[str, Chart]


def joint_section(estimate: Estimate, truth: Mapping[str, Array] | None = None) -> JointSection | None:
    """The section of a body in parts; None for one that is whole."""
    found = estimate.interface
    if found is None:
        return None
    errors = [joint_errors(estimate.time, found, k, truth or {}) for k in range(len(found.name))]
    known = any(np.isfinite(e).any() for e in errors)
    told = [k for k in range(len(found.name)) if np.isfinite(found.force[:, k]).any()]
    heads = ("Joint", "Exerted", "Force, rms", "Moment, rms", "Parts apart, rms")
    return JointSection(
        heads=(*heads, "Error over sigma: force, moment") if known else heads,
        rows=[
            joint_row(found, k) + [", ".join(digits(e, 2) for e in error)] * known
            for k, error in enumerate(errors)
        ],
        facts=joint_facts(found),
        pictures=[
            pictured(
                draw_joint(estimate.time, found, k, truth),
                f"Joint {found.name[k]}",
                caption(found, k),
                f"joint-{k}",
            )
            for k in told[:JOINTS_DRAWN]
        ],
        charts={f"joint-{k}": joint_chart(estimate.time, found, k, truth) for k in told[:JOINTS_DRAWN]},
    )


def joint_row(found: Interface, k: int) -> list[str]:
    """A joint in the table: name, pair of parts, sizes with their sigma, and the gap."""
    apart = float(np.linalg.norm(rms(found.gap[:, k])))
    sizes = [
        typeset(plus_minus(rms(values[:, k]), rms(std[:, k]), unit))
        for values, std, unit in (
            (found.force, found.force_std, "N"),
            (found.moment, found.moment_std, "N m"),
        )
    ]
    gap = f"{typeset(plain(1e3 * apart, 2))} mm" if np.isfinite(apart) else "–"
    return [found.name[k], " on ".join(found.parts[k]), *sizes, gap]


def joint_errors(time: Array, found: Interface, k: int, truth: Mapping[str, Array]) -> Array:
    """Rms of error over sigma of force and moment (2,); NaN where no truth is known."""
    true = joint_truth(time, found, k, truth)
    error = np.concatenate([found.force[:, k], found.moment[:, k]], 1) - true
    ratio = error / positive_or_nan(np.concatenate([found.force_std[:, k], found.moment_std[:, k]], 1))
    return np.array([np.sqrt(mean(rms(ratio[:, side]) ** 2)) for side in (slice(0, 3), slice(3, 6))])


def joint_facts(found: Interface) -> list[tuple[str, str]]:
    """Consistency of the balances, and what the motion leaves open, as name and value."""
    rows = [("Balances left to test the joints", str(found.dof) if found.dof else "none")]
    if np.isfinite(found.consistency):
        text = f"{digits(found.consistency)} per degree of freedom; one or less where they agree"
        rows.append(("Misfit of these balances", text))
    for k, name in enumerate(found.name):
        if not found.determined[k]:
            parts = undetermined_components(found.null_space[k])  # none where nothing was solved
            said = f"{listed(parts)}; over the record, world axes, about the mass center of all"
            rows.append((f"Not told: {name}", said if parts else "all of it"))
    for group in trading_joints(found.null_space):
        names = ", ".join(found.name[k] for k in group)
        way = "round them" if len(group) > 1 else "through it that loads from outside balance"
        rows.append((f"Null space: {names}", f"wrenches {way} leave no trace in the motion"))
    return rows


def caption(found: Interface, k: int) -> str:
    """What the figure of joint k shows, in which axes and about which point."""
    first, second = found.parts[k]
    seen = found.point[np.isfinite(found.point[:, k]).all(1), k]
    place = ", ".join(typeset(plain(float(x), 3)) for x in seen[0])
    return (
        f"What {first} does to {second} through {found.name[k]}, in world axes. The moment is about the "
        f"joint, which moves with the parts and is first seen at ({place}) m. The band holds 95 %, 1.96 "
        "sigma on either side, as the estimate claims it."
    )
