"""What a run leaves: lines on the terminal, a table in markdown, numbers in json."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from evidence.races.paired import Outcome, Row, agreement, figure, wrong

CLOCKS = {"ns": 1e9, "us": 1e6, "ms": 1e3}
MARK = {True: "met", False: "NOT MET", None: "not measured"}


def lines(outcome: Outcome) -> str:
    """The race as a markdown section."""
    race, base = outcome.race, outcome.rows[outcome.race.base]
    names = sorted({name for row in outcome.rows.values() for name in row.figures})
    ratio = f"times as fast as {race.base}: min / median / max"
    head = [f"{race.clock} a {race.unit}", "timed on", ratio, "answer", *names]
    out = [f"## {race.title}", "", f"| | {' | '.join(head)} |", "|---|" + "---|" * len(head)]
    for row in outcome.rows.values():
        if row.absent:
            out.append(f"| {row.name} | not here: {row.absent} |" + " |" * (len(head) - 1))
            continue
        cells = [figure(CLOCKS[race.clock] * row.median), timed_on(outcome, row)]
        if base.seconds:
            cells.append(" / ".join(figure(r) for r in row.times_as_fast_as(base)))
        else:
            cells.append("-")
        cells.append("the reference" if row.name == race.base else agreement(row))
        cells += [f"{row.figures[n]:.3g}" if n in row.figures else "" for n in names]
        out.append(f"| {row.name} | " + " | ".join(cells) + " |")
    if race.goals:
        out += ["", "| goal | measured | |", "|---|---|---|"]
        out += [f"| {text} | {measured} | {MARK[met]} |" for text, measured, met in outcome.verdicts()]
    return "\n".join(out) + "\n"


def timed_on(outcome: Outcome, row: Row) -> str:
    """How much of the job was measured; of the rest, the time is taken in proportion."""
    part, whole = row.size * outcome.race.samples, outcome.race.size * outcome.race.samples
    return f"{part:,}" + ("" if part == whole else f" of {whole:,}")


def as_data(outcome: Outcome) -> dict[str, Any]:
    """The race as plain data."""
    race = outcome.race
    base = outcome.rows[race.base]
    rows = []
    for row in outcome.rows.values():
        entry = asdict(row) | {"wrong": wrong(row)}
        if row.seconds and base.seconds:
            entry["ratio_to_base_min_median_max"] = row.times_as_fast_as(base)
        rows.append(entry)
    goals = [{"goal": g, "measured": m, "met": met} for g, m, met in outcome.verdicts()]
    sizes = {"size": race.size, "samples_per_unit": race.samples, "unit": race.unit, "check": race.check}
    return {"title": race.title, "base": race.base, **sizes, "rows": rows, "goals": goals}


def summary(outcomes: list[Outcome]) -> str:
    """All goals in one table."""
    out = ["## Goals", "", "| race | goal | measured | |", "|---|---|---|---|"]
    for outcome in outcomes:
        for text, measured, met in outcome.verdicts():
            out.append(f"| {outcome.race.title} | {text} | {measured} | {MARK[met]} |")
    return "\n".join(out) + "\n"


def write(folder: Path, preamble: str, machine: dict[str, Any], outcomes: list[Outcome]) -> None:
    """benchmarks.md and benchmarks.json in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    sections = [preamble, summary(outcomes), *map(lines, outcomes)]
    (folder / "benchmarks.md").write_text("\n".join(sections), encoding="utf-8")
    data = {**machine, "races": [as_data(outcome) for outcome in outcomes]}
    (folder / "benchmarks.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
