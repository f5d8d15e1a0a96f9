"""Pictures of bodies in parts, and of affine ones: error against time, a line through tolerances or steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evidence.chart.figures import around
from evidence.chart.front import Point, front
from evidence.chart.labels import place_labels
from evidence.subjects.affine.chart import points_of as points_of_affine
from evidence.subjects.parts.chart import QUANTITIES, RESOLVED, points_of
from forceid.report.style import BLUE, DASHED, GRAY, INK, STYLE, VERMILION, label, panels

WORTHLESS = 1.0  # relative error of the answer zero: what is above is left out


@rc_context(STYLE)
def draw_body(case: dict[str, Any]) -> Figure:
    """Error of one quantity above that of another, over CPU time; every line named once."""
    quantities = case.get("quantities", QUANTITIES)
    figure, axes = panels(len(quantities), 1, (10.0, 0.9 + 4.6 * len(quantities)))
    figure.legend(handles=legend(case), loc="outside lower center", ncols=3)
    for i, what in enumerate(quantities):
        draw_lines(axes[i, 0], case, what)
        last = i == len(quantities) - 1
        y, x = f"relative error of {what}", case.get("time", "CPU time from matrices to solution (s)")
        label(axes[i, 0], f"{case['title']}: {what}", y, x if last else "")
    for i, what in enumerate(quantities):
        names, xy, colors = names_of(case, what)
        note: Any = {"ha": "right", "va": "top", "fontsize": 7.0, "color": GRAY}
        axes[i, 0].text(1.0, 1.0, left_out(case, what), transform=axes[i, 0].transAxes, **note)
        place_labels(figure, axes[i, 0], xy, names, colors)
        for text in axes[i, 0].texts:
            if text.get_text():  # lines that run along it would show between its letters
                text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.4})
    return figure


def legend(case: Mapping[str, Any]) -> list[Line2D]:
    """What marks and lines mean."""
    none: Any = {"ls": "none", "ms": 6}
    through = case.get("lines", "one solver, tolerance 1e-4, 1e-7, 1e-10 downward")
    limit = f"{case.get('resolved', RESOLVED):.0e}: errors below are rounding"
    return [
        Line2D([], [], marker="o", color=BLUE, label="forceid", **none),
        Line2D([], [], marker="s", color=VERMILION, label="peer", **none),
        Line2D([], [], color=GRAY, lw=1.2, label="front"),
        Line2D([], [], color=INK, lw=0.8, alpha=0.5, label=through),
        Line2D([], [], color=INK, lw=1.0, ls=DASHED, label=limit),
    ]


def points(case: Mapping[str, Any], what: str) -> list[Point]:
    """Points of a case of either kind."""
    return points_of(case, what) if "quantities" not in case else points_of_affine(case, what)


def drawn(case: Mapping[str, Any], what: str) -> list[Mapping[str, Any]]:
    """Rows with an error that is worth something."""
    return [r for r in case["rows"] if "failed" not in r and r["error"][what] < WORTHLESS]


def draw_lines(ax: Axes, case: dict[str, Any], what: str) -> None:
    """Every solver with the range of its rounds, a line through its tolerances, and the front."""
    rows, resolved = drawn(case, what), case.get("resolved", RESOLVED)
    for line in dict.fromkeys(r["line"] for r in rows):
        own = [r for r in rows if r["line"] == line]
        x, y = [r["seconds"] for r in own], [shown(r, what) for r in own]
        color, mark = (VERMILION, "s") if own[0]["kind"] == "peer" else (BLUE, "o")
        ax.plot(x, y, color=color, lw=0.8, alpha=0.5, zorder=3)
        ax.plot(x, y, mark, color=color, ms=4.5, zorder=4)
        for r, error in zip(own, y, strict=True):
            ax.plot(r["seconds_range"], [error, error], color=color, lw=0.7, alpha=0.6)
    ax.set(xscale="log", yscale="log")
    ax.set_xlim(*around([r["seconds"] for r in rows], 2.0))
    errors = [*(shown(r, what) for r in rows), resolved]
    ax.set_ylim(min(errors) / 4, max(errors) * 4)
    ax.axhline(resolved, color=INK, lw=1.0, ls=DASHED, zorder=2.5)
    steps = front([p for p in points(case, what) if p.error < WORTHLESS])
    if steps:
        along = np.repeat([p.seconds for p in steps], 2)
        down = np.repeat([p.error for p in steps], 2)
        ends = ax.get_ylim()[1], ax.get_xlim()[1]
        ax.plot([*along, ends[1]], [ends[0], *down], color=GRAY, lw=1.2, zorder=2)


def left_out(case: Mapping[str, Any], what: str) -> str:
    """Who is not in the picture, and why."""
    above = [r["name"] for r in case["rows"] if "failed" not in r and r["error"][what] >= WORTHLESS]
    silent = [r["name"] for r in case["rows"] if "failed" in r]
    said = [f"error above {WORTHLESS:g}: {', '.join(above)}"] * bool(above)
    return "\n".join(said + [f"no answer: {', '.join(silent)}"] * bool(silent))


def names_of(case: Mapping[str, Any], what: str) -> tuple[list[str], Any, list[str]]:
    """What is written at each point, where, in which color: a line's name at its tightest tolerance."""
    rows = drawn(case, what)
    last = {r["line"]: r["name"] for r in rows}
    names = [r["line"] if last[r["line"]] == r["name"] else "" for r in rows]
    xy = np.array([[r["seconds"], shown(r, what)] for r in rows])
    return names, xy, [VERMILION if r["kind"] == "peer" else BLUE for r in rows]


def shown(row: Mapping[str, Any], what: str) -> float:
    """The error that is drawn: never zero."""
    return max(float(row["error"][what]), 1e-16)
