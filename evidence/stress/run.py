"""The stress study: which records are to be made, which are done already, and the maps they add up to."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evidence.journal import code_hash, sources_in
from evidence.stress.cell import Cell, Trial, judge_cell
from evidence.stress.failure import Failure
from evidence.stress.failure_table import FAILURES
from evidence.stress.subjects import subject_of
from evidence.stress.trial import attempt
from evidence.subject import Contestant
from forceid import __version__

PAIRS = ("error", "claimed", "bound", "told", "over", "beside")  # of a trial, null where not known
SHORT_LEVELS = (0, 2, 4)  # of the eight, in the short form
ONCE = ("length",)  # groups of records so long that one seed tells


@dataclass(frozen=True)
class StressJob:
    """One record to make: a failure by name, a level, a seed; short: for the default method only."""

    failure: str
    level: float
    seed: int
    short: bool


@dataclass(frozen=True)
class MapRow:
    """One contestant on one failure: a cell for every level, and the process time of all its estimates, s."""

    who: Contestant
    cells: tuple[Cell, ...]
    seconds: float


@dataclass(frozen=True)
class Map:
    """A failure with the levels that were run and a row for every contestant."""

    failure: Failure
    levels: tuple[float, ...]
    rows: tuple[MapRow, ...]


def plan(chosen: Sequence[Failure], seeds: int, short: bool) -> list[StressJob]:
    """Every record of a study, seed by seed, so that a map fills evenly; one seed of very long ones."""
    return [
        StressJob(f.name, level, seed, short)
        for seed in range(1, seeds + 1)
        for f in chosen
        if seed == 1 or f.group not in ONCE
        for level in levels_of(f, short)
    ]


def levels_of(failure: Failure, short: bool) -> tuple[float, ...]:
    """The levels of a failure that a study runs."""
    return tuple(failure.levels[k] for k in SHORT_LEVELS) if short else failure.levels


def by_name(name: str) -> Failure:
    """The failure of that name."""
    return next(f for f in FAILURES if f.name == name)


def do(job: StressJob) -> dict[str, Any]:
    """The trials of one record."""
    failure = by_name(job.failure)
    subject = subject_of(failure)
    return attempt(subject, failure, job.level, job.seed, subject.contestants(failure, job.short))


def key_of(job: StressJob) -> str:
    """What the trials of a record depend on: code under test or that makes the record, and who meets it."""
    failure = by_name(job.failure)
    subject = subject_of(failure)
    sources = (*subject.sources, inspect.getmodule(failure.make))
    names = (who.name for who in subject.contestants(failure, job.short))
    files = [Path(inspect.getfile(source)) for source in sources if source is not None]
    code = code_hash([*sources_in(subject.folders), *files])  # two states of it never share a map
    return hashlib.sha256("\n".join([__version__, code, repr(job), *names]).encode()).hexdigest()[:16]


def maps_of(records: Iterable[dict[str, Any]], chosen: Sequence[Failure], short: bool) -> list[Map]:
    """The maps that the records of all seeds add up to."""
    pooled: dict[tuple[str, float, str], list[dict[str, Any]]] = {}
    for record in sorted(records, key=lambda r: int(r["seed"])):
        for who, tried in record["trials"].items():
            pooled.setdefault((record["failure"], record["level"], who), []).append(tried)
    maps = []
    for failure in chosen:
        levels, rows, subject = levels_of(failure, short), [], subject_of(failure)
        for who in subject.contestants(failure, short):
            trials = [pooled[failure.name, level, who.name] for level in levels]
            cells = tuple(judge_cell([trial_of(t) for t in some], subject.quantities) for some in trials)
            rows.append(MapRow(who, cells, sum(t["seconds"] for some in trials for t in some)))
        maps.append(Map(failure, levels, tuple(rows)))
    return maps


def trial_of(plain: dict[str, Any]) -> Trial:
    """A trial from plain numbers, in which null stands for what is not known."""
    both = {name: numbers(plain[name]) for name in PAIRS}
    return Trial(verdict=plain["verdict"], reason=plain["reason"], codes=tuple(plain["codes"]), **both)


def threshold(levels: Sequence[float], cells: Sequence[Cell], *colors: str) -> float | None:
    """The first level whose cell is of one of the colors, None for none.

    >>> threshold((1.0, 2.0), (), "red") is None
    True
    """
    return next((level for level, one in zip(levels, cells, strict=False) if one.color in colors), None)


def leaves_green(levels: Sequence[float], cells: Sequence[Cell]) -> float | None:
    """The first level at which an answer is no longer accurate, None for none."""
    return threshold(levels, cells, "amber", "grey", "red")


def counts(rows: Iterable[MapRow]) -> dict[str, int]:
    """How many cells are of each color, and amber in vain or by budget; records that are silently wrong."""
    cells = [one for row in rows for one in row.cells]
    found = {
        color: sum(c.color == color for c in cells) for color in ("green", "pale", "amber", "grey", "red")
    }
    return found | {
        "needless amber": sum(c.needless for c in cells),
        "amber by budget": sum(c.budgeted for c in cells),
        "records silently wrong": sum(c.silent for c in cells),
        "cells": len(cells),
    }


def as_plain(maps: Sequence[Map], seeds: int, short: bool) -> dict[str, Any]:
    """Everything that was found, as plain numbers and words."""
    return {
        "forceid_version": __version__,
        "seeds": seeds,
        "short": short,
        "counts": counts(row for m in maps for row in m.rows),
        "failures": [
            {
                "name": m.failure.name,
                "group": m.failure.group,
                "title": m.failure.title,
                "unit": m.failure.unit,
                "breaks": m.failure.breaks,
                "quantities": subject_of(m.failure).quantities,
                "levels": m.levels,
                "contestants": [
                    {
                        "name": row.who.name,
                        "leaves_green": leaves_green(m.levels, row.cells),
                        "first_red": threshold(m.levels, row.cells, "red"),
                        "seconds": row.seconds,
                        "cells": [vars(c) for c in row.cells],
                    }
                    for row in m.rows
                ],
            }
            for m in maps
        ],
    }


def from_plain(plain: dict[str, Any]) -> list[Map]:
    """The maps that `as_plain` told, as far as a page and its pictures need them."""
    maps = []
    for told in plain["failures"]:
        failure, rows = by_name(told["name"]), []
        known = {who.name: who for who in subject_of(failure).contestants(failure, plain["short"])}
        for one in told["contestants"]:
            cells = one["cells"]
            pairs = [
                {name: numbers(c[name]) for name in ("over_bound", "over_claim")}
                | {"codes": tuple(c["codes"])}
                for c in cells
            ]
            judged = tuple(Cell(**(c | pair)) for c, pair in zip(cells, pairs, strict=True))
            rows.append(MapRow(known[one["name"]], judged, one["seconds"]))
        maps.append(Map(failure, tuple(told["levels"]), tuple(rows)))
    return maps


def numbers(plain: Sequence[float | None]) -> tuple[float, float]:
    """Two numbers of which null is not known."""
    first, second = (float("nan") if value is None else float(value) for value in plain)
    return first, second
