"""The CPU time of an estimate by stage, as a table."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import TextIO


def show_stages(timing: Mapping[str, float], file: TextIO | None = None) -> None:
    """Print seconds of CPU and their share by stage, in the order in which the stages are met."""
    from rich.console import Console
    from rich.table import Column, Table

    words = tomllib.loads((files("forceid.report") / "stages.toml").read_text("utf-8"))
    total = sum(timing.values())
    numbers = Column("CPU s", justify="right"), Column("share", justify="right")
    table = Table("stage", *numbers, "", box=None)
    for name, seconds in timing.items():
        share = 100 * seconds / max(total, 1e-9)
        table.add_row(name.replace("_", " "), f"{seconds:.3f}", f"{share:.0f} %", words.get(name, ""))
    table.add_row("total", f"{total:.3f}", "100 %", "")
    Console(file=file, highlight=False).print(table)
