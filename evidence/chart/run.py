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
from evidence.chart.charted import Charted
from evidence.chart.timing import mean_seconds, peak_of, warm_seconds
from evidence.journal import Journal, key, version
from evidence.subject import Contestant, Job
from forceid.errors import ForceIdError
from forceid.kalman.engines import engine

TIMING = ("chart.timing", "subject")
PATIENCE = 20.0  # s: a job that is longer is not traced for its memory, which takes several times as long
PACKAGES = ("numpy", "scipy", "filterpy", "statsmodels", "pynumdiff", "pyamg")

Say = Callable[[str, float], None]


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


def run(
    asked: Sequence[tuple[Charted, Any]], folder: Path, extent: Extent, command: str, advance: Say
) -> dict[str, Any]:
    """All numbers of the chart. advance(what, part) is told what is under way, and the part that is done.

    asked: subjects, each with the source of a case.
    """
    journal = Journal.opened(folder / "chart.jsonl")
    cases: list[dict[str, Any]] = []
    missing: dict[str, None] = {}
    width = 1 / max(len(asked), 1)
    for i, (subject, source) in enumerate(asked):
        said = partial(advance_part, advance, i * width, width)
        found, without = charted(subject, source, extent, journal, said)
        cases.append(found)
        missing |= dict.fromkeys(without)
    return {
        "forceid": forceid.__version__, "engine": engine().name, "extent": asdict(extent), "command": command,
        "date": datetime.now(UTC).strftime("%Y-%m-%d"), "python": platform.python_version(),
        "processor": processor(), "versions": versions(), "missing": list(missing), "cases": cases,
    }  # fmt: skip


def advance_part(advance: Say, start: float, width: float, what: str, part: float) -> None:
    """Pass on the part that is done of one of several."""
    advance(what, start + width * part)


def charted(
    subject: Charted, source: Any, extent: Extent, journal: Journal, said: Say
) -> tuple[dict[str, Any], list[str]]:
    """One case as plain data, and the libraries that are not installed.

    Answers of everyone to every seed, rounds of timing on the first, and a row for each.
    """
    runs = list(subject.records(source, extent.seeds))
    stamp = version(*subject.counted, *TIMING, folders=subject.folders)  # all that results depend on
    everyone, missing = subject.contestants(runs[0])
    everyone = [c for c in everyone if extent.full or not c.slow]
    first, prepared = runs[0], dict[tuple[str, str], Job]()
    answers: dict[str, list[dict[str, Any]]] = {c.name: [] for c in everyone}
    steps, done = len(everyone) * (len(runs) + extent.rounds), 0

    def job_of(c: Contestant, case: Any) -> Job:
        """The job of a contestant, prepared once."""
        if (c.name, case.key) not in prepared:
            prepared[c.name, case.key] = c.prepare(case)
        return prepared[c.name, case.key]

    def once(what: Any, case: Any, c: Contestant, work: Callable[[], Any]) -> Any:
        """What a contestant did before, or does now."""
        nonlocal done
        said(f"{first.name}: {c.name}", min(done / steps, 1.0))
        done += 1
        return journal.once(key(stamp, subject.name, what, case.key, c.name, c.key or c.about), work)

    gc.freeze()  # what is there by now need not be looked through before every timing
    try:
        for k, case in enumerate(runs):
            memory = extent.full and k == 0
            for c in everyone:
                if subject.worth(c, answers):
                    work = partial(scored_answer, subject, c, case, job_of, memory)
                    answers[c.name].append(once(("answer", memory), case, c, work))
        good = [c for c in everyone if answers[c.name] and "failed" not in answers[c.name][0]]
        seconds: dict[str, list[float]] = {c.name: [] for c in good}
        for k in range(extent.rounds):
            for c in good[:: 1 if k % 2 == 0 else -1]:
                spent = answers[c.name][0]["seconds"]
                if k == 0 or spent * (k + 1) <= extent.budget:
                    turn = partial(round_seconds, c, first, job_of, spent)
                    seconds[c.name].append(once(("round", k), first, c, turn))
    finally:
        gc.unfreeze()
    bounds = [journal.once(key(stamp, "bound", case.key), partial(subject.bound, case)) for case in runs]
    facts = {"subject": subject.name, "name": first.name} | subject.facts(runs, bounds)
    once_run = {name: [a["seconds"] for a in found[:1] if "seconds" in a] for name, found in answers.items()}
    default = seconds.get(subject.default) or once_run.get(subject.default, [])
    rows = [
        chart_row(subject, facts, c, answers[c.name], seconds.get(c.name) or once_run[c.name], default)
        for c in everyone
        if answers[c.name]
    ]
    return facts | {"rows": rows}, missing


def round_seconds(c: Contestant, case: Any, job_of: Callable[[Contestant, Any], Job], first: float) -> float:
    """CPU seconds of a contestant in one round."""
    return mean_seconds(job_of(c, case), first)


def scored_answer(
    subject: Charted, c: Contestant, case: Any, job_of: Callable[[Contestant, Any], Job], memory: bool
) -> dict[str, Any]:
    """What a contestant answers to a case, scored; or why it does not."""
    try:
        job = job_of(c, case)
        answer, spent = warm_seconds(job)
        again = None if answer.again is None else min(mean_seconds(answer.again, spent), spent)
        peak = peak_of(job) if memory and spent < PATIENCE else None
        scored = subject.score(case, answer)
    except (ForceIdError, ValueError, np.linalg.LinAlgError) as e:
        return {"failed": " ".join(str(e).split())[:300], "chosen": ""}
    said = {"verdict": answer.verdict, "reasons": list(answer.reasons), "chosen": answer.chosen}
    return {**scored, **said, "iterations": answer.steps, "seconds": spent, "again": again, "peak_MB": peak}


def chart_row(
    subject: Charted, facts: dict[str, Any], c: Contestant, found: Sequence[dict[str, Any]], own: list[float],
    default: list[float],
) -> dict[str, Any]:  # fmt: skip
    """A contestant as plain data; seconds: of a sample where a case has samples, else of the whole case."""
    one, count = found[0], facts.get("samples", 1)
    named = {
        "name": c.name, "line": c.joined, "kind": c.kind, "told": c.told, "about": c.about,
        "chosen": one["chosen"],
    }  # fmt: skip
    if failed := [a["failed"] for a in found if "failed" in a]:
        return named | {"failed": failed[0]}
    spent = [c.whole * s / count for s in own]
    paired = [a / b for a, b in zip(own, default, strict=False)]
    verdicts = [a["verdict"] for a in found]
    cost = {
        "rounds": len(own), "part": c.whole != 1, "seconds": float(np.median(spent)),
        "seconds_range": [min(spent), max(spent)],
        "times_default": float(np.median(paired)) if paired else None,
        "peak_MB": one["peak_MB"], "iterations": one["iterations"],
        "verdict": {v: verdicts.count(v) for v in dict.fromkeys(verdicts) if v},
        "reasons": sorted({r for a in found for r in a["reasons"]}),
    }  # fmt: skip
    if one["again"] is not None:  # a share, as the two were measured in one run
        second = one["again"] / one["seconds"]
        cost |= {"again": second * cost["seconds"], "setup_share": 1 - second}
    return named | cost | subject.judged(facts, found)


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
