"""The templates of the pages, which share their style and what they draw."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from forceid import __version__
from forceid.report.numbers import digits, plain, plus_minus, typeset


def render(name: str, **values: Any) -> str:
    """The template of that name with the values in it, as text and never as markup."""
    environment = Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        loader=PackageLoader("forceid", "report"),
    )
    environment.filters |= {f.__name__: f for f in (digits, named_numbers, plain, plus_minus, typeset)}
    environment.tests |= {"finite": math.isfinite}
    return environment.get_template(name).render(version=__version__, **values)


def titled(name: str) -> str:
    """The name of a number as a row of a table has it."""
    return name.replace("_", " ").capitalize()


def named_numbers(numbers: Mapping[str, float]) -> list[tuple[str, str]]:
    """Numbers with names as rows of a table."""
    return [(titled(name), digits(value)) for name, value in numbers.items()]
