"""forceid config: the configuration files that come with forceid, by name."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path
from typing import Annotated

import typer

import forceid
from forceid.cli.boundary.output import to_json, wrap
from forceid.cli.boundary.terminal import tell
from forceid.cli.estimate import Json
from forceid.errors import ConfigError

PACKAGE = Path(forceid.__file__).parent
PLACES = (PACKAGE / "configurations", PACKAGE.parent / "config")  # of a wheel, of the repository
WORDS = ("list", "show")


def run(
    word: Annotated[str, typer.Argument(metavar="list|show", help="List the files, or show one.")],
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Which one to show.")] = None,
    json: Json = False,
) -> None:
    """List the configuration files that come with forceid, or show the one called NAME.

    Example: forceid config show default > forceid.toml
    """
    files = shipped()
    if word not in WORDS:
        near = get_close_matches(word, WORDS, n=1, cutoff=0.0)[0]
        raise ConfigError(f"unknown word '{word}'", "forceid config", f"did you mean '{near}'?")
    if word == "list":
        if json:
            tell(to_json({"configurations": {stem: about(path) for stem, path in files.items()}}))
        else:
            tell("\n".join(wrap(f"{stem}: {about(path)}") for stem, path in files.items()))
        return
    if name not in files:
        what = f"unknown configuration '{name}'" if name else "NAME is missing"
        raise ConfigError(what, "forceid config show", f"give one of {', '.join(files)}")
    text = files[name].read_text("utf-8")
    tell(to_json({"name": name, "text": text}) if json else text.rstrip())


def shipped() -> dict[str, Path]:
    """The configuration files by name.

    >>> "default" in shipped()
    True
    """
    folder = next((place for place in PLACES if place.is_dir()), None)
    if folder is None:
        raise ConfigError("are not part of this installation", "configuration files", "install forceid again")
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def about(path: Path) -> str:
    """What a configuration file says of itself: the first sentence of its comment."""
    lines = path.read_text("utf-8").splitlines()
    comment = [
        line[1:].strip() for line in lines[: next(k for k, line in enumerate(lines) if line[:1] != "#")]
    ]
    return " ".join(comment).partition(". ")[0].rstrip(".")
