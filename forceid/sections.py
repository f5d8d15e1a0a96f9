"""A section of a configuration: read from TOML, checked key by key, and written."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Any, TypeVar, get_args

import tomli_w
from pydantic import BaseModel, ConfigDict, ValidationError

from forceid.errors import ConfigError


class Section(BaseModel):
    """A table of the configuration; frozen, and closed to unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


S = TypeVar("S", bound=Section)


def read_toml(path: str | Path) -> dict[str, Any]:
    """The tables of a TOML file; a missing or malformed file is a ConfigError."""
    try:
        with open(path, "rb") as f:
            return tomllib.load(f)
    except OSError as e:
        raise ConfigError(f"cannot be read ({e.strerror})", str(path), "give the path of a TOML file") from e
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as e:
        raise ConfigError(f"is not valid TOML ({e})", str(path), "correct that line") from e


def validate(section: type[S], table: dict[str, Any], where: str) -> S:
    """`table` as a frozen `section`, or a ConfigError that names the key and what was expected."""
    try:
        return section.model_validate(table)
    except ValidationError as e:
        errors = e.errors()  # a misspelled key first: it also makes the right one look missing
        first = next((error for error in errors if error["type"] == "extra_forbidden"), errors[0])
        key = ".".join(str(k) for k in first["loc"])
        if first["type"] != "extra_forbidden":
            what = first["msg"].removeprefix("Value error, ")
            field = section.model_fields.get(key.split(".")[0])
            if first["type"] == "missing" and field is not None and field.examples:
                raise ConfigError(f"key '{key}' is missing", where, f"add {field.examples[0]}") from e
            found = "" if first["type"] in ("missing", "value_error") else f", found {first['input']!r}"
            next_step = "fill in the number" if first["type"] == "finite_number" else ""
            raise ConfigError(f"key '{key}': {what}{found}", where, next_step) from e
        near = nearest_key(section, first["loc"])
        raise ConfigError(f"unknown key '{key}'", where, f"did you mean '{near}'?") from e


def nearest_key(section: type[Section], loc: tuple[int | str, ...]) -> str:
    """The known key that an unknown one at `loc` is likeliest to mean: of its own table, else with its table.

    >>> from forceid.config import Settings
    >>> nearest_key(Settings, ("metod",)), nearest_key(Settings, ("direction",))
    ('method', 'load.direction')
    """
    own = section
    for step in loc[:-1]:
        own = own if isinstance(step, int) else known_keys(own)[step] or own
    written = str(loc[-1])
    if near := difflib.get_close_matches(written, known_keys(own), n=1):
        return near[0]
    named = {path.rpartition(".")[2]: path for path in reversed(key_paths(section))}
    return named[difflib.get_close_matches(written, named, n=1, cutoff=0.0)[0]]


def key_paths(section: type[Section]) -> list[str]:
    """Every key of a section, then those of the sections below it as `section.key`."""
    known = known_keys(section)
    below = [f"{name}.{path}" for name, kind in known.items() if kind for path in key_paths(kind)]
    return [*known, *below]


def known_keys(section: type[Section]) -> dict[str, type[Section] | None]:
    """The keys of a section, each with the section that it holds, if it does."""
    return {
        field.alias or name: next(
            (
                kind
                for kind in (field.annotation, *get_args(field.annotation))
                if isinstance(kind, type) and issubclass(kind, Section)
            ),
            None,
        )
        for name, field in section.model_fields.items()
    }


def to_toml(settings: Section) -> str:
    """Settings as TOML text that `load_settings` reads back to the same record."""
    return tomli_w.dumps(settings.model_dump(mode="json", by_alias=True, exclude_none=True))
