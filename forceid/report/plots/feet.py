"""What the ground gives each foot: a figure and its chart."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from forceid.records import Array, Feet, deviation
from forceid.report.numbers import INTERVAL
from forceid.report.plots.chart import Chart, over_time
from forceid.report.plots.style import STYLE, draw_axes, explain, panels


@rc_context(STYLE)
def draw_feet(time: Array, feet: Feet) -> Figure:
    """The force on each foot by axis with 95 % bands, a column a foot."""
    figure, axes = panels(3, len(feet.name), (10.0, 6.4), sharex=True, sharey="row")
    std, unknown = deviation(feet.force_cov), np.full((len(time), 3), np.nan)
    for k, name in enumerate(feet.name):
        head = "F", f"Force of the ground on {name}, world axes", "N"
        draw_axes(axes[:, k], head, time, feet.force[:, k], INTERVAL * std[:, k], unknown)
    explain(figure, "95 %", known=False)
    return figure


def feet_chart(time: Array, feet: Feet) -> Chart:
    """The same, a panel a foot."""
    std = INTERVAL * deviation(feet.force_cov)
    each = enumerate(feet.name)
    return Chart([over_time(name, "force (N)", time, feet.force[:, k], std[:, k]) for k, name in each])
