"""The chart: every method of ours and every peer on every case, error against time, and what follows from it.

Everything finished is a line of chart.jsonl; an interrupted chart goes on where it stopped.
"""

from __future__ import annotations

import gc
import platform
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed
from pathlib import Path
from typing import Any

import numpy as np

import forceid
from evidence.chart.cost import costs
from evidence.chart.scoring import mean_seconds, peak_of, rms, score, seconds_of, share
from evidence.chart.simplifications import simplifications
from evidence.journal import Journal, key, version
from evidence.subjects.affine import chart as chart_affine
from evidence.subjects.flights.cases import LOADS, Case, records
from evidence.subjects.flights.contestant import Answer, Contestant
from evidence.subjects.flights.methods import DEFAULT, ours, worth_while
from evidence.subjects.flights.peers.entrants import peers
from evidence.subjects.flights.true_prior import bound_of, problem_of, told_the_prior
from evidence.subjects.parts import chart as chart_partition
from evidence.subjects.parts.solvers import solvers
from forceid.errors import ForceIdError
from forceid.kalman.engines import engine

COUNTED = (
    *(f"subjects.flights.{name}" for name in ("cases", "contestant", "methods", "true_prior")),
    *(f"subjects.flights.peers.{name}" for name in ("expert", "differentiators", "kalman", "entrants")),
    "chart.scoring",
)  # fmt: skip
COLD = 2.0  # s: a first run that is shorter may be mostly imports, and is run again
PACKAGES = ("numpy", "scipy", "filterpy", "statsmodels", "pynumdiff", "pyamg")


@dataclass(frozen=True)
class Extent:
    """How much is run: seeds of a scene; rounds of timing, s of a contestant in them; memory, slow ones."""

    name: str
    seeds: int
    rounds: int
    budget: float
    full: bool


SHORT = Extent("short", seeds=1, rounds=0, budget=0.0, full=False)
FULL = Extent("full", seeds=3, rounds=3, budget=30.0, full=True)


def contestants(extent: Extent) -> tuple[list[Contestant], list[str]]:
    """Who takes part, ours first, and the peers that are not installed."""
    theirs, missing = peers()
    everyone = [*ours(), told_the_prior(), *theirs]
    return [c for c in everyone if extent.full or not c.slow], missing


def run(
    sources: Sequence[Path],
    folder: Path,
    extent: Extent,
    command: str,
    advance: Callable[[str, float], None],
    bodies: Sequence[str] = (),
    affine: Sequence[str] = (),
) -> dict[str, Any]:
    """All numbers of the chart. advance(what, part) is told what is under way, and the part that is done.

    bodies: in parts, by name; affine: cases of affine bodies. What holds of estimators in general is measured
    where there are recordings.
    """
    journal, stamp = Journal.opened(folder / "chart.jsonl"), version(*COUNTED)
    everyone, missing = contestants(extent) if sources else ([], [])
    cases, width = [], 1 / (len(sources) + len(bodies) + len(affine) + bool(sources))
    for i, source in enumerate(sources):
        said = partial(progress, advance, i * width, width)
        cases.append(charted(source, everyone, extent, journal, stamp, said))
    parts, without = in_parts(
        bodies, extent, journal, partial(progress, advance, len(sources) * width, width)
    )
    moving = moving_affinely(
        affine, extent, journal, partial(progress, advance, (len(sources) + len(bodies)) * width, width)
    )
    last = partial(progress, advance, 1 - width, width)
    more = version(*COUNTED, "chart.cost", "chart.simplifications")
    cost, simpler = [], []
    if sources:
        cost = costs(journal, more, extent.full, lambda what, part: last(what, 0.8 * part))
        simpler = simplifications(journal, more, lambda what, part: last(what, 0.8 + 0.2 * part))
    return {
        "forceid": forceid.__version__, "engine": engine().name, "extent": asdict(extent), "command": command,
        "date": datetime.now(UTC).strftime("%Y-%m-%d"), "python": platform.python_version(),
        "processor": processor(), "versions": versions(), "missing": missing + without,
        "cases": cases, "bodies_in_parts": parts, "affine_bodies": moving, "cost": cost,
        "simplifications": simpler,
    }  # fmt: skip


