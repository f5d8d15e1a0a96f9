"""Figures of a flight flown again under its loads, and of what the air does to it."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from forceid.estimation import Simulated
from forceid.records import AXES, Aero, Array, Estimate
from forceid.report.plots.chart import Chart, over_time
from forceid.report.plots.style import (
    AXIS_COLOR,
    BLUE,
    GRAY,
    STYLE,
    VERMILION,
    draw_band,
    draw_line,
    label,
    panels,
)

SHOWN = (
    ("CL", "Lift", "$C_L$"), ("CD", "Drag", "$C_D$"), ("CY", "Side force", "$C_Y$"),
    ("Cl", "Rolling moment", "$C_l$"), ("Cm", "Pitching moment", "$C_m$"), ("Cn", "Yawing moment", "$C_n$"),
)  # fmt: skip
MIDDLE = (1.0, 99.0)  # percentiles that an axis of coefficients shows: ends of a record are the least sure


@rc_context(STYLE)
def draw_again(estimate: Estimate, found: Simulated) -> Figure:
    """The flight under the loads found (lines) and as it was measured (dots); below, what both are off by."""
    turns = bool(np.isfinite(found.orientation).any())
    figure, axes = panels(2, 1 + turns, (10.0, 5.4), sharex=True)
    time, start = found.time, found.center[0]
    measured = estimate.flown
    assert measured is not None
    sides = [
        (found.center - start, measured.center - start, "Center, from its start", "$x - x_0$ (m)", 1e3, "mm")
    ]
    if turns:
        sign = np.where((found.orientation * measured.orientation).sum(1) < 0, -1.0, 1.0)[:, None]
        q = found.orientation, measured.orientation * sign
        sides.append((*q, "Orientation, quaternion", "$q$", 1e3, "mrad"))
    for column, (flown, seen, title, y, scale, unit) in enumerate(sides):
        top, below = axes[0, column], axes[1, column]
        for k, name in enumerate((*AXES, "w")[: flown.shape[1]]):
            color = AXIS_COLOR.get(name, GRAY)
            top.plot(time, seen[:, k], ".", color=color, ms=2, alpha=0.35)
            draw_line(top, time, flown[:, k], color=color, label=name)
        label(top, title, y, "")
        top.legend(loc="best", ncols=4)
        own = slice(3 * column, 3 * column + 3)
        std = 2 * scale * np.nanmax(found.std[:, own], axis=1)
        draw_band(below, time, -std, std, color=GRAY, alpha=0.25)
        for k, name in enumerate(AXES):
            off = scale * found.off[:, own][:, k]
            below.plot(time, off, ".", color=AXIS_COLOR[name], ms=2, label=name)
        label(below, "Measured less flown again", f"({unit})")
        below.margins(x=0.01)
    figure.align_ylabels()
    return figure


@rc_context(STYLE)
def draw_aero(time: Array, aero: Aero) -> Figure:
    """Coefficients over time with two-sigma bands, over the angle of attack, and angles and speed."""
    figure, axes = panels(3, 3, (10.0, 7.0), sharex=False)
    for ax, (name, title, y) in zip(axes[:2].ravel(), SHOWN, strict=True):
        value, std = aero[name], aero.std[:, aero.name.index(name)]
        draw_band(ax, time, value - 2 * std, value + 2 * std, color=BLUE, alpha=0.2)
        draw_line(ax, time, value, color=BLUE)
        label(ax, title, y)
        fit_axis(ax, value, std)
    alpha, beta = (np.degrees(aero[n]) for n in ("alpha", "beta"))
    draw_line(axes[2, 0], time, alpha, color=BLUE, label="angle of attack")
    draw_line(axes[2, 0], time, beta, color=VERMILION, label="sideslip")
    label(axes[2, 0], "Angles", "(degrees)")
    axes[2, 0].legend(loc="best")
    draw_line(axes[2, 1], time, aero["speed"], color=BLUE)
    label(axes[2, 1], "Speed against the air", "$V$ (m/s)")
    axes[2, 2].plot(alpha, aero["CL"], ".", color=BLUE, ms=3, label="$C_L$")
    axes[2, 2].plot(alpha, aero["CD"], ".", color=VERMILION, ms=3, label="$C_D$")
    label(axes[2, 2], "Lift and drag over the angle", "$C$", "angle of attack (degrees)")
    axes[2, 2].legend(loc="best")
    both = np.concatenate([aero["CL"], aero["CD"]])
    fit_axis(axes[2, 2], both, np.zeros_like(both))
    figure.align_ylabels()
    return figure


def again_chart(found: Simulated) -> Chart:
    """What is measured less what is flown again, with two sigma of the measurement about it."""
    parts = [("Center, measured less flown again", "(mm)", slice(0, 3))]
    if np.isfinite(found.orientation).any():
        parts.append(("Rotation, measured less flown again", "(mrad)", slice(3, 6)))
    return Chart(
        [
            over_time(title, y, found.time, 1e3 * found.off[:, own], 2e3 * found.std[:, own])
            for title, y, own in parts
        ]
    )


def aero_chart(time: Array, aero: Aero) -> Chart:
    """Coefficients with two-sigma bands, angles, and the speed against the air."""
    panels = []
    for name, title, _ in SHOWN:
        value, std = aero[name][:, None], aero.std[:, aero.name.index(name), None]
        panels.append(over_time(title, f"{name} (1)", time, value, 2 * std, (name,)))
    angles = np.degrees(np.stack([aero["alpha"], aero["beta"]], 1))
    panels.append(over_time("Angles", "(degrees)", time, angles, names=("angle of attack", "sideslip")))
    panels.append(over_time("Speed against the air", "(m/s)", time, aero["speed"][:, None], names=("speed",)))
    return Chart(panels)


def fit_axis(ax: object, value: Array, std: Array) -> None:
    """Limits that hold the middle of the values with their bands."""
    seen = np.isfinite(value)
    if seen.any():
        low, high = (
            np.percentile(value[seen] - 2 * std[seen], MIDDLE[0]),
            np.percentile(value[seen] + 2 * std[seen], MIDDLE[1]),
        )
        room = 0.1 * max(high - low, 1e-12)
        ax.set_ylim(low - room, high + room)  # type: ignore[attr-defined]
