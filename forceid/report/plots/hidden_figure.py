"""The figure of what an estimate leaves out: how large an oscillating load has to be to show."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from forceid.records import HiddenLoad
from forceid.report.plots.style import AXIS_COLOR, GRAY, STYLE, label, panels, say


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
