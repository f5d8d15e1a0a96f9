"""The page that reads the maps of where methods break."""

from __future__ import annotations

from collections.abc import Sequence

from evidence.stress.cell import Cell
from evidence.stress.figures import MARKS, MEANING, contestant_row, ratio_text, short_number
from evidence.stress.run import Map, MapRow, counts, leaves_green, needless, threshold
from evidence.stress.subjects import SUBJECTS, default_of, subject_of
from evidence.written import tabled

INTRODUCTION = """# Where methods break

Every failure below is swept from healthy to hopeless: {cells} cells, {seeds} seeds each.

{told}

{legend}

Of the amber cells, {needless} are needless: errors within twice the claimed ones and twice the bound. Of the
red ones, {honest} are honest in their claim, and beyond twice the bound without saying so. In {alone} single
records the verdict is `ok` and the error of that record alone is past the limit.

![all failures, {default}](overview.png)"""


def page_of(maps: Sequence[Map], seeds: int) -> str:
    """The page in Markdown: what the colors mean, thresholds of the defaults, red cells, then every map."""
    total = counts(row for m in maps for row in m.rows)
    legend = ([f"{MARKS[color]} {color}", text, str(total[color])] for color, text in MEANING.items())
    subjects = [s for s in SUBJECTS if any(subject_of(m.failure) is s for m in maps)]
    head = INTRODUCTION.format(
        cells=total["cells"], seeds=seeds, legend=tabled(("mark", "meaning", "cells"), legend),
        needless=total["needless amber"], alone=total["red alone"], honest=total["red, honest"],
        told="\n\n".join(s.told for s in subjects), default=" and ".join(s.default for s in subjects),
    )  # fmt: skip
    groups = ([m for m in maps if subject_of(m.failure) is s] for s in subjects)
    parts = [head, *(part for group in groups for part in defaults(group)), *red_cells(maps)]
    return "\n\n".join([*parts, *(part for m in maps for part in of_map(m))]) + "\n"


def defaults(maps: Sequence[Map]) -> list[str]:
    """Where the default leaves green, where it is first red, what breaks there and what it says."""
    rows = []
    for m in maps:
        row = contestant_row(m, default_of(m.failure))
        at, red = leaves_green(m.levels, row.cells), threshold(m.levels, row.cells, "red")
        said = "" if at is None else row.cells[m.levels.index(at)].reason
        rows.append([m.failure.title, level(at, m), level(red, m), m.failure.breaks, said or "-"])
    heads = "failure", "leaves green at", "first red at", "what breaks", "what the verdict says there"
    return [f"## Thresholds of the {subject_of(maps[0].failure).default}", tabled(heads, rows)]


def red_cells(maps: Sequence[Map]) -> list[str]:
    """Every red cell and its cause."""
    found = [
        [m.failure.title, level(at, m), row.who.name, one.cause, f"{one.ok} of {seeds_of(one)}"]
        for m in maps
        for row in m.rows
        for at, one in zip(m.levels, row.cells, strict=True)
        if one.color == "red"
    ]
    heads = "failure", "level", "method", "cause", "verdict ok"
    return ["## Silently wrong", tabled(heads, found) if found else "No cell."]


def seeds_of(one: Cell) -> int:
    """Records of a cell."""
    return max(one.ok + one.degraded + one.refused, 1)


def of_map(of: Map) -> list[str]:
    """One failure: its picture, and its thresholds and numbers by contestant."""
    f = of.failure
    heads = [f.unit, *map(short_number, of.levels), "leaves green at", "first red at"]
    breaks = f"{f.breaks[0].upper()}{f.breaks[1:]}."
    picture = f"![{f.title}]({f.name}.png)"
    parts = [f"## {f.title}", breaks, picture, tabled(heads, [failure_row(of, row) for row in of.rows])]
    amber = [row.who.name for row in of.rows if row.cells[0].color == "amber"]
    return parts + [f"Amber at the healthy end already: {', '.join(amber)}."] * bool(amber)


def failure_row(of: Map, row: MapRow) -> list[str]:
    """A row of the table of a failure: mark, error over bound, and error over claim of every level."""
    cells = [
        f"{MARKS[one.color]} {ratio_text(one)}; {worst(one)}{' (needless)' if needless(one) else ''}"
        for one in row.cells
    ]
    at, red = leaves_green(of.levels, row.cells), threshold(of.levels, row.cells, "red")
    return [row.who.name, *cells, level(at, of), level(red, of)]


def worst(one: Cell) -> str:
    """The worse of both errors over claim."""
    known = [r for r in one.over_claim if r == r]
    return short_number(max(known)) if known else "-"


def level(at: float | None, of: Map) -> str:
    """A level with its unit, or a dash for none."""
    return "-" if at is None else f"{short_number(at)} {of.failure.unit}".strip()
