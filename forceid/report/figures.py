"""The figures of a result: path with forces, wrench, mean motion against deformation, loads."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from forceid.records import Array, Estimate, Loads
from forceid.report.numbers import mean, truth_at
from forceid.report.style import (
    AXIS_COLOR,
    BLUE,
    CYCLE,
    DASHED,
    INK,
    PURPLE,
    STYLE,
    VERMILION,
    bins,
    draw_band,
    draw_columns,
    draw_line,
    label,
    panels,
    say,
)

AXES = ("x", "y", "z")
ARROWS = 24


@rc_context(STYLE)
def draw_path(estimate: Estimate) -> Figure:
    """The path of the center in world axes at equal scale, with arrows for the applied force."""
    seen = np.isfinite(estimate.center).all(axis=1)
    if not seen.any():
        figure, axes = panels(1, 1, (9.0, 2.0))
        label(axes[0, 0], "Path of the mass center", "z (m)", "x (m)")
        say(axes[0, 0], "not identifiable")
        return figure
    path = estimate.center[bins(estimate.time)]
    low, high = estimate.center[seen].min(axis=0), estimate.center[seen].max(axis=0)
    span = max(float((high - low).max()), 1e-9)
    size = np.maximum(high - low, 0.3 * span) * 1.15  # a thin box would squeeze its tick labels together
    where = np.flatnonzero(seen & np.isfinite(estimate.force).all(axis=1))
    where = where[np.linspace(0, len(where) - 1, min(ARROWS, len(where))).astype(int)]
    length = np.linalg.norm(estimate.force[where], axis=1)
    longest = float(length.max(initial=0.0))

    figure = Figure(figsize=(10.0, 5.4))
    ax: Any = figure.add_axes((0.0, 0.02, 1.0, 0.94), projection="3d", computed_zorder=False)
    ax.plot(*path.T, color=INK, lw=1.6, zorder=2)
    shadow = path.copy()
    shadow[:, 2] = (low[2] + high[2] - size[2]) / 2
    ax.plot(*shadow.T, color="#C9CCD2", lw=1.2, zorder=1)
    if longest > 0:
        arrows = estimate.force[where] * (0.22 * span / longest)
        ax.quiver(
            *estimate.center[where].T,
            *arrows.T,
            color=VERMILION,
            lw=1.2,
            arrow_length_ratio=0.25,
            zorder=3,
        )
    first, last = path[np.isfinite(path).all(axis=1)][[0, -1]]
    ax.scatter(*first, color=BLUE, s=36, depthshade=False, zorder=4)
    ax.scatter(*last, color=BLUE, s=36, marker="s", depthshade=False, zorder=4)
    for name, lo, hi, width in zip(AXES, low, high, size, strict=True):
        middle = (lo + hi) / 2
        getattr(ax, f"set_{name}lim")(middle - width / 2, middle + width / 2)
        axis = getattr(ax, f"{name}axis")
        axis.set_major_locator(MaxNLocator(max(2, round(6 * width / size.max())), min_n_ticks=2))
        axis.set_pane_color("#F7F8FA")
        axis.line.set_color("#B8BCC4")
        getattr(ax, f"set_{name}label")(f"{name} (m)", labelpad=4)
    ax.set_box_aspect(size, zoom=1.3)
    ax.view_init(elev=24, azim=-58)
    figure.text(0.02, 0.955, "Path of the mass center, world axes at equal scale", fontsize=10, weight="bold")
    handles = [
        Line2D([], [], color=INK, lw=1.6, label="path, its shadow below"),
        Line2D(
            [],
            [],
            color=VERMILION,
            lw=1.2,
            marker=">",
            ms=5,
            label=f"applied force, longest {longest:.3g} N",
        ),
        Line2D([], [], color=BLUE, lw=0, marker="o", ms=5, label="start"),
        Line2D([], [], color=BLUE, lw=0, marker="s", ms=5, label="end"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=4)
    return figure


@rc_context(STYLE)
def draw_wrench(estimate: Estimate, truth: Mapping[str, Array] | None = None) -> Figure:
    """Force and moment by axis with two-sigma bands, and the truth where there is one."""
    figure, axes = panels(3, 2, (10.0, 6.4), sharex=True)
    sides = (
        ("force", "Force", "N", estimate.force, estimate.force_std),
        ("moment", f"Moment about {about(estimate)}", "N m", estimate.moment, estimate.moment_std),
    )
    known = False
    for column, (name, title, unit, values, std) in enumerate(sides):
        true = truth_at(estimate, truth or {}, name)
        for row, axis in enumerate(AXES):
            ax = axes[row, column]
            label(
                ax,
                title if row == 0 else "",
                f"{name[0].upper()}$_{axis}$ ({unit})",
                "time (s)" if row == 2 else "",
            )
            draw_estimate(ax, estimate.time, values[:, row], std[:, row])
            if np.isfinite(true[:, row]).any():
                known = True
                draw_line(ax, estimate.time, true[:, row], color=INK, lw=1.0, ls=DASHED)
    handles = [
        Line2D([], [], color=BLUE, label="estimate"),
        Patch(color=BLUE, alpha=0.22, lw=0, label="two sigma"),
    ]
    if known:
        handles.append(Line2D([], [], color=INK, lw=1.0, ls=DASHED, label="truth"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    figure.align_ylabels()
    return figure


def draw_estimate(ax: Axes, time: Array, values: Array, std: Array) -> None:
    """Values (time,) over their two-sigma band; a remark when nothing is known."""
    if not np.isfinite(values).any():
        say(ax, "not identifiable")
        return
    draw_band(ax, time, values - 2 * std, values + 2 * std, color=BLUE, alpha=0.22)
    draw_line(ax, time, values, color=BLUE)
    ax.margins(x=0.01)


@rc_context(STYLE)
def draw_motion(estimate: Estimate) -> Figure:
    """Mean motion on the left, deformation and angular momentum on the right."""
    e = estimate
    figure, axes = panels(3, 2, (10.0, 6.4), sharex=True)
    moving = e.center - e.center[np.argmax(np.isfinite(e.center).all(axis=1))]
    histories = (
        (axes[0, 0], moving, "Center, from its start", "$x - x_0$ (m)"),
        (axes[1, 0], e.velocity, "Velocity of the center", "$v$ (m/s)"),
        (axes[2, 0], e.angular_velocity, "Angular velocity", "$\\omega$ (rad/s)"),
        (axes[2, 1], e.angular_momentum, "Angular momentum", "$H$ (kg m²/s)"),
    )
    for ax, values, title, y in histories:
        label(ax, title, y, "time (s)" if ax in axes[2] else "")
        draw_columns(ax, e.time, values, AXES, list(AXIS_COLOR.values()))
    draw_deformation(e, axes[0, 1])
    draw_shape(e, axes[1, 1])
    figure.align_ylabels()
    return figure


def draw_deformation(estimate: Estimate, ax: Axes) -> None:
    """Deformation, rms over the nodes, in millimeters."""
    label(ax, "Deformation, rms over the nodes", "$u$ (mm)", "")
    if not np.isfinite(estimate.deformation).any():
        say(ax, "not measured: no nodes seen")
        return
    size = 1e3 * np.sqrt(mean(np.moveaxis(np.sum(estimate.deformation**2, axis=-1), 1, 0)))
    draw_line(ax, estimate.time, size, color=PURPLE)
    ax.set_ylim(bottom=0)


def draw_shape(estimate: Estimate, ax: Axes) -> None:
    """What the model says of the shape: mode amplitudes, or stretch minus one, or nothing."""
    if estimate.mode_amplitude is not None and estimate.mode_amplitude.size:
        label(ax, "Mode amplitudes", "$q$ (mm)", "")
        count = min(estimate.mode_amplitude.shape[1], len(CYCLE))
        names = [f"{k + 1}" for k in range(count)]
        draw_columns(ax, estimate.time, 1e3 * estimate.mode_amplitude[:, :count], names, CYCLE)
    elif estimate.stretch is not None:
        label(ax, "Stretch less one, body axes", "$U - 1$ (1)", "")
        pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        strain = np.stack([estimate.stretch[:, i, j] - (i == j) for i, j in pairs], axis=-1)
        draw_columns(ax, estimate.time, strain, [AXES[i] + AXES[j] for i, j in pairs], CYCLE)
    else:
        label(ax, "Mode amplitudes", "$q$ (mm)", "")
        say(ax, "the model is rigid: no modes")


@rc_context(STYLE)
def draw_loads(estimate: Estimate, loads: Loads) -> Figure:
    """The applied loads that were asked for, with two-sigma bands; at most eight."""
    asked = tomllib.loads(estimate.settings).get("load", [])
    unit = {load["name"]: "N m" for load in asked if load.get("kind") == "moment"}
    std = np.sqrt(np.diagonal(loads.load_cov, axis1=-2, axis2=-1))
    rows = min(len(loads.name), 8)
    figure, axes = panels(rows, 1, (10.0, 0.9 + 1.5 * rows), sharex=True)
    for k, ax in enumerate(axes[:, 0]):
        name, values = loads.name[k], loads.load[:, k]
        last = k == rows - 1
        label(
            ax,
            "Applied loads" if k == 0 else "",
            f"{name} ({unit.get(name, 'N')})",
            "time (s)" if last else "",
        )
        draw_estimate(ax, estimate.time, values, std[:, k])
    figure.align_ylabels()
    return figure


def about(estimate: Estimate) -> str:
    """The point of the moment in words.

    >>> from types import SimpleNamespace
    >>> about(SimpleNamespace(moment_about="mass_center"))
    'the mass center'
    """
    return "the mass center" if estimate.moment_about == "mass_center" else estimate.moment_about
