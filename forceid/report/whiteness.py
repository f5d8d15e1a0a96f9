"""Are the innovations white and of unit variance: the test a model must pass before its sigma is believed."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from forceid.records import Array, Estimate
from forceid.report.plots.style import (
    BINS,
    BLUE,
    DASHED,
    GRAY,
    INK,
    STYLE,
    VERMILION,
    draw_line,
    label,
    panels,
)

LAGS_DRAWN = 40
CHANNELS_DRAWN = 12
LARGE_POINTS = 2000  # points that still read when they are large
LOGARITHMIC = 10  # sigma; beyond, scales are logarithmic


@rc_context(STYLE)
def draw_innovations(estimate: Estimate) -> Figure:
    """Whitened innovations: over time, against the unit normal, their autocorrelation, and the NIS."""
    figure, axes = panels(2, 2, (10.0, 4.8), width_ratios=(1.7, 1.0))
    series, histogram, squares, lags = axes[0, 0], axes[0, 1], axes[1, 0], axes[1, 1]
    label(series, "Whitened innovations", "innovation (sigma)")
    label(histogram, "Against the unit normal", "density (1)", "innovation (sigma)")
    label(squares, "Normalized innovation squared, per degree of freedom", "NIS (1)", "time (s)")
    label(lags, "Autocorrelation, each channel", "correlation (1)", "lag (samples)")
    white = channels(estimate.innovation)
    step = max(1, len(white) // BINS)
    size = 2.0 if white[::step].size > LARGE_POINTS else 4.5
    series.plot(estimate.time[::step], white[::step], ".", ms=size, alpha=0.5, color=BLUE, mew=0)
    for level in (-2, 2):
        series.axhline(level, color=VERMILION, lw=0.9, ls=DASHED)
    reach = max(4.5, 1.05 * float(np.nanmax(np.abs(white[::step]))))
    if reach > LOGARITHMIC:
        series.set_yscale("symlog", linthresh=4.0, linscale=2.0)
        series.set_yticks([-LOGARITHMIC, -2, 0, 2, LOGARITHMIC], ["−10", "−2", "0", "2", "10"])
        series.minorticks_off()
    series.set_ylim(-reach, reach)
    values = white[np.isfinite(white)]
    edges = np.linspace(-5, 5, 51)
    inside = np.clip(values, -5, 5)
    histogram.hist(inside, edges, density=True, color=BLUE, alpha=0.35, label="innovations")
    x = np.linspace(-5, 5, 201)
    histogram.plot(x, np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), color=INK, lw=1.2, label="unit normal")
    histogram.set_ylim(top=1.3 * max(0.4, histogram.get_ylim()[1] / 1.05))
    histogram.legend(loc="upper right", handlelength=1.2, borderaxespad=0.1)
    draw_line(squares, estimate.time, estimate.nis, color=BLUE, lw=0.9)
    squares.axhline(1, color=INK, lw=0.9, ls=DASHED)
    if np.nanmax(estimate.nis) > LOGARITHMIC**2:
        squares.set_yscale("log")
        squares.set_ylim(bottom=1e-3)
    else:
        squares.set_ylim(bottom=0)
    for ax in (series, squares):
        ax.margins(x=0.01)
    for column in white.T:
        rho = correlogram(column)
        lags.plot(np.arange(1, len(rho) + 1), rho, ".", ms=4, alpha=0.6, color=BLUE, mew=0)
    bound = 2 / np.sqrt(max(1, int(np.isfinite(white).sum(axis=0).min())))
    for level in (-bound, bound):
        lags.axhline(level, color=VERMILION, lw=0.9, ls=DASHED)
    lags.axhline(0, color=GRAY, lw=0.8)
    low, high = lags.get_ylim()
    lags.set_ylim(min(low, -2.5 * bound), max(high, 3.6 * bound))
    lags.legend(
        handles=[Line2D([], [], color=VERMILION, lw=0.9, ls=DASHED, label="two sigma of white noise")],
        loc="upper right",
        borderaxespad=0.1,
    )
    return figure


def channels(innovation: Array) -> Array:
    """At most twelve channels (time, channel), evenly chosen from those that hold anything."""
    held = innovation[:, np.isfinite(innovation).any(axis=0)]
    return held[:, :: max(1, -(-held.shape[1] // CHANNELS_DRAWN))]


def correlogram(values: Array) -> Array:
    """Correlation of values (time,) with themselves at lags 1, 2, ...; gaps count as nothing."""
    x = np.nan_to_num(values - np.nanmean(values))
    rho: Array = np.array([x[k:] @ x[:-k] for k in range(1, min(LAGS_DRAWN, len(x) - 1) + 1)]) / max(
        x @ x, 1e-300
    )
    return rho
