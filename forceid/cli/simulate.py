"""forceid simulate: a motion with known loads, from a scene, or from the loads that a result has found."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.boundary.terminal import note
from forceid.cli.estimate import Force
from forceid.errors import ConfigError


def run(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE.toml", help="Recipe of a scene, or a result, RESULT.h5.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.h5", help="Motion file to write.")],
    seed: Annotated[
        int | None, typer.Option(metavar="N", help="Seed of the noise, in place of that of SCENE.")
    ] = None,
    force: Force = False,
) -> None:
    """Simulate SCENE and write the motion as measured, with the truth beside it.

    Of a result: the motion that its force and moment produce, from the start that suits what was measured
    best, and how far both are apart.

    Example: forceid simulate scene.toml -o toss.h5 --seed 7
    """
    from forceid.files import check_output, is_result, write_motion
    from forceid.scenes import load_recipe, simulate

    check_output(output, "motion", [scene], force)
    if is_result(scene):
        if seed is not None:
            raise ConfigError("draws no noise of a result", "--seed", "leave it out")
        simulate_result(scene, output)
        return
    recording = simulate(load_recipe(scene, seed))
    write_motion(output, recording)
    note(f"{output}: {len(recording.motion.time)} samples, {recording.title}")


def simulate_result(result: Path, output: Path) -> None:
    """Fly the loads of a result, write that motion, and say how far it is from the measured one."""
    from forceid.estimation import fly_again, recording_of
    from forceid.files import read_result, read_title, write_motion

    estimate = read_result(result)
    found = fly_again(estimate, str(result))
    title = f"simulated from {read_title(result) or result.name}"
    write_motion(output, recording_of(found, estimate, title))
    center, turn = found.rms
    off = f"{1e3 * center:.3g} mm" + (f" and {1e3 * turn:.3g} mrad" if turn == turn else "")
    note(f"{output}: {len(found.time)} samples, {title}")
    note(f"off by {off} rms from the measured motion, {found.misfit:.2f} times its noise")
