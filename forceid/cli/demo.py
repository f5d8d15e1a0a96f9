"""forceid demo: the main job on the shipped boomerang, with a report."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.estimate import estimate_file
from forceid.cli.output import summary
from forceid.cli.report import write_result_page


def run(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write to.")] = Path(
        "forceid-demo"
    ),
) -> None:
    """Throw a flexible boomerang, find the forces on it from its markers alone, and compare with the truth.

    Example: forceid demo -o demo
    """
    from forceid.config import load_settings
    from forceid.files import write_motion
    from forceid.scenes import load_recipe, simulate

    output.mkdir(parents=True, exist_ok=True)
    motion, result, page = (output / f"boomerang{end}" for end in (".h5", ".result.h5", ".html"))
    with as_file(files("forceid.scenes") / "flexible_boomerang.toml") as recipe:
        recording = simulate(load_recipe(recipe))
    write_motion(motion, recording)
    samples, markers = len(recording.motion.time), len(recording.body.node)
    print(f"scene    {recording.title}: {samples} samples, {markers} markers")
    record = estimate_file(motion, result, load_settings())
    print(summary(record))
    write_result_page(result, page)
    print(f"report   open {page} in a browser")
    if record["verdict"] == "refused":
        raise typer.Exit(1)
