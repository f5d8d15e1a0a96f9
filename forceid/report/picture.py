"""A figure as it stands on the page: PNG in base64, so that the page refers to no other file."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """One figure of the page: its PNG in base64, what it shows, and a caption."""

    data: str
    title: str
    caption: str


def embed(figure: Figure) -> str:
    """The figure as PNG in base64; PNG keeps the page small however long the record is."""
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=160, facecolor="white")
    return base64.b64encode(png.getvalue()).decode("ascii")
