"""The figure of the nine first moments of force over time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from forceid.records import Array, Estimate
from forceid.report.numbers import truth_at
from forceid.report.plots.bands import draw_estimate, explain
from forceid.report.plots.style import AXES, STYLE, label, panels


@rc_context(STYLE)
def draw_first_moments(
    estimate: Estimate, moments: Array, cov: Array, truth: Mapping[str, Array] | None = None
) -> Figure:
    """First moments (time, 3, 3) with two-sigma bands from cov (time, 9, 9); a row: of a force, a column: of
    its arm.
    """
    figure, axes = panels(3, 3, (10.0, 6.4), sharex=True)
    std = np.sqrt(np.diagonal(cov, axis1=1, axis2=2)).reshape(moments.shape)
    true = truth_at(estimate, truth or {}, "first_moment")
    for i, force in enumerate(AXES):
        for j, arm in enumerate(AXES):
            ax = axes[i, j]
            title = f"Arm along {arm}, world axes" if i == 0 else ""
            label(ax, title, f"$N_{{{force}{arm}}}$ (N m)", "time (s)" if i == 2 else "")
            draw_estimate(ax, estimate.time, moments[:, i, j], 2 * std[:, i, j], true[:, i, j])
    explain(figure, "two sigma", bool(np.isfinite(true).any()))
    return figure
