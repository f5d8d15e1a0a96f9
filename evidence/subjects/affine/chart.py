"""Affine bodies on the chart: error against time of ours, and of what one writes with numpy and scipy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from evidence.chart.front import Point
from evidence.chart.scoring import mean_seconds, peak_of, seconds_of
from evidence.journal import Journal, key
from evidence.subjects.affine.cases import AffineCase, made
from evidence.subjects.affine.problem import relative
from evidence.subjects.affine.ways import Way, ways
from forceid.errors import ForceIdError

COUNTED = (
    *(f"subjects.affine.{name}" for name in ("bodies", "cases", "movers", "problem", "ways", "chart")),
    "subjects.affine.exact_polar",
    "chart.scoring",
)
FOLDERS = ("pseudorigid", "motion")
REPEATED = 0.03  # s: a run that is shorter is timed once more, in repetitions


def charted(
    name: str,
    rounds: int,
    budget: float,
    memory: bool,
    journal: Journal,
    stamp: str,
    said: Callable[[str, float], None],
) -> dict[str, Any]:
    """One case as plain data, with a row for every way. rounds, budget (s): of timing in turns."""
    case = made(name)
    everyone = ways(case.kind)
    steps, done = len(everyone) * (1 + rounds), 0
    answers = {}
    for way in everyone:
        said(f"{name}: {way.name}", done / steps)
        done += 1
        place = key(stamp, "affine", case.key, way.name, way.about, memory)
        answers[way.name] = journal.once(place, partial(answered, way, case, memory))
    good = [way for way in everyone if "failed" not in answers[way.name]]
    seconds: dict[str, list[float]] = {way.name: [] for way in good}
    for k in range(rounds):
        for way in good[:: 1 if k % 2 == 0 else -1]:
            first = answers[way.name]["seconds"]
            if k and first * (k + 1) > budget:
                continue
            said(f"{name}: round {k + 1}, {way.name}", min(done / steps, 1.0))
            done += 1
            turn = key(stamp, "affine round", k, case.key, way.name, way.about)
            seconds[way.name].append(journal.once(turn, partial(timed, way, case, first)))
    rows = [row(way, answers[way.name], seconds.get(way.name, [])) for way in everyone]
    return {
        "name": name, "title": case.title, "kind": case.kind, "quantities": list(case.quantities),
        "resolved": case.resolved, "time": "CPU time of the whole case (s)",
        "lines": "one way, steps or tolerances downward", "rows": rows,
    }  # fmt: skip


def answered(way: Way, case: AffineCase, memory: bool) -> dict[str, Any]:
    """What a way answers to a case, scored; or why it does not."""
    try:
        job = way.job(case)
        found, spent = seconds_of(job)
        found, spent = seconds_of(job) if spent < 1.0 else (found, spent)  # libraries are imported by now
        if spent < REPEATED:
            spent = mean_seconds(job, spent)
        peak = peak_of(job) if memory and spent < 1.0 else None
    except (ForceIdError, ValueError, np.linalg.LinAlgError) as e:
        return {"failed": " ".join(str(e).split())[:300]}
    if any(
        len(got) < len(true) or not np.isfinite(got).all()
        for got, true in zip(found, case.truth, strict=True)
    ):
        return {"failed": "does not get to the end"}
    return {"error": errors(case, found), "seconds": spent, "peak_MB": peak}


def errors(case: AffineCase, found: Sequence[Any]) -> dict[str, float]:
    """Relative errors of both quantities, over the frames or bodies of which the truth is known."""
    return {
        what: relative(got[: len(true)], true)
        for what, got, true in zip(case.quantities, found, case.truth, strict=True)
    }


def timed(way: Way, case: AffineCase, first: float) -> float:
    """CPU seconds of a way in one round, of which it took `first` before."""
    return mean_seconds(way.job(case), first)


def row(way: Way, found: dict[str, Any], own: list[float]) -> dict[str, Any]:
    """A way as plain data; seconds of the whole case, even of who did a part of it."""
    named = {"name": way.name, "line": way.line, "kind": way.kind, "about": way.about}
    if "failed" in found:
        return named | found
    spent = [way.whole * s for s in own or [found["seconds"]]]
    return named | {
        "error": found["error"], "peak_MB": found["peak_MB"], "rounds": len(own), "part": way.whole != 1,
        "seconds": float(np.median(spent)), "seconds_range": [min(spent), max(spent)],
    }  # fmt: skip


def points_of(case: Mapping[str, Any], quantity: str) -> list[Point]:
    """Who has an error in a quantity, as points, fastest first; errors below those of the truth are one."""
    found = [
        Point(
            r["name"], r["seconds"], max(r["error"][quantity], case["resolved"]), r["kind"] != "peer", False
        )
        for r in case["rows"]
        if "failed" not in r
    ]
    return sorted(found, key=lambda p: p.seconds)
