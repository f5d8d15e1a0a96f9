"""Names beside the points of a picture, none over another: the nearest free place, a line to it if far."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from forceid.records import Array
from forceid.report.plots.style import GRAY

DISTANCES = (7.0, 14.0, 24.0, 36.0, 50.0, 66.0, 84.0, 104.0, 126.0, 150.0)  # points
DIRECTIONS = np.radians([0, 180, 30, -30, 150, -150, 60, -60, 120, -120, 90, -90])
HALO = [withStroke(linewidth=2.5, foreground="white")]  # lines pass behind a name
HALF_MARK = 4.0  # points: half of the side that a mark takes up


def place_labels(
    figure: Figure, ax: Axes, xy: Array, names: Sequence[str], colors: Sequence[str], size: float = 7.0
) -> None:
    """Write each name near its point xy (point, 2), data units; the figure is laid out, and kept so."""
    canvas: Any = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    renderer, scale = canvas.get_renderer(), figure.dpi / 72.0
    at = ax.transData.transform(xy)
    frame = ax.get_window_extent(renderer)
    inside = np.array([frame.x0 + 2, frame.y0 + 2, frame.x1 - 2, frame.y1 - 2])
    half = HALF_MARK * scale
    taken = [np.array([x - half, y - half, x + half, y + half]) for x, y in at]
    for i in np.lexsort((at[:, 1], crowd(at))):
        style: Any = {"fontsize": size, "color": colors[i], "zorder": 5, "path_effects": HALO}
        text = ax.text(0, 0, names[i], transform=None, **style)
        extent = text.get_window_extent(renderer)
        text.remove()
        width, height = extent.width, extent.height
        box, distance = free_place(at[i], width, height, taken, inside, scale)
        taken.append(box)
        off = (0.5 * (box[:2] + box[2:]) - at[i]) / scale
        ax.annotate(
            names[i], (xy[i, 0], xy[i, 1]), (off[0], off[1]), textcoords="offset points", ha="center",
            va="center", **style,
        )  # fmt: skip
        if distance > DISTANCES[1]:
            ends = np.array([at[i], np.clip(at[i], box[:2], box[2:])])
            x, y = ax.transData.inverted().transform(ends).T
            ax.plot(x, y, color=GRAY, lw=0.5, zorder=1)


def crowd(at: Array) -> Array:
    """How far each point (point, 2) is from its nearest other: the lonely ones are named last."""
    apart = np.linalg.norm(at[:, None] - at, axis=2)
    np.fill_diagonal(apart, np.inf)
    return np.asarray(apart.min(1)) if len(at) > 1 else np.zeros(len(at))


def free_place(
    at: Array, width: float, height: float, taken: Sequence[Array], inside: Array, scale: float
) -> tuple[Array, float]:
    """The nearest box (4,) for a text of that size that meets no other, and its distance in points.

    Where none is free, the one that meets the least.
    """
    boxes = np.array(taken)
    best, least = (np.zeros(4), 0.0), np.inf
    for distance in DISTANCES:
        for angle in DIRECTIONS:
            way = np.array([np.cos(angle), np.sin(angle)])
            middle = at + way * (distance * scale + 0.5 * np.array([width, height]) * np.abs(way))
            reach = 0.5 * np.array([width, height]) + scale * np.array([1.0, 0.5])
            box = np.concatenate([middle - reach, middle + reach])
            met = overlap(box, boxes)
            out = np.maximum(inside[:2] - box[:2], 0).sum() + np.maximum(box[2:] - inside[2:], 0).sum()
            met += 100 * float(out)
            if met == 0:
                return box, distance
            if met < least:
                best, least = (box, distance), met
    return best


def overlap(box: Array, others: Array) -> float:
    """Area that a box (4,) shares with others (box, 4).

    >>> overlap(np.array([0.0, 0, 2, 2]), np.array([[1.0, 1, 3, 3], [5, 5, 6, 6]]))
    1.0
    """
    shared = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    return float((np.maximum(shared, 0)).prod(1).sum())
