"""The figures over time: wrench, motion, deformation, loads, first moments, joints; and what may hide."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from textwrap import shorten
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from forceid.records import AXES, Array, Estimate, HiddenLoad, Interface, Loads, deviation
from forceid.report.numbers import INTERVAL, mean, resampled, rms, truth_at
from forceid.report.plots.style import (
    AXIS_COLOR,
    CYCLE,
    GRAY,
    PURPLE,
    STYLE,
    draw_axes,
    draw_band,
    draw_columns,
    draw_estimate,
    draw_line,
    explain,
    label,
    panels,
    say,
)

SAME_JOINT = 5e-3  # m: within which a joint of the truth is this one
TITLE_LETTERS = 28  # letters of a name in a title
MOST_LOADS = 8  # loads that are drawn


@rc_context(STYLE)
def draw_wrench(estimate: Estimate, truth: Mapping[str, Array] | None = None, ax: Any = None) -> Figure:
    """Force and moment by axis with two-sigma bands, the plain route, and the truth where there is one.

    ax: three rows of two axes to draw in.
    """
    figure, axes = panels(3, 2, (10.0, 6.4), ax, sharex=True)
    witness = estimate.witness
    plain = {} if witness is None else {"force": witness.force, "moment": witness.moment}
    if estimate.moment_about != "mass_center":
        plain.pop("moment", None)
    about = "the mass center" if estimate.moment_about == "mass_center" else estimate.moment_about
    sides = (
        ("force", "Force", "N", estimate.force, estimate.force_std),
        ("moment", f"Moment about {about}", "N m", estimate.moment, estimate.moment_std),
    )
    known = False
    for column, (name, title, unit, values, std) in enumerate(sides):
        true = truth_at(estimate, truth or {}, name)
        known = known or bool(np.isfinite(true).any())
        head = name[0].upper(), title, unit
        draw_axes(axes[:, column], head, estimate.time, values, 2 * std, true, plain=plain.get(name))
        for edge in () if estimate.impulses is None else estimate.impulses.start[1:]:
            for panel in axes[:, column]:
                panel.axvline(edge, color=GRAY, linewidth=0.6, linestyle=":")
    explain(figure, "two sigma", known, any(np.isfinite(values).any() for values in plain.values()))
    return figure


@rc_context(STYLE)
def draw_motion(estimate: Estimate, ax: Any = None) -> Figure:
    """Translation on the left, rotation on the right. ax: two rows of two axes to draw in."""
    e = estimate
    figure, axes = panels(2, 2, (10.0, 4.4), ax, sharex=True)
    moving = e.center - e.center[np.argmax(np.isfinite(e.center).all(axis=1))]
    histories = (
        (axes[0, 0], moving, "Center, from its start", "$x - x_0$ (m)"),
        (axes[1, 0], e.velocity, "Velocity of the center", "$v$ (m/s)"),
        (axes[0, 1], e.angular_velocity, "Angular velocity", "$\\omega$ (rad/s)"),
        (axes[1, 1], e.angular_momentum, "Angular momentum", "$H$ (kg m²/s)"),
    )
    for panel, values, title, y in histories:
        label(panel, title, y, "")
        draw_columns(panel, e.time, values, AXES, list(AXIS_COLOR.values()))
    for panel in axes[-1]:
        panel.set_xlabel("time (s)")
    figure.align_ylabels()
    return figure


@rc_context(STYLE)
def draw_load(estimate: Estimate, load: str, axes: str = "xyz", ax: Any = None, name: str = "") -> Figure:
    """The `force` or the `moment` along some axes in one panel, with two-sigma bands.

    ax: the axes to draw in; name: put before the axis in the legend, to tell results in one panel apart.
    """
    unit = {"force": "N", "moment": "N m"}[load]
    figure, panel = panels(1, 1, (10.0, 3.2), ax)
    panel = panel[0, 0]
    values, half = getattr(estimate, load), 2 * getattr(estimate, f"{load}_std")
    for axis in axes:
        k = AXES.index(axis)
        color = None if name else AXIS_COLOR[axis]  # of one result by axis, of several one after the other
        draw_line(panel, estimate.time, values[:, k], color=color, label=f"{name} {axis}".strip())
        drawn = panel.lines[-1].get_color()
        draw_band(
            panel, estimate.time, values[:, k] - half[:, k], values[:, k] + half[:, k], color=drawn, alpha=0.2
        )
    label(panel, panel.get_title(loc="left") or load.capitalize(), f"{load} ({unit})")
    panel.legend(ncols=3)
    return figure


def deforms(estimate: Estimate) -> bool:
    """Whether the model has a deformation."""
    return bool(np.nan_to_num(estimate.deformation).any())


@rc_context(STYLE)
def draw_deformation(estimate: Estimate) -> Figure:
    """Deformation, rms over the nodes, in millimeters; beside it what the model says of the shape."""
    figure, axes = panels(1, 2, (10.0, 2.6))
    ax = axes[0, 0]
    label(ax, "Deformation, rms over the nodes", "$u$ (mm)")
    size = 1e3 * np.sqrt(mean(np.moveaxis(np.sum(estimate.deformation**2, axis=-1), 1, 0)))
    draw_line(ax, estimate.time, size, color=PURPLE)
    ax.margins(x=0.01)
    ax.set_ylim(bottom=0)
    draw_shape(estimate, axes[0, 1])
    return figure


def draw_shape(estimate: Estimate, ax: Axes) -> None:
    """What the model says of the shape: stretch minus one, or mode amplitudes."""
    if estimate.stretch is not None:
        label(ax, "Stretch less one", "$U - 1$ (1)")
        pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        strain = np.stack([estimate.stretch[:, i, j] - (i == j) for i, j in pairs], axis=-1)
        draw_columns(ax, estimate.time, strain, [AXES[i] + AXES[j] for i, j in pairs], CYCLE)
        return
    q = np.zeros((len(estimate.time), 0)) if estimate.mode_amplitude is None else estimate.mode_amplitude
    shown = min(q.shape[1], len(CYCLE))
    title = f"Modes 1 to {shown} of {q.shape[1]}" if q.shape[1] > shown else "Mode amplitudes"
    label(ax, title, "$q$ (mm)")
    draw_columns(ax, estimate.time, 1e3 * q[:, :shown], [f"{k + 1}" for k in range(shown)], CYCLE)


@rc_context(STYLE)
def draw_loads(estimate: Estimate, loads: Loads) -> Figure:
    """The applied loads that were asked for, with two-sigma bands; at most eight."""
    asked = tomllib.loads(estimate.settings).get("load", [])
    unit = {load["name"]: "N m" for load in asked if load.get("kind") == "moment"}
    std = deviation(loads.load_cov)
    rows = min(len(loads.name), MOST_LOADS)
    figure, axes = panels(rows, 1, (10.0, 0.9 + 1.5 * rows), sharex=True)
    for k, (ax, name) in enumerate(zip(axes[:, 0], loads.name, strict=False)):
        y, x = f"{name} ({unit.get(name, 'N')})", "time (s)" if k == rows - 1 else ""
        label(ax, "" if k else "Applied loads", y, x)
        draw_estimate(ax, estimate.time, loads.load[:, k], 2 * std[:, k])
    figure.align_ylabels()
    return figure


@rc_context(STYLE)
def draw_first_moments(
    estimate: Estimate, moments: Array, cov: Array, truth: Mapping[str, Array] | None = None
) -> Figure:
    """First moments (time, 3, 3) with two-sigma bands from cov (time, 9, 9); a row: of a force, a column: of
    its arm.
    """
    figure, axes = panels(3, 3, (10.0, 6.4), sharex=True)
    std = deviation(cov).reshape(moments.shape)
    true = truth_at(estimate, truth or {}, "first_moment")
    for i, force in enumerate(AXES):
        for j, arm in enumerate(AXES):
            ax = axes[i, j]
            title = f"Arm along {arm}, world axes" if i == 0 else ""
            label(ax, title, f"$N_{{{force}{arm}}}$ (N m)", "time (s)" if i == 2 else "")
            draw_estimate(ax, estimate.time, moments[:, i, j], 2 * std[:, i, j], true[:, i, j])
    explain(figure, "two sigma", bool(np.isfinite(true).any()))
    return figure


@rc_context(STYLE)
def draw_hidden_load(hidden: HiddenLoad) -> Figure:
    """Amplitude over frequency of a load that half of all records would not show; the band is shaded."""
    figure, axes = panels(1, 2, (10.0, 3.2))
    for first, (ax, name, unit) in enumerate(zip(axes[0], ("Force", "Moment"), ("N", "N m"), strict=True)):
        label(ax, f"{name} that may hide", f"amplitude ({unit})", "frequency (Hz)")
        own = slice(3 * first, 3 * first + 3)
        amplitude, band = hidden.amplitude[:, own], hidden.band[own]
        if not np.isfinite(amplitude).any():
            say(ax, "not identifiable")
            continue
        for values, (axis, color) in zip(amplitude.T, AXIS_COLOR.items(), strict=True):
            ax.plot(hidden.frequency, values, color=color, label=axis)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlim(hidden.frequency[0], hidden.frequency[-1])
        for edge, color in zip(band, AXIS_COLOR.values(), strict=True):
            if edge > 0:
                ax.axvspan(hidden.frequency[0], edge, color=GRAY, alpha=0.12, lw=0)
                ax.axvline(edge, color=color, lw=0.9, ls=":")
        ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, handlelength=1.0, borderaxespad=0)
    return figure


@rc_context(STYLE)
def draw_joint(time: Array, interface: Interface, k: int, truth: Mapping[str, Array] | None = None) -> Figure:
    """Force and moment (about the joint) of joint k by axis with 95 % bands, and the truth where known."""
    name, first, second = (shorten(text, TITLE_LETTERS) for text in (interface.name[k], *interface.parts[k]))
    figure, axes = panels(3, 2, (10.0, 6.4), sharex=True)
    sides = (
        ("F", f"Force of {first} on {second}, world axes", "N", interface.force, interface.force_std),
        ("M", f"Moment about {name}, world axes", "N m", interface.moment, interface.moment_std),
    )
    true = joint_truth(time, interface, k, truth or {})
    for column, (letter, title, unit, values, std) in enumerate(sides):
        shown = values[:, k], INTERVAL * std[:, k], true[:, 3 * column : 3 * column + 3]
        draw_axes(axes[:, column], (letter, title, unit), time, *shown, "not told by the motion")
    explain(figure, "95 %", bool(np.isfinite(true).any()))
    return figure


def joint_truth(time: Array, interface: Interface, k: int, truth: Mapping[str, Array]) -> Array:
    """The true wrench (time, 6) of the joint of the truth that is where joint k is, about joint k; else NaN.

    As the truth has it, of the part before on the part behind.
    """
    nothing = np.full((len(time), 6), np.nan)
    if not {"joint_force", "joint_moment", "joint_point"} <= set(truth):
        return nothing
    clock = truth.get("time", time)
    force, moment, point = (
        resampled(time, clock, truth[f"joint_{what}"]) for what in ("force", "moment", "point")
    )
    apart = np.array([np.linalg.norm(rms(p - interface.point[:, k])) for p in np.moveaxis(point, 1, 0)])
    if not (apart < SAME_JOINT).any():
        return nothing
    j = int(np.nanargmin(apart))
    arm = point[:, j] - interface.point[:, k]
    return np.concatenate([force[:, j], moment[:, j] + np.cross(arm, force[:, j])], 1)
