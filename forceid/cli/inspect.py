"""forceid inspect: what a motion file holds and what can be identified from it."""

from __future__ import annotations

from dataclasses import replace

from forceid.cli.boundary.output import to_json, wrap
from forceid.cli.boundary.terminal import tell
from forceid.cli.estimate import Config, Json, MotionFile, naming


def run(file: MotionFile, config: Config = None, json: Json = False) -> None:
    """Show what FILE holds and which wrench components can be identified, before anything runs.

    Of a body in parts, [[part]] and [[joint]] in CONFIG, also which forces between these the motion tells.

    Example: forceid inspect toss.h5
    """
    from forceid.cli.crew.progress import progress
    from forceid.config import load_settings
    from forceid.estimation import inspect_recording, read_recording

    settings = load_settings(config)
    with naming(file):
        recording, left_out = read_recording(file, settings, progress=progress)
        inspection = inspect_recording(recording, settings)
    inspection = replace(inspection, findings=(*inspection.findings, *left_out))
    if json:
        tell(to_json({"file": str(file), **inspection.as_dict()}))
    else:
        tell("\n".join(map(wrap, inspection.summary)))
