"""What a run leaves: lines on the terminal, a table in markdown, numbers in json."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from evidence.races.paired import RaceOutcome, RaceRow, agreement, three_figures, wrong
from evidence.written import tabled, written

CLOCKS = {"ns": 1e9, "us": 1e6, "ms": 1e3}
TARGET_WORDS = {True: "met", False: "NOT MET", None: "not measured"}


def lines(outcome: RaceOutcome) -> str:
    """The race as a markdown section."""
    race, base = outcome.race, outcome.rows[outcome.race.base]
    names = sorted({name for row in outcome.rows.values() for name in row.figures})
    ratio = f"times as fast as {race.base}: min / median / max"
    rows = []
    for row in outcome.rows.values():
        if row.absent:
            rows.append([row.name, f"not here: {row.absent}"])
            continue
        fast = " / ".join(map(three_figures, row.times_as_fast_as(base))) if base.seconds else "-"
        said = "the reference" if row.name == race.base else agreement(row)
        cells = [row.name, three_figures(CLOCKS[race.clock] * row.median), timed_on(outcome, row), fast, said]
        rows.append([*cells, *(f"{row.figures[n]:.3g}" if n in row.figures else "" for n in names)])
    heads = ["", f"{race.clock} a {race.unit}", "timed on", ratio, "answer", *names]
    parts = [f"## {race.title}", tabled(heads, rows)]
    if race.goals:
        parts.append(tabled(("goal", "measured", ""), goals(outcome)))
    return "\n\n".join(parts) + "\n"


def goals(outcome: RaceOutcome) -> list[list[str]]:
    """Goals in words, what was measured, and whether they are met."""
    return [[text, measured, TARGET_WORDS[met]] for text, measured, met in outcome.verdicts()]


def timed_on(outcome: RaceOutcome, row: RaceRow) -> str:
    """How much of the job was measured; of the rest, the time is taken in proportion."""
    part, whole = row.size * outcome.race.samples, outcome.race.size * outcome.race.samples
    return f"{part:,}" + ("" if part == whole else f" of {whole:,}")


def as_data(outcome: RaceOutcome) -> dict[str, Any]:
    """The race as plain data."""
    race = outcome.race
    base = outcome.rows[race.base]
    rows = []
    for row in outcome.rows.values():
        entry = asdict(row) | {"wrong": wrong(row)}
        if row.seconds and base.seconds:
            entry["ratio_to_base_min_median_max"] = row.times_as_fast_as(base)
        rows.append(entry)
    asked = [{"goal": g, "measured": m, "met": met} for g, m, met in outcome.verdicts()]
    sizes = {"size": race.size, "samples_per_unit": race.samples, "unit": race.unit, "check": race.check}
    return {"title": race.title, "base": race.base, **sizes, "rows": rows, "goals": asked}


def goals_table(outcomes: list[RaceOutcome]) -> str:
    """All goals in one table."""
    rows = [[outcome.race.title, *row] for outcome in outcomes for row in goals(outcome)]
    return "## Goals\n\n" + tabled(("race", "goal", "measured", ""), rows) + "\n"


def times_table(outcomes: list[RaceOutcome]) -> str:
    """Ours, and the fastest other than whom the goals are measured by, of every race."""
    return "## Times\n\n" + tabled(("race", "ours", "fastest other"), map(times, outcomes)) + "\n"


def times(outcome: RaceOutcome) -> list[str]:
    """One race in the table of times."""
    race, here = outcome.race, [row for row in outcome.rows.values() if not row.absent and row.seconds]
    ours = next((row for row in here if "forceid" in row.name), None)
    rest = (row for row in here if "forceid" not in row.name and row.name != race.base)
    other = min(rest, key=lambda row: row.median, default=None)
    return [race.title, *(spent(race.clock, row) for row in (ours, other))]


def spent(clock: str, row: RaceRow | None) -> str:
    """Who took how long, or a dash; with a word where the answer is wrong."""
    if row is None:
        return "-"
    said = f", {agreement(row)}" * bool(wrong(row))
    return f"{row.name}: {three_figures(CLOCKS[clock] * row.median)} {clock}{said}"


def write_benchmarks(
    folder: Path, preamble: str, machine: dict[str, Any], outcomes: list[RaceOutcome]
) -> None:
    """benchmarks.md and benchmarks.json in `folder`."""
    tables = preamble, goals_table(outcomes), times_table(outcomes)
    written(
        folder,
        "benchmarks.md",
        "\n".join(
            [*tables, "`make bench` writes everyone's time and answer into `bench/benchmarks.json`.\n"]
        ),
    )
    data = {**machine, "races": [as_data(outcome) for outcome in outcomes]}
    written(folder, "benchmarks.json", json.dumps(data, indent=1) + "\n")
