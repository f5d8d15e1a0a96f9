"""How every figure looks: one style, a palette that color-blind readers can tell apart, thinning, bands."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import as_file, files
from typing import Any

import numpy as np
from matplotlib import rc_params_from_file
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from forceid.errors import ConfigError
from forceid.records import AXES, Array

BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#AA4499", "#E69F00", "#56B4E9"
INK, GRAY = "#222222", "#8A8F98"
AXIS_COLOR = {"x": VERMILION, "y": GREEN, "z": BLUE}  # Okabe and Ito
CYCLE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
DASHED = (0, (4, 2))
BINS = 1500  # points a curve keeps: about two for each pixel of a panel

with as_file(files("forceid.report") / "plots" / "house.mplstyle") as house:
    STYLE: Any = rc_params_from_file(house, use_default_template=False)


def panels(
    rows: int, columns: int, size: tuple[float, float], ax: Any = None, **options: Any
) -> tuple[Figure, Any]:
    """A figure of `size` inches in the house style, with its (rows, columns) array of axes.

    ax: axes that are there already, as many, whose figure is returned. ConfigError: another number of them.
    """
    if ax is not None:
        given = np.array(ax, dtype=object).reshape(-1)
        if len(given) != rows * columns:
            what = f"are {len(given)} axes, expected {rows * columns}: {rows} rows of {columns}"
            raise ConfigError(what, "ax", f"make them by plt.subplots({rows}, {columns})")
        return given[0].figure, given.reshape(rows, columns)
    figure = Figure(
        figsize=size, layout=ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.06, wspace=0.03, hspace=0.04)
    )
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, axes


def bins(time: Array) -> NDArray[np.intp]:
    """Start index of each bin; every sample is its own bin while there are few."""
    return np.unique(np.linspace(0, len(time), BINS, endpoint=False).astype(np.intp))


def draw_line(ax: Axes, time: Array, values: Array, **options: Any) -> None:
    """Draw values (time,), thinned to the least and greatest of each bin so that no peak is lost."""
    start = bins(time)
    if len(start) == len(time):
        ax.plot(time, values, **options)
        return
    both = np.stack([np.fmin.reduceat(values, start), np.fmax.reduceat(values, start)], axis=-1)
    ax.plot(np.repeat(time[start], 2), both.ravel(), **options)


def draw_band(ax: Axes, time: Array, low: Array, high: Array, **options: Any) -> None:
    """Shade between low and high (time,), thinned to the widest of each bin."""
    start = bins(time)
    low, high = np.fmin.reduceat(low, start), np.fmax.reduceat(high, start)
    ax.fill_between(time[start], low, high, linewidth=0, **options)


def label(ax: Axes, title: str = "", y: str = "", x: str = "time (s)") -> None:
    """Title and axis labels; the unit stands in parentheses."""
    ax.set_title(title)
    ax.set_xlabel(x)
    ax.set_ylabel(y)


def say(ax: Axes, text: str) -> None:
    """One remark in the middle of an empty panel."""
    ax.text(
        0.5,
        0.5,
        text,
        transform=ax.transAxes,
        ha="center",
        va="center",
        color=GRAY,
        fontsize=10,
        style="italic",
        bbox={"facecolor": "white", "edgecolor": "none"},
    )
    ax.set_yticks([])


def draw_columns(ax: Axes, time: Array, values: Array, names: Sequence[str], colors: Sequence[str]) -> None:
    """One line per column of values (time, column), with a legend; a remark when nothing is known."""
    if not np.isfinite(values).any():
        say(ax, "not identifiable")
        return
    for column, name, color in zip(values.T, names, colors, strict=False):
        draw_line(ax, time, column, color=color, label=name)
    ax.legend(
        loc="lower right",
        bbox_to_anchor=(1, 1),
        ncols=6,
        handlelength=1.0,
        columnspacing=0.9,
        borderaxespad=0,
    )
    ax.margins(x=0.01)


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
    if isinstance(figure.get_layout_engine(), ConstrainedLayoutEngine):
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
    else:  # the figure of a user: what is in it stays where it is
        figure.axes[0].legend(handles=handles, loc="best", ncols=2)
    figure.align_ylabels()
