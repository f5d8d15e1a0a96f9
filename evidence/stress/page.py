"""The page that reads the maps of where methods break."""

from __future__ import annotations

from collections.abc import Sequence

from evidence.judged import interval
from evidence.stress.figures import contestant_row, short_number
from evidence.stress.run import Map, counts, leaves_green
from evidence.stress.subjects import SUBJECTS, default_of, subject_of
from evidence.written import tabled

SHORT = {
    "green": "accurate", "pale": "honest and coarse", "amber": "degraded", "grey": "refused",
    "red": "silently wrong",
}  # fmt: skip
INTRODUCTION = """# Where methods break: {groups}

Every failure below is swept from healthy to hopeless: {cells} cells of {seeds} records.

{told}

Cells: {legend}.
Amber within 1.5 times the claim, so in vain: {needless}. Amber because the budget of the result accounts
for a wrong input: {budgeted}. A cell is red for one silently wrong record; there are {silent}.

![all failures, {default}](overview.png)

`stress.json` beside this page has every cell, with both errors and what the verdict says there."""


def page_of(maps: Sequence[Map], seeds: int) -> str:
    """The page in Markdown: what the colors mean, thresholds of the defaults, red cells, pictures."""
    total = counts(row for m in maps for row in m.rows)
    legend = ", ".join(f"{total[color]} {color} ({text})" for color, text in SHORT.items())
    subjects = [s for s in SUBJECTS if any(subject_of(m.failure) is s for m in maps)]
    silent, records = total["records silently wrong"], total["cells"] * seeds
    head = INTRODUCTION.format(
        cells=total["cells"], seeds=seeds, legend=legend,
        needless=total["needless amber"], budgeted=total["amber by budget"],
        silent=f"{silent} of {records} ({interval(silent, records)} %)",
        groups=", ".join(dict.fromkeys(m.failure.group.replace("_", " ") for m in maps)),
        told="\n\n".join(s.told for s in subjects), default=" and ".join(s.default for s in subjects),
    )  # fmt: skip
    groups = ([m for m in maps if subject_of(m.failure) is s] for s in subjects)
    parts = [head, *(part for group in groups for part in defaults(group)), *red_cells(maps)]
    pictures = "\n".join(f"![{m.failure.title}]({m.failure.name}.png)" for m in maps)
    return "\n\n".join([*parts, "## Every failure", pictures]) + "\n"


def defaults(maps: Sequence[Map]) -> list[str]:
    """Where the default leaves green, and what breaks there."""
    rows = []
    for m in maps:
        at = leaves_green(m.levels, contestant_row(m, default_of(m.failure)).cells)
        rows.append([m.failure.title, level(at, m), m.failure.breaks])
    heads = "failure", "leaves green at", "what breaks"
    return [f"## Thresholds of the {subject_of(maps[0].failure).default}", tabled(heads, rows)]


def red_cells(maps: Sequence[Map]) -> list[str]:
    """Who is red: in which failures, and in how many cells."""
    found: dict[str, list[str]] = {}
    for m in maps:
        for row in m.rows:
            red = [one for one in row.cells if one.color == "red"]
            if red:
                said = f"{m.failure.title} ({len(red)} of {len(row.cells)})"
                found.setdefault(row.who.name, []).append(said)
    rows = [[name, "; ".join(said)] for name, said in found.items()]
    return [
        "## Silently wrong",
        tabled(("method", "where, and in how many cells"), rows) if rows else "No cell.",
    ]


def level(at: float | None, of: Map) -> str:
    """A level with its unit, or a dash for none."""
    return "-" if at is None else f"{short_number(at)} {of.failure.unit}".strip()
