"""forceid import: measured tables, captures and recordings to motion files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.boundary.terminal import tell
from forceid.cli.estimate import Config, Force


def run(
    sources: Annotated[
        list[Path],
        typer.Argument(metavar="SOURCE...", help="csv, trc with mot, c3d, mat, uff, tdms files."),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.h5", help="Motion file to write.")],
    config: Config = None,
    force: Force = False,
) -> None:
    """Turn SOURCES into a motion file; several recordings become FILE-NAME.h5, one each.

    CONFIG says what no source does: mass, gravity and, for tables, what they hold. The shortest for csv:

    \b
      import.gravity = [0.0, 0.0, -9.81]
      import.csv.time = "t"
      import.csv.position.tip = ["tip x", "tip y", "tip z"]
      import.csv.position.hub = ["hub x", "hub y", "hub z"]
      import.body.mass = { tip = 0.02, hub = 0.05 }

    For mat, uff and tdms the table is import.channels in place of import.csv:

    \b
      mat   position = "trial.markers.{name}"    fields of a struct, time by 3
            time = "trial.t"                     or rate = 1000.0
            units.position = "mm"                MATLAB keeps no units
      uff   displacement = "displacement.{name}{axis}"    node and direction
            specific_force = "acceleration.{name}{axis}"
      tdms  position = "Markers/{name}_{axis}"   group, then channel

    Example: forceid import throw.csv -o throw.h5 -c throw.toml

    Example: forceid import run7.tdms -o run7.h5 -c lab.toml
    """  # noqa: D301 (the backspace keeps the lines of the example apart)
    from forceid.files import check_output, import_sources, load_import_settings, write_motion

    inputs = [*sources, *([config] if config else [])]
    check_output(output, "motion", inputs, force)
    recordings, paths = import_sources(sources, load_import_settings(config)), [output]
    if len(recordings) > 1:
        names = [name.removeprefix(f"{output.stem}-") for name, _ in recordings]
        paths = [output.with_name(f"{output.stem}-{name}{output.suffix}") for name in names]
    for path in paths:
        check_output(path, "motion", inputs, force)
    for path, (_, recording) in zip(paths, recordings, strict=True):
        write_motion(path, recording)
        tell(f"{path}: {len(recording.motion.time)} samples")
