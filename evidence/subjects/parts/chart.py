"""Bodies in parts on the chart: error against time of ours and of solvers on the assembled body.

The truth is manufactured. Time is that from the matrices to the solution, all factors counted; what a second
load would cost on what was built for the first is measured beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from evidence.chart.front import Point
from evidence.chart.scoring import mean_seconds, peak_of, seconds_of
from evidence.journal import Journal, key
from evidence.subjects.parts.cases import GRIDS, Grid, PartsCase, manufactured
from evidence.subjects.parts.solvers import DEFAULT, Solved, Solver
from forceid.errors import ForceIdError

COUNTED = (*(f"subjects.parts.{name}" for name in ("cases", "solvers", "chart")), "chart.scoring")
FOLDERS = ("partition", "principal")
QUANTITIES = ("displacement", "interface force")
RESOLVED = 1e-10  # relative: rounding of the loads alone moves bodies with a jump of 1e4 that much
SMALL = Grid((2, 1), 2)
REPEATED = 0.03  # s: a run that is shorter is timed once more, in repetitions


def charted(
    name: str,
    everyone: Sequence[Solver],
    rounds: int,
    budget: float,
    memory: bool,
    journal: Journal,
    stamp: str,
    said: Callable[[str, float], None],
) -> dict[str, Any]:
    """One body as plain data, with a row for every solver. rounds, budget (s): of timing in turns."""
    case = manufactured(name, GRIDS[name])
    steps, done = len(everyone) * (1 + rounds), 0
    answers = {}
    for c in everyone:
        said(f"{name}: {c.name}", done / steps)
        done += 1
        work = partial(answered, c, case, memory)
        answers[c.name] = journal.once(key(stamp, "parts", case.key, c.name, c.about, memory), work)
    good = [c for c in everyone if "failed" not in answers[c.name]]
    seconds: dict[str, list[float]] = {c.name: [] for c in good}
    for k in range(rounds):
        for c in good[:: 1 if k % 2 == 0 else -1]:
            first = answers[c.name]["seconds"]
            if k and first * (k + 1) > budget:
                continue
            said(f"{name}: round {k + 1}, {c.name}", min(done / steps, 1.0))
            done += 1
            turn = key(stamp, "parts round", k, case.key, c.name, c.about)
            took = journal.once(turn, partial(timed, c, case, first))
            seconds[c.name].append(took)
    rows = [row(c, answers[c.name], seconds.get(c.name, []), seconds.get(DEFAULT, [])) for c in everyone]
    default = answers.get(DEFAULT, {}).get("seconds", np.nan)
    for r in rows:
        if "failed" not in r and r["times_default"] is None:
            r["times_default"] = r["seconds"] / default
    return {
        "name": name, "title": case.title, "parts": len(case.stiffness), "unknowns": len(case.load),
        "multipliers": len(case.lam), "rows": rows,
    }  # fmt: skip


def answered(c: Solver, case: PartsCase, memory: bool) -> dict[str, Any]:
    """What a solver answers to a case, scored; or why it does not."""
    assert case.assembled.shape[0] == len(case.load)  # matrices are given, and not timed
    try:
        c.build(small())()  # libraries are imported before anything is timed
        (found, solve), spent = seconds_of(lambda: first_and_again(c, case))
        if spent < REPEATED:
            spent = timed(c, case, spent)
        again = mean_seconds(solve, spent)
        peak = peak_of(lambda: c.build(case)()) if memory else None
    except (ForceIdError, ValueError, np.linalg.LinAlgError) as e:
        return {"failed": " ".join(str(e).split())[:300]}
    return {
        "error": errors(case, found), "claimed": found.claimed, "iterations": found.iterations,
        "verdict": found.verdict, "reasons": list(found.reasons),
        "seconds": spent, "again": min(again, spent), "peak_MB": peak,
    }  # fmt: skip


@cache
def small() -> PartsCase:
    """A body to warm up with."""
    return manufactured("small", SMALL)


def timed(c: Solver, case: PartsCase, first: float) -> float:
    """CPU seconds of a solver in one round, of which it took `first` before."""
    return mean_seconds(lambda: c.build(case)(), first)


def first_and_again(c: Solver, case: PartsCase) -> tuple[Solved, Callable[[], Solved]]:
    """The solution, and the job that finds it once more on what was built."""
    solve = c.build(case)
    return solve(), solve


def errors(case: PartsCase, found: Solved) -> dict[str, float]:
    """Lengths of the errors of u of all parts, gaps counted, and of lambda, over those of the truth."""
    pairs = (found.u, case.L @ case.u), (found.lam, case.lam)
    return {
        what: float(np.linalg.norm(got - true) / np.linalg.norm(true))
        for what, (got, true) in zip(QUANTITIES, pairs, strict=True)
    }


def row(c: Solver, found: dict[str, Any], own: list[float], default: list[float]) -> dict[str, Any]:
    """A solver as plain data; times_default: None where it had no turn beside the default."""
    named = {"name": c.name, "line": c.line, "kind": c.kind, "about": c.about}
    if "failed" in found:
        return named | found
    paired = [a / b for a, b in zip(own, default, strict=False)]
    spent = own or [found["seconds"]]
    second = found["again"] / found["seconds"]  # a share, as the two were measured in one run
    return named | {
        **{what: found[what] for what in ("error", "claimed", "iterations", "verdict", "reasons", "peak_MB")},
        "rounds": len(own),
        "seconds": float(np.median(spent)), "seconds_range": [min(spent), max(spent)],
        "again": second * float(np.median(spent)), "setup_share": 1 - second,
        "times_default": float(np.median(paired)) if paired else None,
    }  # fmt: skip


def points_of(case: Mapping[str, Any], quantity: str) -> list[Point]:
    """Who has an error in a quantity, as points, fastest first; errors below rounding are one."""
    found = [
        Point(r["name"], r["seconds"], max(r["error"][quantity], RESOLVED), r["kind"] != "peer", False)
        for r in case["rows"]
        if "failed" not in r and np.isfinite(r["error"][quantity])
    ]
    return sorted(found, key=lambda p: p.seconds)
