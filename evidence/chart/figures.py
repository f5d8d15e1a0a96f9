"""The pictures of the chart: error against time with the front and the bound, and cost against size."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evidence.chart.front import front
from evidence.chart.labels import place_labels
from evidence.chart.page import points_of
from forceid.report.style import BLUE, CYCLE, DASHED, GRAY, INK, STYLE, VERMILION, label, panels, say

UNITS = {"force": "N", "moment": "N m"}
FLOOR = 1e-15


@rc_context(STYLE)
def draw_case(case: Mapping[str, Any]) -> Figure:
    """Error over CPU time a sample, force above moment, every contestant named."""
    loads = [load for load in UNITS if points_of(case, load)]
    figure, axes = panels(max(len(loads), 1), 1, (10.0, 0.9 + 4.6 * max(len(loads), 1)))
    figure.legend(handles=legend(), loc="outside lower center", ncols=6)
    if not loads:
        say(axes[0, 0], "no truth")
        return figure
    for i, load in enumerate(loads):
        draw_points(axes[i, 0], case, load)
        last = i == len(loads) - 1
        what = f"{case['title'] or case['name']}: {load}"
        label(
            axes[i, 0], what, f"rms error per axis ({UNITS[load]})", "CPU time a sample (s)" if last else ""
        )
    for i, load in enumerate(loads):
        points = points_of(case, load)
        xy = np.array([[p.seconds, p.error] for p in points])
        colors = [BLUE if p.ours else VERMILION for p in points]
        place_labels(figure, axes[i, 0], xy, [p.name for p in points], colors)
    return figure


def legend() -> list[Line2D]:
    """What marks and lines mean."""
    none: Any = {"ls": "none", "ms": 6}
    return [
        Line2D([], [], marker="o", color=BLUE, label="forceid", **none),
        Line2D([], [], marker="s", color=VERMILION, label="peer", **none),
        Line2D([], [], marker="o", color=BLUE, mfc="white", label="forceid, told the truth", **none),
        Line2D([], [], marker="s", color=VERMILION, mfc="white", label="peer, told the truth", **none),
        Line2D([], [], color=GRAY, lw=1.2, label="front of those told nothing"),
        Line2D([], [], color=INK, lw=1.0, ls=DASHED, label="bound"),
    ]


def draw_points(ax: Axes, case: Mapping[str, Any], load: str) -> None:
    """Every contestant with the range of its rounds and seeds, the front and the bound."""
    points = points_of(case, load)
    rows = {row["name"]: row for row in case["rows"]}
    for p in points:
        color = BLUE if p.ours else VERMILION
        low, high = rows[p.name]["spread"][load]
        fast, slow = rows[p.name]["seconds_range"]
        ax.plot([p.seconds, p.seconds], [max(low, FLOOR), max(high, FLOOR)], color=color, lw=0.7, alpha=0.6)
        ax.plot([fast, slow], [p.error, p.error], color=color, lw=0.7, alpha=0.6)
        fill = "white" if p.told else color
        ax.plot(p.seconds, p.error, "o" if p.ours else "s", color=color, mfc=fill, ms=5, zorder=4)
    steps = front(points)
    ax.set(xscale="log", yscale="log")
    ax.set_xlim(*around([p.seconds for p in points], 2.5))
    least = case["bound"][load]
    known = [least] if least and np.isfinite(least) else []
    ax.set_ylim(*around([p.error for p in points] + known, 2.5))
    if steps:
        x = np.repeat([p.seconds for p in steps], 2)
        y = np.repeat([p.error for p in steps], 2)
        ends = ax.get_ylim()[1], ax.get_xlim()[1]
        ax.plot([*x, ends[1]], [ends[0], *y], color=GRAY, lw=1.2, zorder=2)
    if known:
        ax.axhline(least, color=INK, lw=1.0, ls=DASHED, zorder=1)


def around(values: list[float], factor: float) -> tuple[float, float]:
    """Limits of a log axis about values, with room of a factor on both sides.

    >>> around([1.0, 100.0], 2.0)
    (0.5, 200.0)
    """
    kept = [v for v in values if v > FLOOR]
    return min(kept, default=0.1) / factor, max(kept, default=1.0) * factor


@rc_context(STYLE)
def draw_costs(costs: list[Mapping[str, Any]]) -> Figure:
    """CPU time over samples, markers and modes; the exponent stands at the end of each line."""
    figure, axes = panels(1, len(costs), (4.2 * len(costs), 4.6))
    for ax, cost in zip(axes[0], costs, strict=True):
        names = sorted(cost["seconds"], key=lambda n: -cost["seconds"][n][-1])
        for k, name in enumerate(names):
            line = "-" if k < len(CYCLE) else (0, (1, 1))
            seconds, color = cost["seconds"][name], CYCLE[k % len(CYCLE)]
            slope = cost["exponents"].get(name)
            said = name if slope is None else f"{name}: {slope:.2f}"
            ax.plot(
                cost["sizes"][: len(seconds)], seconds, ls=line, color=color, marker="o", ms=3, label=said
            )
        ax.set(xscale="log", yscale="log")
        ax.set_ylim(*around([s for spent in cost["seconds"].values() for s in spent], 3.0))
        ax.set_xticks(cost["sizes"][:: 2 if len(cost["sizes"]) > 6 else 1])
        ax.set_xticklabels([f"{s:g}" for s in cost["sizes"][:: 2 if len(cost["sizes"]) > 6 else 1]])
        ax.minorticks_off()
        label(ax, f"Cost in {cost['over']}", "CPU time (s)", cost["over"])
        ax.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.16),
            title="name: exponent",
            title_fontsize=8,
            fontsize=7,
        )
    return figure
