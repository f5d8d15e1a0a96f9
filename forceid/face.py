"""Names of a package that load on first use, so that an import costs no more than what it asks for."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any


def on_first_use(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package: homes tells the module of every name.

    >>> on_first_use("forceid", {"Motion": "forceid.records"})("Motion").__name__
    'Motion'
    """

    def found(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return found


def homes_in(package: str) -> dict[str, str]:
    """The names of a package and their modules, as the stub beside its file `__init__.py` imports them."""
    stub = Path(package).with_suffix(".pyi").read_text("utf-8")
    return {name: home for home, name in re.findall(r"^from (\S+) import (\w+) as \2$", stub, re.MULTILINE)}
