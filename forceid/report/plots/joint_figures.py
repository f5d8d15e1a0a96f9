"""The figure of one joint over time: the force and the moment that pass through it, and the truth."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import shorten

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from forceid.records import Array, Interface
from forceid.report.numbers import INTERVAL, resampled, rms
from forceid.report.plots.bands import draw_axes, explain
from forceid.report.plots.style import STYLE, panels

SAME_JOINT = 5e-3  # m: within which a joint of the truth is this one
TITLE_LETTERS = 28  # letters of a name in a title


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
