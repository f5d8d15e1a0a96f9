"""The CPU time of an estimate by stage, as a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TextIO

from forceid.timing import STAGES


def show_stages(timing: Mapping[str, float], file: TextIO | None = None) -> None:
    """Print seconds of CPU and their share by stage, in the order in which the stages are met."""
    from rich.console import Console
    from rich.table import Table

    total, words = sum(timing.values()), {str(name): what for name, what in STAGES.items()}
    table = Table(box=None)
    table.add_column("stage")
    table.add_column("CPU s", justify="right")
    table.add_column("share", justify="right")
    table.add_column("")
    for name, seconds in timing.items():
        share = 100 * seconds / max(total, 1e-9)
        table.add_row(name.replace("_", " "), f"{seconds:.3f}", f"{share:.0f} %", words.get(name, ""))
    table.add_row("total", f"{total:.3f}", "100 %", "")
    Console(file=file, highlight=False).print(table)
