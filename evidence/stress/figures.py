"""Maps of where methods break: rows are methods or failures, columns levels, a color and a mark a cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from evidence.stress.cell import Cell
from evidence.stress.run import Map, MapRow
from evidence.stress.subjects import default_of, subject_of
from forceid.report.plots.style import INK, STYLE

# told apart by lightness too, and by their marks
COLORS = {"green": "#009E73", "pale": "#BDE3D5", "amber": "#F3C44C", "grey": "#CBCFD6", "red": "#A50F15"}
MARKS = {"green": "✓", "pale": "✓", "amber": "!", "grey": "–", "red": "✗"}
MEANING = {
    "green": "accurate: within twice the claim and twice the bound",
    "pale": "within twice the claim, beyond twice the bound",
    "amber": "degraded, and said so",
    "grey": "refused, and said why",
    "red": "silently wrong",
}
ON_DARK = (COLORS["green"], COLORS["red"])


@rc_context(STYLE)
def draw_map(of: Map) -> Figure:
    """One failure: a row for every contestant, with error over bound, or over claim, in each cell."""
    rows = len(of.rows)
    figure = Figure(figsize=(9.6, 1.55 + 0.42 * rows), layout="constrained")
    ax = figure.subplots()
    draw_cells(ax, [row.cells for row in of.rows])
    ax.set_yticks(range(rows), [row.who.name for row in of.rows])
    ax.set_xticks(range(len(of.levels)), [short_number(level) for level in of.levels])
    subject = subject_of(of.failure)
    name = titled(of)
    ax.set_xlabel(name[0].lower() + name[1:])
    worse = " and ".join(subject.quantities)
    ax.set_title(f"{of.failure.title}: error over {subject.against}, the worse of {worse}")
    add_legend(figure)
    return figure


@rc_context(STYLE)
def draw_overview(maps: Sequence[Map]) -> Figure:
    """All failures for the default contestant: a row for every failure, with the level in each cell."""
    names = list(dict.fromkeys(subject_of(m.failure).default for m in maps))
    shown = [(m, contestant_row(m, default_of(m.failure))) for m in maps]
    figure = Figure(figsize=(9.6, 1.6 + 0.31 * len(shown)), layout="constrained")
    ax = figure.subplots()
    draw_cells(ax, [row.cells for _, row in shown], [m.levels for m, _ in shown])
    ax.set_yticks(range(len(shown)), [titled(m) for m, _ in shown])
    columns = max(len(m.levels) for m, _ in shown)
    end = "hopeless" if all(m.levels == m.failure.levels for m in maps) else "worse"
    ax.set_xticks(range(columns), ["healthy", *[""] * (columns - 2), end])
    breaks = "break" if len(names) > 1 or names[0].startswith("functions") else "breaks"
    ax.set_title(f"Where {' and '.join(names)} {breaks}: levels in the cells")
    groups = [m.failure.group for m, _ in shown]
    for k in range(1, len(groups)):
        if groups[k] != groups[k - 1]:
            ax.axhline(k - 0.5, color=INK, lw=1.2)
    add_legend(figure)
    return figure


def titled(of: Map) -> str:
    """A failure with the unit of its levels."""
    return f"{of.failure.title} ({of.failure.unit})" if of.failure.unit else of.failure.title


def contestant_row(of: Map, who: str) -> MapRow:
    """The row of a contestant."""
    return next(row for row in of.rows if row.who.name == who)


def draw_cells(
    ax: Axes, rows: Sequence[Sequence[Cell]], levels: Sequence[Sequence[float]] | None = None
) -> None:
    """Colored cells with their mark and a number: error over bound, or the level where levels are given."""
    ax.grid(False)
    ax.spines[:].set_visible(False)
    ax.tick_params(length=0, labelcolor=INK)
    for i, cells in enumerate(rows):
        for j, one in enumerate(cells):
            face = COLORS[one.color]
            box = Rectangle((j - 0.5, i - 0.5), 1, 1, facecolor=face, edgecolor="white", lw=1.5)
            ax.add_patch(box)
            number = short_number(levels[i][j]) if levels else ratio_text(one)
            style: Any = {"color": "white" if face in ON_DARK else INK, "fontsize": 8.5}
            ax.text(j, i, f"{MARKS[one.color]} {number}".strip(), ha="center", va="center", **style)
    ax.set_xlim(-0.5, max(map(len, rows)) - 0.5)
    ax.set_ylim(len(rows) - 0.5, -0.5)


def add_legend(figure: Figure) -> None:
    """What the colors and marks mean, below the map."""
    handles = [
        Patch(facecolor=COLORS[color], edgecolor="#999999", lw=0.5, label=f"{MARKS[color]}  {text}")
        for color, text in MEANING.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)


def ratio_text(one: Cell) -> str:
    """The worse of both errors over bound; without a bound over the claim, in brackets."""
    known = [r for r in one.over_bound if np.isfinite(r)]
    claimed = [r for r in one.over_claim if np.isfinite(r)]
    if known:
        return short_number(max(known))
    return f"({short_number(max(claimed))})" if claimed else ""


def short_number(value: float) -> str:
    """A number in at most five characters.

    >>> short_number(0.00123), short_number(12.34), short_number(1e5), short_number(3430.2)
    ('0.0012', '12', '1e5', '3.4e3')
    """
    if value == 0:
        return "0"
    if 1e-4 <= abs(value) < 1000:
        return f"{value:.2g}" if abs(value) < 100 else f"{value:.0f}"
    digits, power = f"{value:.1e}".split("e")
    return f"{digits.removesuffix('.0')}e{int(power)}"
