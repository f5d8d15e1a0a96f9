"""Bodies in parts on the chart: error against time of ours and of solvers on the assembled body.

The truth is manufactured. Time is that from the matrices to the solution, all factors counted; what a second
load would cost on what was built for the first is measured beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from evidence.chart.charted import Charted
from evidence.subject import Answer
from evidence.subjects.affine.problem import relative_error
from evidence.subjects.parts.cases import GRIDS, PartsCase, manufactured
from evidence.subjects.parts.solvers import DEFAULT, entrants

JUDGED_BY = ("displacement", "interface force")
RESOLVES = 1e-10  # relative: rounding of the loads alone moves bodies with a jump of 1e4 that much
ENOUGH = 1e-6  # relative error at which the fastest are compared
READING = (
    "The truth is manufactured: a smooth displacement is chosen, its load is K u, and the forces on the "
    "interface are what loads, in equal shares, and stiffness leave of each other in a part. Errors are "
    "lengths over that of the truth: of displacements of all parts, gaps included, and of interface forces. "
    "Peers on the assembled matrix get those as f - K u of each part. Errors below "
    f"{RESOLVES:.0e} are rounding and count as equal. Time is process CPU time from the matrices "
    "to the solution, {}. *Second load* is what of it another load would cost again. The rest is setup. "
    "Iterations stop at their tolerance of the residual as each solver defines it. Those of a "
    "correction are not counted. Forceid tells its own error, and that is timed with it. Sparse factors are "
    "not in the memory."
)


def errors(case: PartsCase, answer: Answer) -> dict[str, float]:
    """Lengths of the errors of u of all parts, gaps counted, and of lambda, over those of the truth."""
    truth = case.L @ case.u, case.lam
    return {
        what: relative_error(got, true)
        for what, got, true in zip(JUDGED_BY, answer.found, truth, strict=True)
    }


def facts(runs: Sequence[PartsCase], bounds: Sequence[Any]) -> dict[str, Any]:
    """What the body is."""
    case = runs[0]
    return {
        "title": case.title, "parts": len(case.stiffness), "unknowns": len(case.load),
        "multipliers": len(case.lam), "quantities": list(JUDGED_BY), "units": None, "resolved": RESOLVES,
    }  # fmt: skip


def described(case: Mapping[str, Any]) -> str:
    """What the body is, in words."""
    return f"{case['parts']} parts, {case['unknowns']} unknowns, {case['multipliers']} multipliers."


def heads(case: Mapping[str, Any]) -> list[str]:
    """Columns between name and cost."""
    return ["error of u", "claimed", "error of lambda", "claimed", "iterations", "second load, ms", "setup"]


def cells(case: Mapping[str, Any], row: Mapping[str, Any]) -> list[str]:
    """Errors, each with what is claimed of it, iterations, and what a second load costs."""
    found = []
    for what, said in zip(JUDGED_BY, row["claimed"] or (None, None), strict=True):
        found += [f"{row['error'][what]:.1e}", "-" if said is None else f"{said:.1e}"]
    steps = "-" if row["iterations"] is None else str(row["iterations"])
    return [*found, steps, f"{1e3 * row['again']:.3g}", f"{100 * row['setup_share']:.0f} %"]


PARTS = Charted(
    name="parts",
    title="Bodies in parts",
    reading=READING,
    counted=tuple(f"subjects.parts.{name}" for name in ("cases", "solvers", "chart")),
    folders=("partition", "principal"),
    records=lambda name, seeds: [manufactured(name, GRIDS[name])],
    contestants=lambda case: entrants(),
    score=lambda case, answer: {"error": errors(case, answer), "claimed": answer.claimed},
    facts=facts,
    judged=lambda facts, found: {name: found[0][name] for name in ("error", "claimed")},
    described=described,
    heads=heads,
    cells=cells,
    clock=("ms", 1e3),
    time="CPU time from matrices to solution (s)",
    lines="one solver, tolerance 1e-4, 1e-7, 1e-10 downward",
    default=DEFAULT,
    levels=lambda case: (ENOUGH,),
)
