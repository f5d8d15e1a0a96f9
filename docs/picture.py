"""Pictures of the first page and of the gallery. `python docs/picture.py` makes them again."""

import base64
from io import BytesIO
from pathlib import Path

import jupytext
import numpy as np
from matplotlib.figure import Figure
from nbclient import NotebookClient
from PIL import Image

import forceid

HERE = Path(__file__).parent
BLUE, INK = "#0072B2", "#222222"
WIDTH = 480  # pixels of a picture of the gallery
FIRST = (
    "tutorial_free_flight",
    "tutorial_people",
    "tutorial_structures",
)  # whose first picture shows the force


def main() -> None:
    """The force on the boomerang, and a picture of every notebook."""
    boomerang()
    (HERE / "gallery").mkdir(exist_ok=True)
    for path in sorted((HERE.parent / "notebooks").glob("*.py")):
        picture_of(path).save(HERE / "gallery" / f"{path.stem}.png", optimize=True)


def boomerang() -> None:
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


def picture_of(path: Path) -> Image.Image:
    """The last picture that a notebook shows, of some the first, as wide as the gallery has it."""
    notebook = jupytext.read(path, fmt="py:percent")
    NotebookClient(notebook, resources={"metadata": {"path": str(path.parent)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    shown = [o["data"]["image/png"] for o in outputs if "image/png" in o.get("data", {})]
    picture = Image.open(BytesIO(base64.b64decode(shown[0 if path.stem in FIRST else -1]))).convert("RGB")
    return picture.resize((WIDTH, round(WIDTH * picture.height / picture.width)), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    main()
