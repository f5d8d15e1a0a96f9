"""Files of results: pages, numbers and pictures, each whole or not there at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from forceid.files.atomic import atomic


def written(folder: Path, name: str, text: str) -> Path:
    """A text by its name in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with atomic(folder / name) as partial:
        partial.write_text(text, encoding="utf-8")
    return folder / name


def pictured(folder: Path, name: str, figure: Any) -> Path:
    """A figure as NAME.png in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with atomic(folder / f"{name}.png") as partial:
        figure.savefig(partial, format="png", dpi=160, facecolor="white")
    return folder / f"{name}.png"
