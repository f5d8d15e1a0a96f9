"""A figure as it stands on the page: PNG in base64, so that the page refers to no other file, and words."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterable
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

DOTS_PER_INCH = 110  # of a picture ten inches wide: sharp on paper, and seven of them weigh half a megabyte


@dataclass(frozen=True)
class Picture:
    """One figure of the page: its PNG in base64, what it shows, a caption, and its panels in words.

    name: of the chart that a script draws in its place, none where the picture is all there is.
    """

    data: str
    title: str
    caption: str
    alternative: str
    name: str = ""


def pictured(figure: Figure, title: str, caption: str, name: str = "") -> Picture:
    """A figure with its words; PNG keeps the page small however long the record is."""
    data = base64.b64encode(png(figure, DOTS_PER_INCH)).decode("ascii")
    return Picture(data, title, caption, in_words(figure), name)


def png(figure: Figure, dpi: int) -> bytes:
    """The figure as PNG, on white, in as many colors as a byte tells: a third of the size of all."""
    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=dpi, facecolor="white")
    with Image.open(drawn) as image:
        image.convert("RGB").quantize(dither=Image.Dither.NONE).save(small, "PNG", optimize=True)
    return small.getvalue()


def in_words(figure: Figure) -> str:
    """What every panel of a figure shows and between which values, for who does not see it.

    >>> figure = Figure()
    >>> _ = figure.subplots().plot([0.0, 2.0], [-1.0, 3.0])
    >>> figure.axes[0].set(title="Lift", xlabel="time (s)", ylabel="$F_z$ (N)") and in_words(figure)
    'Chart. Lift: F_z (N) from -1 to 3 over time (s) from 0 to 2.'
    """
    panels = [panel(ax) for ax in figure.axes if ax.get_visible()]
    return f"{'Chart' if len(panels) == 1 else f'{len(panels)} charts'}. {'; '.join(panels)}."


def panel(ax: Axes) -> str:
    """One panel in words."""
    title = without_typesetting(ax.get_title(loc="left") or ax.get_title())
    lead = f"{title}: " if title else ""
    if not ax.has_data():
        return lead + (", ".join(without_typesetting(text.get_text()) for text in ax.texts) or "empty")
    if ax.name == "3d":
        limits = ax.get_xlim(), ax.get_ylim(), ax.get_zlim()  # type: ignore[attr-defined]
        names = ax.get_xlabel(), ax.get_ylabel(), ax.get_zlabel()  # type: ignore[attr-defined]
        return lead + ", ".join(axis_range(name, ends) for name, ends in zip(names, limits, strict=True))
    across = f" over {axis_range(ax.get_xlabel(), ax.dataLim.intervalx)}" if ax.get_xlabel() else ""
    return lead + axis_range(ax.get_ylabel() or "values", ax.dataLim.intervaly) + across


def axis_range(name: str, ends: Iterable[float]) -> str:
    """What an axis shows, and between which values."""
    low, high = sorted(ends)
    return f"{without_typesetting(name)} from {low:.3g} to {high:.3g}"


def without_typesetting(text: str) -> str:
    """A label without its typesetting."""
    return re.sub(r"[$\\\\{}]", "", " ".join(text.split()))
