"""forceid demo: the main job on the shipped boomerang, with a report."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.boundary.output import summary
from forceid.cli.boundary.terminal import note
from forceid.cli.estimate import Force, estimate_file
from forceid.cli.report import write_result_page
from forceid.errors import ConfigError


def run(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write to.")] = Path(
        "forceid-demo"
    ),
    force: Force = False,
) -> None:
    """Throw a flexible boomerang, find the forces on it from its markers alone, and compare with the truth.

    Example: forceid demo -o demo
    """
    from forceid.config import load_settings
    from forceid.files import check_output, write_motion
    from forceid.scenes import load_recipe, simulate

    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise ConfigError(f"cannot be made ({e.strerror})", str(output), "give another folder with -o") from e
    motion, result, page = (output / f"boomerang{end}" for end in (".h5", ".result.h5", ".html"))
    for path, kind in ((motion, "motion"), (result, "result"), (page, "page")):
        check_output(path, kind, force=force)
    with as_file(files("forceid.scenes") / "flexible_boomerang.toml") as recipe:
        recording = simulate(load_recipe(recipe))
    write_motion(motion, recording)
    samples, markers = len(recording.motion.time), len(recording.body.node)
    note(f"scene    {recording.title}: {samples} samples, {markers} markers")
    record = estimate_file(motion, result, load_settings(), force=force)
    note(summary(record))
    write_result_page(result, page)
    note(f"report   open {page} in a browser")
    if record["verdict"] == "refused":
        raise typer.Exit(1)
