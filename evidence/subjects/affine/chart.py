"""Affine bodies on the chart: error against time of ours, and of what one writes with numpy and scipy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from evidence.chart.charted import Charted
from evidence.subject import Answer
from evidence.subjects.affine.cases import AffineCase, case_called
from evidence.subjects.affine.problem import relative_error
from evidence.subjects.affine.ways import ways
from forceid.errors import EstimationError

LEVELS = (1e-3, 1e-6, 1e-9)  # relative errors at which the fastest are compared
OF_FACTORS = (1e-13,)
READING = (
    "Polar factors are known to eighty digits, motions by DOP853 near rounding on forces that are no part of "
    "forceid. Errors are lengths over that of the truth, of all samples together. Time is process CPU time "
    "of the whole case, {}. Peers that follow bodies one by one do a fiftieth of them, and their time is "
    "multiplied. A line is one way from coarse to fine: steps in s of forceid's, relative tolerances of "
    "scipy's, absolute ones a thousandth of them. Where det F = 1 is imposed, verlet, suzuki_4 and "
    "kahan_li_8 are compositions of RATTLE, and peers integrate the "
    "index-reduced equations."
)


def errors(case: AffineCase, answer: Answer) -> dict[str, float]:
    """Relative errors of both quantities, over the frames or bodies of which the truth is known."""
    pairs = list(zip(answer.found, case.truth, strict=True))
    if any(len(got) < len(true) or not np.isfinite(got).all() for got, true in pairs):
        raise EstimationError("does not get to the end")
    return {
        what: relative_error(got[: len(true)], true)
        for what, (got, true) in zip(case.quantities, pairs, strict=True)
    }


def facts(runs: Sequence[AffineCase], bounds: Sequence[Any]) -> dict[str, Any]:
    """What the case is."""
    case = runs[0]
    return {
        "title": case.title, "kind": case.kind, "quantities": list(case.quantities), "units": None,
        "resolved": case.resolved,
    }  # fmt: skip


AFFINE = Charted(
    name="affine",
    title="Affine bodies",
    reading=READING,
    counted=tuple(
        f"subjects.affine.{name}"
        for name in ("bodies", "cases", "contestants", "movers", "problem", "ways", "chart", "exact_polar")
    ),
    folders=("pseudorigid", "motion"),
    records=lambda name, seeds: [case_called(name)],
    contestants=lambda case: (ways(case.kind), []),
    score=lambda case, answer: {"error": errors(case, answer)},
    facts=facts,
    judged=lambda facts, found: {"error": found[0]["error"]},
    described=lambda case: "",
    heads=lambda case: [f"error of {what}" for what in case["quantities"]],
    cells=lambda case, row: [f"{row['error'][what]:.1e}" for what in case["quantities"]],
    clock=("ms", 1e3),
    time="CPU time of the whole case (s)",
    lines="one way, steps or tolerances downward",
    levels=lambda case: OF_FACTORS if case["kind"] == "factors" else LEVELS,
)
