"""The pictures of the chart: error against time with the front and the bound, and cost against size."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evidence.chart.charted import Charted
from evidence.chart.front import front, points_of
from evidence.chart.labels import place_labels
from forceid.report.plots.style import BLUE, DASHED, GRAY, INK, STYLE, VERMILION, label, panels, say

LEAST_SHOWN = 1e-16
WORTHLESS = 1.0  # relative error of the answer zero: what is above is left out
ROOM = 2.5  # about the points, a factor


@rc_context(STYLE)
def draw_case(subject: Charted, case: Mapping[str, Any]) -> Figure:
    """Error of one quantity above that of the other, over CPU time; every contestant or line named once."""
    shown = [what for what in case["quantities"] if points_of(case, what)]
    figure, axes = panels(max(len(shown), 1), 1, (10.0, 0.9 + 4.6 * max(len(shown), 1)))
    figure.legend(handles=legend(subject, case), loc="outside lower center", ncols=3)
    if not shown:
        say(axes[0, 0], "no truth")
        return figure
    for ax, what in zip(axes[:, 0], shown, strict=True):
        draw_points(ax, case, what)
        unit = case["units"] and case["units"][case["quantities"].index(what)]
        y = f"rms error per axis ({unit})" if unit else f"relative error of {what}"
        label(ax, f"{case['title']}: {what}", y, subject.time if what == shown[-1] else "")
    for ax, what in zip(axes[:, 0], shown, strict=True):
        note: Any = {"ha": "right", "va": "top", "fontsize": 7.0, "color": GRAY}
        ax.text(1.0, 1.0, left_out(case, what), transform=ax.transAxes, **note)
        rows = drawable_rows(case, what)
        last = {r["line"]: r["name"] for r in rows}
        names = [r["line"] if last[r["line"]] == r["name"] else "" for r in rows]
        xy = np.array([[r["seconds"], error_of(case, r, what)] for r in rows])
        place_labels(figure, ax, xy, names, [color_of(r) for r in rows])
        for text in ax.texts if subject.lines else ():
            if text.get_text():  # lines that run along it would show between its letters
                text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.4})
    return figure


def legend(subject: Charted, case: Mapping[str, Any]) -> list[Line2D]:
    """What marks and lines mean."""
    none: Any = {"ls": "none", "ms": 6}
    found = [
        Line2D([], [], marker="o", color=BLUE, label="forceid", **none),
        Line2D([], [], marker="s", color=VERMILION, label="peer", **none),
        Line2D(
            [], [], color=GRAY, lw=1.2, label="front of those told nothing" if "bound" in case else "front"
        ),
    ]
    if any(r["told"] for r in case["rows"]):
        told: Any = {"mfc": "white", **none}
        found += [
            Line2D([], [], marker="o", color=BLUE, label="forceid, told the truth", **told),
            Line2D([], [], marker="s", color=VERMILION, label="peer, told the truth", **told),
        ]
    if subject.lines:
        found.append(Line2D([], [], color=INK, lw=0.8, alpha=0.5, label=subject.lines))
    limit = "bound" if "bound" in case else f"{case['resolved']:.0e}: errors below are rounding"
    return [*found, Line2D([], [], color=INK, lw=1.0, ls=DASHED, label=limit)]


def color_of(row: Mapping[str, Any]) -> str:
    """Ours or theirs."""
    return VERMILION if row["kind"] == "peer" else BLUE


def error_of(case: Mapping[str, Any], row: Mapping[str, Any], what: str) -> float:
    """The error that is drawn: never zero."""
    return max(float(row["error"][what]), LEAST_SHOWN)


def worthless(case: Mapping[str, Any], row: Mapping[str, Any], what: str) -> bool:
    """Whether a relative error is that of the answer zero, or more."""
    return not case["units"] and row["error"][what] >= WORTHLESS


def drawable_rows(case: Mapping[str, Any], what: str) -> list[Mapping[str, Any]]:
    """Rows with an error that is worth something."""
    known = (r for r in case["rows"] if "failed" not in r and np.isfinite(r["error"][what]))
    return [r for r in known if not worthless(case, r, what)]


def left_out(case: Mapping[str, Any], what: str) -> str:
    """Who is not in the picture, and why."""
    if case["units"]:
        return ""
    above = [r["name"] for r in case["rows"] if "failed" not in r and worthless(case, r, what)]
    silent = [r["name"] for r in case["rows"] if "failed" in r]
    said = [f"error above {WORTHLESS:g}: {', '.join(above)}"] * bool(above)
    return "\n".join(said + [f"no answer: {', '.join(silent)}"] * bool(silent))


def draw_points(ax: Axes, case: Mapping[str, Any], what: str) -> None:
    """Every contestant with the range of its rounds and seeds, a line through its steps, front and bound."""
    rows = drawable_rows(case, what)
    for line in dict.fromkeys(r["line"] for r in rows):
        own = [r for r in rows if r["line"] == line]
        x, y = [r["seconds"] for r in own], [error_of(case, r, what) for r in own]
        ax.plot(x, y, color=color_of(own[0]), lw=0.8, alpha=0.5, zorder=3)
    for r in rows:
        at, error = r["seconds"], error_of(case, r, what)
        thin: Any = {"color": color_of(r), "lw": 0.7, "alpha": 0.6}
        ax.plot(r["seconds_range"], [error, error], **thin)
        if "spread" in r:
            ax.plot([at, at], [max(e, LEAST_SHOWN) for e in r["spread"][what]], **thin)
        fill, mark = "white" if r["told"] else color_of(r), "s" if r["kind"] == "peer" else "o"
        ax.plot(at, error, mark, color=color_of(r), mfc=fill, ms=4.8, zorder=4)
    least = case["bound"][what] if "bound" in case else case["resolved"]
    known = [least] if least and np.isfinite(least) else []
    ax.set(xscale="log", yscale="log")
    ax.set_xlim(*room_around([r["seconds"] for r in rows], ROOM))
    ax.set_ylim(*room_around([error_of(case, r, what) for r in rows] + known, ROOM))
    if known:
        ax.axhline(least, color=INK, lw=1.0, ls=DASHED, zorder=1)
    names = {r["name"] for r in rows}
    if steps := front([p for p in points_of(case, what) if p.name in names]):
        along, down = (np.repeat([getattr(p, of) for p in steps], 2) for of in ("seconds", "error"))
        ax.plot([*along, ax.get_xlim()[1]], [ax.get_ylim()[1], *down], color=GRAY, lw=1.2, zorder=2)


def room_around(values: list[float], factor: float) -> tuple[float, float]:
    """Limits of a log axis about values, with room of a factor on both sides.

    >>> room_around([1.0, 100.0], 2.0)
    (0.5, 200.0)
    """
    kept = [v for v in values if v > 0]
    return min(kept, default=0.1) / factor, max(kept, default=1.0) * factor
