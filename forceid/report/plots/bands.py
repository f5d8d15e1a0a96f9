"""A quantity over its band, beside the truth where there is one, and the legend that says so."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from forceid.records import Array
from forceid.report.plots.style import AXES, BLUE, DASHED, INK, ORANGE, draw_band, draw_line, label, say


def draw_estimate(
    ax: Axes,
    time: Array,
    values: Array,
    half: Array,
    true: Array | None = None,
    unknown: str = "not identifiable",
    plain: Array | None = None,
) -> None:
    """Values (time,) over a band of half-width `half` (time,); the remark `unknown` when nothing is known.

    true: the truth, plain: the plain route, both (time,), thin lines where they are known.
    """
    if not np.isfinite(values).any():
        say(ax, unknown)
        return
    draw_band(ax, time, values - half, values + half, color=BLUE, alpha=0.22)
    draw_line(ax, time, values, color=BLUE)
    if plain is not None and np.isfinite(plain).any():
        draw_line(ax, time, plain, color=ORANGE, lw=0.9)
    if true is not None and np.isfinite(true).any():
        draw_line(ax, time, true, color=INK, lw=1.0, ls=DASHED)
    ax.margins(x=0.01)


def draw_axes(
    axes: Any, head: tuple[str, str, str], time: Array, values: Array, half: Array, true: Array,
    unknown: str = "not identifiable", plain: Array | None = None,
) -> None:  # fmt: skip
    """A vector in three panels, one an axis, each as `draw_estimate` does; head: letter, title and unit."""
    letter, title, unit = head
    for k, axis in enumerate(AXES):
        label(axes[k], "" if k else title, f"{letter}$_{axis}$ ({unit})", "time (s)" if k == 2 else "")
        other = None if plain is None else plain[:, k]
        draw_estimate(axes[k], time, values[:, k], half[:, k], true[:, k], unknown, other)


def explain(figure: Figure, band: str, known: bool, plain: bool = False) -> None:
    """The legend below such panels: how wide the band is, whether a truth and the plain route are drawn."""
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=BLUE, label="estimate"),
        Patch(color=BLUE, alpha=0.22, lw=0, label=band),
    ]
    if plain:
        handles.append(Line2D([], [], color=ORANGE, lw=0.9, label="plain route"))
    if known:
        handles.append(Line2D([], [], color=INK, lw=1.0, ls=DASHED, label="truth"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    figure.align_ylabels()
