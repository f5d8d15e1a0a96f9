"""forceid open: the page of a result in the browser."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.boundary.terminal import note, tell
from forceid.cli.estimate import Force


def run(
    file: Annotated[Path, typer.Argument(metavar="OUT.h5", help="Result file of forceid estimate.")],
    force: Force = False,
) -> None:
    """Open the page of OUT.h5 in the browser; it is written beside the result if it is not there or is old.

    Where there is no browser, the path of the page is printed.

    Example: forceid open toss.result.h5
    """
    from forceid.cli.report import write_result_page
    from forceid.files import check_output, stamp

    page = file.with_suffix(".html")
    stamp(file)
    if not page.exists() or page.stat().st_mtime < file.stat().st_mtime:
        check_output(page, "page", [file], force)
        write_result_page(file, page)
    try:
        opened = webbrowser.open(page.resolve().as_uri())
    except webbrowser.Error:
        opened = False
    if opened:
        note(f"{page}: opened")
    else:
        tell(f"{page}: no browser here; open it in one")
