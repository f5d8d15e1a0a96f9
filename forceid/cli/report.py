"""forceid report: one self-contained page of a result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.boundary.terminal import tell
from forceid.cli.estimate import Force, written


def run(
    file: Annotated[Path, typer.Argument(metavar="OUT.h5", help="Result file of forceid estimate.")],
    output: Annotated[
        Path | None, written("PAGE.html", "Page to write; OUT.html beside the result if not given.")
    ] = None,
    force: Force = False,
) -> None:
    """Write OUT.h5 as one HTML page with figures, numbers, verdict and settings inside.

    Example: forceid report toss.result.h5 -o toss.html
    """
    page = output or file.with_suffix(".html")
    from forceid.files import check_output

    check_output(page, "page", [file], force)
    write_result_page(file, page)
    tell(str(page))


def write_result_page(result: Path, page: Path) -> None:
    """Read the result and write its page."""
    from forceid.files import read_result, read_title, read_truth
    from forceid.files.stored.atomic import write_whole
    from forceid.report import render_page

    title = read_title(result) or result.name.removesuffix(".result.h5")
    write_whole(page, render_page(read_result(result), read_truth(result), title, result.name))
