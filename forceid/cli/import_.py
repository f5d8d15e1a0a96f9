"""forceid import: measured tables, captures and recordings to motion files."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.boundary.terminal import note, tell
from forceid.cli.estimate import Config, Force


def run(
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="SOURCE...",
            help="Vicon or Motive csv, Qualisys tsv, poses of ROS as csv, trc or c3d, with mot or sto of "
            "force plates; ULog, Blackbox csv; any csv, sto, mat, uff, tdms.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE.h5", help="Motion file; SOURCE.h5 if not given."),
    ] = None,
    config: Config = None,
    init: Annotated[
        bool, typer.Option("--init", help="Write the CONFIG that SOURCE needs, to fill in; -o names it.")
    ] = False,
    force: Force = False,
) -> None:
    """Turn SOURCES into a motion file; several recordings become FILE-NAME.h5, one each.

    CONFIG says what no source does: mass, gravity and, for tables, what they hold; --init writes it, with all
    that the source says filled in. What of a source is left out is named on stderr and in the file.

    The shortest for csv, of which a capture needs the first line and the last:

    \b
      import.gravity = [0.0, 0.0, -9.81]
      import.csv.time = "t"
      import.csv.position.tip = ["tip x", "tip y", "tip z"]
      import.csv.position.hub = ["hub x", "hub y", "hub z"]
      import.body.mass = { tip = 0.02, hub = 0.05 }

    For mat, uff, tdms and sto it is import.channels in place of import.csv:

    \b
      mat   position = "trial.markers.{name}"    fields of a struct, time by 3
            time = "trial.t"                     or rate = 1000.0
            units.position = "mm"                MATLAB keeps no units
      uff   displacement = "displacement.{name}{axis}"    node and direction
            specific_force = "acceleration.{name}{axis}"
      tdms  position = "Markers/{name}_{axis}"   group, then channel

    Example: forceid import --init throw.csv -o throw.toml

    Example: forceid import throw.csv -o throw.h5 -c throw.toml
    """  # noqa: D301 (the backspace keeps the lines of the example apart)
    from forceid.files import (
        check_output,
        import_sources,
        load_import_settings,
        settings_for,
        write_motion,
    )
    from forceid.files.stored.atomic import write_whole

    inputs = [*sources, *([config] if config else [])]
    if init:
        text = settings_for(sources, output.name if output else "")
        if output is None:
            tell(text.rstrip("\n"))
        else:
            check_output(output, "settings", inputs, force)
            write_whole(output, text)
            note(f"{output}: fill in what is nan")
        return
    output = output or sources[0].with_suffix(".h5")
    check_output(output, "motion", inputs, force)
    recordings, paths = import_sources(sources, load_import_settings(config)), [output]
    if len(recordings) > 1:
        names = [name.removeprefix(f"{output.stem}-") for name, _ in recordings]
        paths = [output.with_name(f"{output.stem}-{name}{output.suffix}") for name in names]
    for path in paths:
        check_output(path, "motion", inputs, force)
    left_out: dict[str, None] = {}
    for path, (_, recording) in zip(paths, recordings, strict=True):
        write_motion(path, recording)
        note(f"{path}: {len(recording.motion.time)} samples")
        left_out |= dict.fromkeys(recording.history.split("\n")[1:])
    for line in left_out:
        note(f"note: {line}", sys.stderr)