def in_parts(
    bodies: Sequence[str], extent: Extent, journal: Journal, said: Callable[[str, float], None]
) -> tuple[list[dict[str, Any]], list[str]]:
    """Every body in parts, and the peers that are not installed."""
    if not bodies:
        return [], []
    everyone, missing = solvers()
    chosen = [c for c in everyone if extent.full or not c.slow]
    stamp = version(*chart_partition.COUNTED, folders=chart_partition.FOLDERS)
    size = extent.rounds, extent.budget, extent.full
    gc.freeze()  # what is there by now need not be looked through before every timing
    try:
        found = [
            chart_partition.charted(
                name, chosen, *size, journal, stamp, partial(progress, said, float(i), 1.0)
            )
            for i, name in enumerate(bodies)
        ]
    finally:
        gc.unfreeze()
    return found, missing


def moving_affinely(
    names: Sequence[str], extent: Extent, journal: Journal, said: Callable[[str, float], None]
) -> list[dict[str, Any]]:
    """Every case of affine bodies."""
    stamp = version(*chart_affine.COUNTED, folders=chart_affine.FOLDERS)
    size = extent.rounds, extent.budget, extent.full
    return [
        chart_affine.charted(name, *size, journal, stamp, partial(progress, said, float(i), 1.0))
        for i, name in enumerate(names)
    ]


def progress(
    advance: Callable[[str, float], None], start: float, width: float, what: str, part: float
) -> None:
    """Pass on the part that is done of one of several."""
    advance(what, start + width * part)


def charted(
    source: Path,
    everyone: Sequence[Contestant],
    extent: Extent,
    journal: Journal,
    stamp: str,
    said: Callable[[str, float], None],
) -> dict[str, Any]:
    """One case: answers of everyone to every seed, rounds of timing on the first, and a row for each."""
    runs = list(records(source, extent.seeds))
    jobs: dict[tuple[str, str], Callable[[], Answer]] = {}
    answers: dict[str, list[dict[str, Any]]] = {c.name: [] for c in everyone}
    steps, done = len(runs) * len(everyone) * (1 + extent.rounds / len(runs)), 0

    def job_of(c: Contestant, case: Case) -> Callable[[], Answer]:
        """The job of a contestant, prepared once."""
        if (c.name, case.key) not in jobs:
            jobs[c.name, case.key] = c.prepare(case)
        return jobs[c.name, case.key]

    for k, case in enumerate(runs):
        for c in everyone:
            said(f"{case.name}: {c.name}", done / steps)
            done += 1
            if worth_while(c.kind, [a[0]["chosen"] for n, a in answers.items() if n == "modal" and a]):
                answers[c.name].append(
                    journal.once(
                        key(stamp, "answer", case.key, c.name, c.key, extent.full and k == 0),
                        partial(answered, c, case, job_of, extent.full and k == 0),
                    )
                )
    first = runs[0]
    good = [c for c in everyone if answers[c.name] and "failed" not in answers[c.name][0]]
    seconds: dict[str, list[float]] = {c.name: [] for c in good}
    for k in range(extent.rounds):
        for c in good[:: 1 if k % 2 == 0 else -1]:
            spent = answers[c.name][0]["seconds"]
            if k and spent * (k + 1) > extent.budget:
                continue
            said(f"{first.name}: round {k + 1}, {c.name}", min(done / steps, 1.0))
            done += 1
            took = journal.once(
                key(stamp, "round", k, first.key, c.name, c.key),
                partial(timed, c, first, job_of, spent),
            )
            seconds[c.name].append(took)
    bounds = [journal.once(key(stamp, "bound", case.key), partial(bound, case)) for case in runs]
    return summary(runs, everyone, answers, seconds, bounds)


def timed(
    c: Contestant, case: Case, job_of: Callable[[Contestant, Case], Callable[[], Answer]], first: float
) -> float:
    """CPU seconds of a contestant in one round."""
    return mean_seconds(job_of(c, case), first)


