"""The templates of the pages, which share their style and what they draw."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined

from forceid import __version__


def read_template(name: str) -> str:
    """A template of this package."""
    return files("forceid.report").joinpath(name).read_text("utf-8")


def render(name: str, **values: Any) -> str:
    """The template of that name with the values in it, as text and never as markup."""
    environment = Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        loader=FunctionLoader(read_template),
    )
    return environment.get_template(name).render(version=__version__, **values)
