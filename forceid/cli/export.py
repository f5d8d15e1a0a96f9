"""forceid export: a result in the format of another program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.boundary.terminal import tell
from forceid.cli.estimate import Force, choice, written
from forceid.errors import ConfigError

FORMAT_WORDS = "mot, sto, csv, parquet, mat or c3d; by the suffix of OUT if not given."


def run(
    file: Annotated[Path, typer.Argument(metavar="RESULT.h5", help="Result file of forceid estimate.")],
    format: Annotated[
        str | None, choice("FORMAT", FORMAT_WORDS, "forceid.files", "FORMATS", flags=("-f", "--format"))
    ] = None,
    output: Annotated[
        Path | None, written("OUT", "File to write; RESULT.FORMAT beside it if not given.")
    ] = None,
    force: Force = False,
) -> None:
    """Write RESULT.h5 for another program: OpenSim (mot, sto), tables (csv, parquet), MATLAB (mat), C3D.

    A file that is there is replaced only by --force. All digits are kept.

    Example: forceid export toss.result.h5 -f csv
    """
    from forceid.files import FORMATS, check_output, export, read_result

    kind = format or (output.suffix.removeprefix(".") if output else "")
    if kind not in FORMATS:
        what = f"is no format, expected one of {', '.join(FORMATS)}"
        raise ConfigError(what if kind else "is missing, expected a format", kind or "-f", "as -f csv")
    output = output or file.with_name(f"{file.name.removesuffix('.h5')}.{kind}")
    check_output(output, "export", [file], force)
    export(output, read_result(file), kind)
    tell(str(output))