def answered(
    c: Contestant, case: Case, job_of: Callable[[Contestant, Case], Callable[[], Answer]], memory: bool
) -> dict[str, Any]:
    """What a contestant answers to a case, scored; or why it does not."""
    try:
        job = job_of(c, case)
        answer, spent = seconds_of(job)
        if spent < COLD:
            spent = mean_seconds(job, spent)
        peak = peak_of(job) if memory else None
    except (ForceIdError, ValueError, np.linalg.LinAlgError) as e:
        return {"failed": " ".join(str(e).split())[:300], "chosen": ""}
    said = {"verdict": answer.verdict, "reasons": list(answer.reasons), "chosen": answer.chosen}
    return {**asdict(score(case, answer)), **said, "seconds": spent, "peak_MB": peak}


def bound(case: Case) -> list[float]:
    """The bound of a case, force and moment."""
    return [float(b) for b in bound_of(case, problem_of(case).smoothed())]


def summary(
    runs: Sequence[Case],
    everyone: Sequence[Contestant],
    answers: dict[str, list[dict[str, Any]]],
    seconds: dict[str, list[float]],
    bounds: Sequence[Sequence[float]],
) -> dict[str, Any]:
    """A case as plain data: what it is, its bound, and a row for every contestant."""
    case, samples = runs[0], len(runs[0].blind.motion.time)
    least = np.sqrt(np.mean(np.square(bounds), axis=0))
    default = seconds.get(DEFAULT) or [answers[DEFAULT][0].get("seconds", np.nan)]
    rows = []
    for c in everyone:
        found = answers[c.name]
        if not found:
            continue
        row: dict[str, Any] = {
            "name": c.name, "kind": c.kind, "told": c.told, "about": c.about, "chosen": found[0]["chosen"]
        }  # fmt: skip
        failed = [a["failed"] for a in found if "failed" in a]
        rows.append(row)
        if failed:
            row["failed"] = failed[0]
            continue
        error, claimed = (rms([a[name] for a in found]) for name in ("error", "claimed"))
        own = seconds.get(c.name) or [found[0]["seconds"]]
        paired = [a / b for a, b in zip(own, default, strict=False)]
        by_axis = np.sqrt(np.mean([a["error"] for a in found], axis=0))
        verdicts = [a["verdict"] for a in found]
        row |= {
            "error": loads(error), "spread": spread([a["error"] for a in found]),
            "error_by_axis": by_axis.tolist(), "over_bound": loads(error / least),
            "claimed": loads(claimed), "over_claimed": loads(error / np.where(claimed > 0, claimed, np.nan)),
            "coverage": loads(share([a["inside"] for a in found])),
            "seconds_a_sample": float(np.median(own)) / samples, "rounds": len(own),
            "seconds_range": [min(own) / samples, max(own) / samples],
            "times_default": float(np.median(paired)), "peak_MB": found[0]["peak_MB"],
            "verdict": {v: verdicts.count(v) for v in dict.fromkeys(verdicts) if v},
            "reasons": sorted({r for a in found for r in a["reasons"]}),
        }  # fmt: skip
    load = rms([answers[DEFAULT][0]["load"]]) if "load" in answers[DEFAULT][0] else np.full(2, np.nan)
    motion = case.blind.motion
    kin = None if motion.position is None else motion.position
    return {
        "name": case.name, "title": case.blind.title, "measured": case.measured, "samples": samples,
        "rate_Hz": float(1 / np.median(np.diff(motion.time))), "seeds": len(runs),
        "markers": 0 if kin is None else int(np.isfinite(kin).all(2).any(0).sum()),
        "noise_std": motion.noise_std, "load": loads(load), "bound": loads(least), "rows": rows,
    }  # fmt: skip


def spread(squares: Sequence[Any]) -> dict[str, list[float]]:
    """Least and largest error over the seeds, of mean squares by axis (seed, 6)."""
    each = np.array([rms(one) for one in squares])
    return {load: [float(each[:, i].min()), float(each[:, i].max())] for i, load in enumerate(LOADS)}


def loads(pair: Any) -> dict[str, float]:
    """Force and moment by name."""
    return {load: float(value) for load, value in zip(LOADS, pair, strict=True)}


def versions() -> dict[str, str]:
    """Versions of what took part."""
    found = {}
    for package in PACKAGES:
        try:
            found[package] = installed(package)
        except PackageNotFoundError:
            continue
    return found


def processor() -> str:
    """The processor, where the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
