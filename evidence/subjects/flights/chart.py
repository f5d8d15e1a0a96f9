"""Flights on the chart: errors of force and moment by axis, what is claimed of them, and the bound."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evidence.chart.charted import Charted
from evidence.chart.page import number_or_dash
from evidence.subject import Answer, Contestant
from evidence.subjects.flights.cases import LOADS, Case, records
from evidence.subjects.flights.methods import DEFAULT, ours, worth_while
from evidence.subjects.flights.peers.entrants import peers
from evidence.subjects.flights.true_prior import bound_of, problem_of, told_the_prior
from forceid.records import Array
from forceid.significance import QUANTILE

UNITS = {"force": "N", "moment": "N m"}
ALIKE = 1.02  # errors within this ratio are no difference
READING = (
    "Errors are rms per axis over the central three quarters of the record and all seeds. Time "
    "is process CPU time from raw markers to the wrench, a sample, {}. *Told* methods chose their parameters "
    "on the truth. Nobody can do that on a record of his own, and they do not count for the front. The bound "
    "is the posterior deviation of the smoother under a Matern prior fitted to the true load, with the noise "
    "as stated. On one smooth record an error may be below it, and where the load holds a line it is too "
    "large. *Covered* is the share of the truth inside the 95 % interval claimed."
)


def scored_by_axis(case: Case, answer: Answer) -> dict[str, list[float]]:
    """An answer against the truth: means over the central three quarters, by axis (6,), NaN where unknown.

    error: squares of the answer's; claimed: its variance; inside: share in the 95 % interval.
    """
    at, truth = case.judged, case.wrench[case.judged]
    error = np.hstack(answer.found)[at] - truth
    if answer.claimed is None:
        claimed = inside = np.full(6, np.nan)
    else:
        var = np.hstack(answer.claimed)[at] ** 2
        known = np.isfinite(error) & np.isfinite(var)
        inside = np.where(known, error**2 <= QUANTILE**2 * var, np.nan).mean(0)
        claimed = var.mean(0)
    return {"error": (error**2).mean(0).tolist(), "claimed": claimed.tolist(), "inside": inside.tolist()}


def rms_by_load(squares: Any) -> Array:
    """Rms per axis of force and of moment (2,), of mean squares by axis (..., 6); over all that lead.

    >>> rms_by_load([[1.0, 4.0, 4.0, 0.0, 0.0, float("nan")]]).round(3).tolist()
    [1.732, nan]
    """
    return np.sqrt(mean_by_load(squares))


def mean_by_load(by_axis: Any) -> Array:
    """Mean of force and of moment (2,), of numbers by axis (..., 6)."""
    return np.asarray(np.asarray(by_axis, float).reshape(-1, 2, 3).mean((0, 2)))


def by_load(pair: Any) -> dict[str, float]:
    """Force and moment by name."""
    return {load: float(value) for load, value in zip(LOADS, pair, strict=True)}


def contestants(case: Case) -> tuple[list[Contestant], list[str]]:
    """Who takes part, ours first, and the peers that are not installed."""
    theirs, missing = peers()
    return [*ours(), told_the_prior(), *theirs], missing


def bound_by_load(case: Case) -> list[float]:
    """The bound of a case, force and moment."""
    return [float(b) for b in bound_of(case, problem_of(case).smoothed())]


def facts(runs: Sequence[Case], bounds: Sequence[Sequence[float]]) -> dict[str, Any]:
    """What was recorded, and how large loads and bounds are."""
    case, motion = runs[0], runs[0].blind.motion
    x = motion.position
    return {
        "title": case.blind.title or case.name, "measured": case.measured, "samples": len(motion.time),
        "rate_Hz": float(1 / np.median(np.diff(motion.time))), "seeds": len(runs),
        "markers": 0 if x is None else int(np.isfinite(x).all(2).any(0).sum()), "noise_std": motion.noise_std,
        "quantities": list(LOADS), "units": list(UNITS.values()), "resolved": 0.0,
        "load": by_load(rms_by_load([np.mean(case.wrench[case.judged] ** 2, axis=0)])),
        "bound": by_load(np.sqrt(np.mean(np.square(bounds), axis=0))),
    }  # fmt: skip


def judged_seeds(facts: Mapping[str, Any], found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Errors, claims and coverage over all seeds."""
    error, claimed = (rms_by_load([a[name] for a in found]) for name in ("error", "claimed"))
    each = np.array([rms_by_load(a["error"]) for a in found])
    least = np.array(list(facts["bound"].values()))
    return {
        "error": by_load(error), "claimed": by_load(claimed), "over_bound": by_load(error / least),
        "over_claimed": by_load(error / np.where(claimed > 0, claimed, np.nan)),
        "spread": {load: [float(each[:, i].min()), float(each[:, i].max())] for i, load in enumerate(LOADS)},
        "error_by_axis": np.sqrt(np.mean([a["error"] for a in found], axis=0)).tolist(),
        "coverage": by_load(mean_by_load([a["inside"] for a in found])),
    }  # fmt: skip


def described(case: Mapping[str, Any]) -> str:
    """What was recorded, in words."""
    known = [
        f"{load} {case['load'][load]:.3g} {unit} rms, bound {case['bound'][load]:.3g} {unit}"
        for load, unit in UNITS.items()
        if np.isfinite(case["load"][load])
    ]
    noise = ", ".join(f"{name} {value:g}" for name, value in case["noise_std"].items()) or "not stated"
    kind = "measured, truth from an instrument" if case["measured"] else f"synthetic, {case['seeds']} seeds"
    said = (
        f"{case['samples']} samples at {case['rate_Hz']:.4g} Hz, {case['markers']} markers, noise {noise}; "
        f"{kind}. {'; '.join(known)}."
    )
    if case["measured"]:
        said += " Errors of measured tracks are not white: the bound is what white noise of that size allows."
    return said


def heads(case: Mapping[str, Any]) -> list[str]:
    """Columns between name and cost."""
    of_loads = ((f"{load} error ({unit})", "over bound", "covered") for load, unit in UNITS.items())
    return [*(head for heads in of_loads for head in heads), "chose"]


def cells(case: Mapping[str, Any], row: Mapping[str, Any]) -> list[str]:
    """Errors over bounds and coverage, and what was chosen."""
    found = []
    for load in UNITS:
        covered = row["coverage"][load]
        found += [number_or_dash(row["error"][load]), number_or_dash(row["over_bound"][load])]
        found.append(f"{100 * covered:.0f} %" if np.isfinite(covered) else "-")
    return [*found, row["chosen"] or "-"]


def each_seed(source: Path, seeds: int) -> list[Case]:
    """The case of a recipe or motion file, once for every seed of its noise."""
    return list(records(source, seeds))


FLIGHTS = Charted(
    name="flights",
    title="Flights",
    reading=READING,
    counted=(
        *(f"subjects.flights.{name}" for name in ("cases", "methods", "true_prior", "chart")),
        *(f"subjects.flights.peers.{name}" for name in ("expert", "differentiators", "kalman", "entrants")),
    ),
    folders=("compiled", "kalman", "flight", "motion", "principal", "estimation", "scenes"),
    records=each_seed,
    contestants=contestants,
    score=scored_by_axis,
    facts=facts,
    judged=judged_seeds,
    described=described,
    heads=heads,
    cells=cells,
    clock=("us", 1e6),
    time="CPU time a sample (s)",
    default=DEFAULT,
    margin=ALIKE,
    bound=bound_by_load,
    worth=worth_while,
)
