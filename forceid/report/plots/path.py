"""The figure of the path in space, at equal scale and upright, with arrows for the applied force."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from forceid.records import AXES, Array, Estimate
from forceid.report.numbers import plain
from forceid.report.plots.chart import clock, kept, numbers
from forceid.report.plots.style import BLUE, INK, STYLE, VERMILION, bins

ARROWS = 24
STANDS_OUT = 1.5  # times the force in the middle of a stretch: a peak that must be seen
WIDTH, HEIGHT = 10.0, 5.6  # of the figure, inches
BOX = (7.6, 3.9)  # that the box may take of it: the rest is for tick labels and legend
LONGEST_ARROW = 0.22  # arrow, of the extent of the path
DEPTH = 0.4  # least side of the box, of the same: thinner ones squeeze their tick labels together


@rc_context(STYLE)
def draw_path(estimate: Estimate, ax: Any = None) -> Figure:
    """The path of the center in world axes at equal scale, with arrows for the applied force.

    Some sample must show the center. ax: axes in space, of projection "3d", to draw in.
    """
    seen = np.isfinite(estimate.center).all(axis=1)
    own = ax is None
    figure = Figure(figsize=(WIDTH, HEIGHT)) if own else ax.figure
    if own:
        title = "Path of the mass center, world axes at equal scale"
        figure.text(0.02, 0.955, title, fontsize=10, weight="bold")
        ax = figure.add_axes((0.0, 0.06, 1.0, 0.9), projection="3d", computed_zorder=False)

    path = estimate.center[bins(estimate.time)]
    span = max(float(np.ptp(estimate.center[seen], axis=0).max()), 1e-9)
    at = strongest(estimate)
    force = estimate.force[at]
    longest = float(np.linalg.norm(force, axis=1).max(initial=0.0))
    arrows = force * (LONGEST_ARROW * span / longest) if longest > 0 else force
    drawn = np.concatenate([path, estimate.center[at] + arrows])
    vertical, floor = fit_box(
        ax, np.nanmin(drawn, axis=0), np.nanmax(drawn, axis=0), span, estimate.gravity, fit=own
    )

    shadow = path.copy()
    shadow[:, vertical] = floor
    ax.plot(*shadow.T, color="#C9CCD2", lw=1.2, zorder=1, clip_on=False)
    ax.plot(*path.T, color=INK, lw=1.6, zorder=2, clip_on=False)
    if len(at):
        ends = (*estimate.center[at].T, *arrows.T)
        ax.quiver(*ends, color=VERMILION, lw=1.2, arrow_length_ratio=0.25, zorder=3, clip_on=False)
    for point, shape in zip(path[np.isfinite(path).all(axis=1)][[0, -1]], "os", strict=True):
        ax.scatter(*point, color=BLUE, s=36, marker=shape, depthshade=False, zorder=4, clip_on=False)
    if own:
        figure.legend(handles=handles(longest), loc="lower center", ncols=4)
    return figure


def strongest(estimate: Estimate) -> NDArray[np.intp]:
    """The samples that get an arrow: the middle of each stretch of the path, if its force exceeds two sigma.

    Stretches are of equal length along the path, so that arrows do not crowd where the body is slow. A force
    that stands out of its stretch gets the arrow instead.
    """
    size, std = (np.linalg.norm(v, axis=1) for v in (estimate.force, estimate.force_std))
    known = np.flatnonzero(np.isfinite(estimate.center).all(axis=1) & np.isfinite(size))
    if not len(known):
        return known
    steps = np.linalg.norm(np.diff(estimate.center[known], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    place = ARROWS * along / max(float(along[-1]), 1e-9)
    stretch = np.minimum(place, ARROWS - 1).astype(np.intp)
    found = []
    for k in np.unique(stretch).tolist():
        own = np.flatnonzero(stretch == k)
        middle, most = own[np.abs(place[own] - k - 0.5).argmin()], own[size[known[own]].argmax()]
        found.append(known[most if size[known[most]] > STANDS_OUT * size[known[middle]] else middle])
    at = np.array(found, dtype=np.intp)
    chosen: NDArray[np.intp] = at[size[at] > 2 * np.nan_to_num(std[at])]
    return chosen


def path_chart(estimate: Estimate) -> dict[str, Any]:
    """The path in space as the script of the page turns it: points, arrows and their ends, and what is up."""
    at = kept(estimate.center)
    arrows = strongest(estimate)
    size = np.linalg.norm(estimate.force[arrows], axis=1)
    vertical = int(np.abs(estimate.gravity).argmax()) if np.any(estimate.gravity) else 2
    return {
        "path": [numbers(point) for point in estimate.center[at]],
        "foot": [numbers(point) for point in estimate.center[arrows]],
        "force": [numbers(force) for force in estimate.force[arrows]],
        "time": clock(estimate.time[arrows]),
        "vertical": vertical,
        "up": -1 if estimate.gravity[vertical] > 0 else 1,
        "longest": float(size.max(initial=0.0)),
    }


def fit_box(
    ax: Any, low: Array, high: Array, span: float, gravity: Array, fit: bool = True
) -> tuple[int, float]:
    """Set limits and view of the box from low to high (3,), with gravity down, and zoom so that it fits.

    Returns the vertical axis and the level of the floor.
    """
    vertical = int(np.abs(gravity).argmax()) if np.any(gravity) else 2
    size = np.maximum(high - low, DEPTH * span) * 1.08
    lower, upper = 0.5 * (low + high - size), 0.5 * (low + high + size)
    for k, name in enumerate(AXES):
        ends = (lower[k], upper[k])
        getattr(ax, f"set_{name}lim")(*(ends[::-1] if k == vertical and gravity[k] > 0 else ends))
        axis = getattr(ax, f"{name}axis")
        axis.set_major_locator(MaxNLocator(max(2, round(6 * size[k] / size.max())), min_n_ticks=2))
        # matplotlib moves labels off the axis by a share of the box across it: more where that is thin
        thin = size.max() / np.delete(size, k).max() if k == vertical else 1.0
        axis.set_tick_params(pad=11 * thin - 8)
        axis.set_pane_color("#F7F8FA")
        axis.line.set_color("#B8BCC4")
        getattr(ax, f"set_{name}label")(f"{name} (m)", labelpad=26 * thin - 21)
    ax.set_proj_type("ortho")
    ax.view_init(elev=24, azim=-58, vertical_axis=AXES[vertical])
    ax.set_box_aspect(size)
    if not fit:
        return vertical, float((upper if gravity[vertical] > 0 else lower)[vertical])
    corners = np.array(
        [[ax.get_xlim()[i], ax.get_ylim()[j], ax.get_zlim()[k]] for i, j, k in np.ndindex(2, 2, 2)]
    )
    inches = project(ax, corners)
    ax.set_box_aspect(size, zoom=float((BOX / np.ptp(inches, axis=0)).min()))
    return vertical, float((upper if gravity[vertical] > 0 else lower)[vertical])


def project(ax: Any, points: Array) -> Array:
    """Where points (n, 3) fall in the figure (n, 2), inches."""
    ax.apply_aspect()
    homogeneous = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ ax.get_proj().T
    placed: Array = ax.transData.transform(homogeneous[:, :2] / homogeneous[:, 3:]) / ax.figure.dpi
    return placed


def handles(longest: float) -> list[Line2D]:
    """The legend; longest: the force of the longest arrow, N."""
    force = f"applied force, longest {plain(longest, 3)} N" if longest > 0 else "no force beyond two sigma"
    return [
        Line2D([], [], color=INK, lw=1.6, label="path, its shadow below"),
        Line2D([], [], color=VERMILION, lw=1.2, marker=">", ms=5, label=force),
        Line2D([], [], color=BLUE, lw=0, marker="o", ms=5, label="start"),
        Line2D([], [], color=BLUE, lw=0, marker="s", ms=5, label="end"),
    ]
