"""The page that reads the maps of where methods break."""

from __future__ import annotations

from collections.abc import Sequence

from evidence.stress.figures import MARKS, MEANING, contestant_row, short_number
from evidence.stress.run import Map, counts, leaves_green, threshold
from evidence.stress.subjects import SUBJECTS, default_of, subject_of
from evidence.written import tabled

INTRODUCTION = """# Where methods break: {groups}

Every failure below is swept from healthy to hopeless: {cells} cells, {seeds} seeds each.

{told}

{legend}

Of the amber cells, {needless} are needless: errors within twice the claimed ones and twice the bound. Of the
red ones, {honest} are honest in their claim, and beyond twice the bound without saying so. In {alone} single
records the verdict is `ok` and the error of that record alone is past the limit.

![all failures, {default}](overview.png)

`stress.json` beside this page has every cell, with both errors and what the verdict says there."""


def page_of(maps: Sequence[Map], seeds: int) -> str:
    """The page in Markdown: what the colors mean, thresholds of the defaults, red cells, pictures."""
    total = counts(row for m in maps for row in m.rows)
    legend = ([f"{MARKS[color]} {color}", text, str(total[color])] for color, text in MEANING.items())
    subjects = [s for s in SUBJECTS if any(subject_of(m.failure) is s for m in maps)]
    head = INTRODUCTION.format(
        cells=total["cells"], seeds=seeds, legend=tabled(("mark", "meaning", "cells"), legend),
        needless=total["needless amber"], alone=total["red alone"], honest=total["red, honest"],
        groups=", ".join(dict.fromkeys(m.failure.group.replace("_", " ") for m in maps)),
        told="\n\n".join(s.told for s in subjects), default=" and ".join(s.default for s in subjects),
    )  # fmt: skip
    groups = ([m for m in maps if subject_of(m.failure) is s] for s in subjects)
    parts = [head, *(part for group in groups for part in defaults(group)), *red_cells(maps)]
    pictures = "\n".join(f"![{m.failure.title}]({m.failure.name}.png)" for m in maps)
    return "\n\n".join([*parts, "## Every failure", pictures]) + "\n"


def defaults(maps: Sequence[Map]) -> list[str]:
    """Where the default leaves green, where it is first red, and what breaks there."""
    rows = []
    for m in maps:
        row = contestant_row(m, default_of(m.failure))
        at, red = leaves_green(m.levels, row.cells), threshold(m.levels, row.cells, "red")
        rows.append([m.failure.title, level(at, m), level(red, m), m.failure.breaks])
    heads = "failure", "leaves green at", "first red at", "what breaks"
    return [f"## Thresholds of the {subject_of(maps[0].failure).default}", tabled(heads, rows)]


def red_cells(maps: Sequence[Map]) -> list[str]:
    """Who is red in a failure: at how many levels, the first and the last, and the worst cause."""
    found = []
    for m in maps:
        for row in m.rows:
            red = [(at, one) for at, one in zip(m.levels, row.cells, strict=True) if one.color == "red"]
            if red:
                worst = max((one for _, one in red), key=lambda one: max((*one.over_claim, *one.over_bound)))
                ends = " to ".join(dict.fromkeys((short_number(red[0][0]), level(red[-1][0], m))))
                count = f"{len(red)} of {len(row.cells)}"
                found.append([m.failure.title, row.who.name, count, ends, worst.cause])
    heads = "failure", "method", "levels", "from, to", "worst of them"
    return ["## Silently wrong", tabled(heads, found) if found else "No cell."]


def level(at: float | None, of: Map) -> str:
    """A level with its unit, or a dash for none."""
    return "-" if at is None else f"{short_number(at)} {of.failure.unit}".strip()
