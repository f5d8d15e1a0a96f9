"""forceid report: one self-contained page of a result, or of several beside each other."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.boundary.terminal import note
from forceid.cli.estimate import Force, written


def run(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="OUT.h5...", help="Result file of forceid estimate; several are compared."),
    ],
    output: Annotated[
        Path | None,
        written("PAGE.html", "Page to write; if not given OUT.html or comparison.html beside the result."),
    ] = None,
    force: Force = False,
) -> None:
    """Write OUT.h5 as one HTML page: verdict, curves, numbers and what to do; or several on one page.

    The page needs no network and no other file. It zooms, and shows the values under the pointer.

    Example: forceid report toss.result.h5 -o toss.html

    Example: forceid report smoother.result.h5 savgol.result.h5 -o both.html
    """
    page = output or (
        files[0].with_suffix(".html") if len(files) == 1 else files[0].parent / "comparison.html"
    )
    from forceid.files import check_output

    check_output(page, "page", files, force)
    if len(files) == 1:
        write_result_page(files[0], page)
    else:
        write_comparison(files, page)
    note(str(page))


def write_result_page(result: Path, page: Path) -> None:
    """Read the result and write its page."""
    from forceid.files import read_result, read_title, read_truth
    from forceid.files.stored.atomic import write_whole
    from forceid.report import render_page

    title = read_title(result) or result.name.removesuffix(".result.h5")
    write_whole(page, render_page(read_result(result), read_truth(result), title, result.name))


def write_comparison(results: Sequence[Path], page: Path) -> None:
    """Read the results and write one page of all."""
    from forceid.files import read_result
    from forceid.files.stored.atomic import write_whole
    from forceid.report import Named, render_comparison

    named = [Named(name, read_result(path)) for name, path in zip(names(results), results, strict=True)]
    write_whole(page, render_comparison(named))


def names(paths: Sequence[Path]) -> list[str]:
    """What tells the files apart: their names, with folders where two are alike, with numbers in the end.

    >>> names([Path("a.result.h5"), Path("b.h5")]), names([Path("x/a.h5"), Path("y/a.h5")])
    (['a', 'b'], ['x/a', 'y/a'])
    """
    short = [path.name.removesuffix(".h5").removesuffix(".result") for path in paths]
    if len(set(short)) < len(short):
        short = [os.path.join(path.parent, name) for path, name in zip(paths, short, strict=True)]
    again = len(set(short)) < len(short)
    return [f"{name} ({k + 1})" if again else name for k, name in enumerate(short)]
