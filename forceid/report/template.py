"""The templates of the pages, which share their style and what they draw."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from forceid import __version__


def render(name: str, **values: Any) -> str:
    """The template of that name with the values in it, as text and never as markup."""
    environment = Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        loader=PackageLoader("forceid", "report"),
    )
    return environment.get_template(name).render(version=__version__, **values)
