"""forceid inspect: what a motion file holds and what can be identified from it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forceid.cli.estimate import Config, Json, naming
from forceid.cli.output import to_json, wrap


def run(
    file: Annotated[Path, typer.Argument(metavar="FILE.h5", help="Motion file, HDF5.")],
    config: Config = None,
    json: Json = False,
) -> None:
    """Show what FILE holds and which wrench components can be identified, before anything runs.

    Of a body in parts, [[part]] and [[joint]] in CONFIG, also which forces between these the motion tells.

    Example: forceid inspect toss.h5
    """
    from forceid.config import load_settings
    from forceid.estimation.inspection import inspect_recording
    from forceid.files.hdf5 import read_motion

    settings = load_settings(config)
    recording = read_motion(file, settings.gravity)
    with naming(file):
        inspection = inspect_recording(recording, settings)
    if json:
        print(to_json({"file": str(file), **inspection.as_dict()}))
    else:
        print(*map(wrap, inspection.summary), sep="\n")
