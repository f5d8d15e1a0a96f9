"""forceid identify: the material of a body, or its modes, from one free flight."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from forceid.cli.boundary.output import to_json, verdict_of, wrap
from forceid.cli.boundary.terminal import note, tell
from forceid.cli.estimate import Config, Force, Json, MotionFile, naming, written


def run(
    file: MotionFile,
    config: Config = None,
    output: Annotated[
        Path | None, written("OUT.toml", "Settings whose table `material` holds what was found.")
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Identify the material of the body in FILE, or its modes, from its free flight, with 95 % intervals.

    Of a body with mode shapes or a stiffness, frequency and damping of every mode. Any other body deforms
    affinely under nothing but its weight: both constants of Lame of a St. Venant-Kirchhoff or a neo-Hookean
    law, whichever is likelier or `material` in CONFIG names, and Kelvin-Voigt damping. Exit code 1 when
    nothing can be told; then nothing is written.

    Example: forceid identify flight.h5 -o material.toml
    """
    from forceid.config import load_settings
    from forceid.estimation import identify_modes, identify_recording, read_recording
    from forceid.files import check_output
    from forceid.files.stored.atomic import write_whole

    settings = load_settings(config)
    if output is not None:
        check_output(output, "settings", [file, *([config] if config else [])], force)
    with naming(file):
        recording = read_recording(file, settings)[0]
        body = recording.body
        elastic = body.material is not None or settings.material is not None
        modal = not elastic and (body.mode_shape is not None or body.stiffness is not None)
        found = (identify_modes if modal else identify_recording)(recording, settings)
    record: dict[str, Any] = {"file": str(file), **verdict_of(found.verdict), **found.as_dict()}
    refused = found.verdict.level == "refused"
    if output is not None and record.get("material"):
        import tomli_w

        write_whole(output, "# made by forceid identify\n" + tomli_w.dumps({"material": record["material"]}))
    (tell if json else note)(to_json(record) if json else summary(record))
    if refused:
        raise typer.Exit(1)


def summary(record: dict[str, Any]) -> str:
    """The same for people: the verdict first, then a line for every constant."""
    lines = [f"verdict  {record['verdict']}", *(wrap(f"       - {text}") for text in record["reasons"])]
    law = f"law      {record['law']}, misfit {record['misfit']:.3g}, " if "law" in record else "fit      "
    lines.append(f"{law}noise {record['noise_std']:.2g} m")
    for name, one in record["constants"].items():
        ends = f"95 %: {one['low']:.6g} to {one['high']:.6g}"
        lines.append(f"{name:12} {one['value']:.6g} +- {one['std']:.2g} {one['unit']}, {ends}")
    return "\n".join(lines)
