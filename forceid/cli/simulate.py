"""forceid simulate: a motion file with known loads, made from a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.boundary.terminal import note
from forceid.cli.estimate import Force


def run(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="Recipe of the scene, a TOML file.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.h5", help="Motion file to write.")],
    seed: Annotated[
        int | None, typer.Option(metavar="N", help="Seed of the noise, in place of that of SCENE.")
    ] = None,
    force: Force = False,
) -> None:
    """Simulate SCENE and write the motion as measured, with the truth beside it.

    Example: forceid simulate scene.toml -o toss.h5 --seed 7
    """
    from forceid.files import check_output, write_motion
    from forceid.scenes import load_recipe, simulate

    check_output(output, "motion", [scene], force)
    recording = simulate(load_recipe(scene, seed))
    write_motion(output, recording)
    note(f"{output}: {len(recording.motion.time)} samples, {recording.title}")
