"""The picture of the first page: the force on a thrown boomerang. `python docs/picture.py` makes it again."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import forceid

HERE = Path(__file__).parent
BLUE, INK = "#0072B2", "#222222"


def main() -> None:
    """Estimate the shipped flight, and draw the force beside the truth that the estimator never saw."""
    flight = forceid.open_motion(HERE.parent / "data" / "synthetic" / "flexible_boomerang_5_markers.h5")
    estimate, truth = forceid.estimate(flight)["estimate"], flight["truth"]
    figure = Figure(figsize=(8, 4.6), layout="constrained", dpi=120)
    for axes, name in zip(figure.subplots(3, 1, sharex=True), "xyz", strict=True):
        force, std = (estimate[v].sel(axis=name).values for v in ("force", "force_std"))
        axes.fill_between(estimate.time, force - 2 * std, force + 2 * std, color=BLUE, alpha=0.3, lw=0)
        axes.plot(estimate.time, force, color=BLUE, label="found, with two standard deviations")
        axes.plot(truth.time, truth.force.sel(axis=name), "--", color=INK, lw=0.9, label="truth, never seen")
        axes.set_ylabel(f"$F_{name}$ (N)")
        axes.spines[["top", "right"]].set_visible(False)
        low, high = np.nanmin(truth.force.sel(axis=name)), np.nanmax(truth.force.sel(axis=name))
        axes.set_ylim(low - 0.3 * (high - low), high + 0.3 * (high - low))
    axes.set_xlabel("time (s)")
    figure.axes[0].legend(loc="upper right", ncols=2, frameon=False, fontsize=9)
    figure.suptitle("Air on a boomerang that bends and spins ten times a second", fontsize=11)
    figure.savefig(HERE / "boomerang_force.png", metadata={"Software": None})


if __name__ == "__main__":
    main()
