"""forceid settings: every key with its default, and every number that was chosen, with its reason."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from forceid.cli.boundary.output import to_json
from forceid.cli.boundary.terminal import tell
from forceid.cli.estimate import Json


def run(
    thresholds: Annotated[
        bool,
        typer.Option("--thresholds", help="The numbers that the method was given, with unit and reason."),
    ] = False,
    json: Json = False,
) -> None:
    """Show the settings with their defaults, as a configuration file that `-c` takes.

    Example: forceid settings > forceid.toml
    """
    from forceid.cli.boundary.thresholds import chosen_numbers
    from forceid.config import Settings
    from forceid.sections import to_toml

    if not thresholds:
        tell(to_json(Settings().model_dump()) if json else to_toml(Settings()).rstrip())
        return
    found = chosen_numbers()
    if json:
        tell(to_json({"numbers": [asdict(number) for number in found]}))
        return
    room = None
    for number in found:
        if number.module != room:
            room = number.module
            tell(f"\n{room}")
        tell(f"  {number.name} = {number.value}  {number.reason}".rstrip())
