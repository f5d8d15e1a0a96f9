"""Names of a package that load on first use, so that an import costs no more than what it asks for."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any


def on_first_use(package: str, file: str) -> tuple[list[str], Callable[[str], Any]]:
    """The names of a package, as the stub beside its file `__init__.py` imports them, and its `__getattr__`.

    >>> import forceid
    >>> names, found = on_first_use("forceid", forceid.__file__)
    >>> "estimate" in names, found("estimate").__name__
    (True, 'estimate')
    """
    stub = Path(file).with_suffix(".pyi").read_text("utf-8")
    homes = {name: home for home, name in re.findall(r"^from (\S+) import (\w+) as \2$", stub, re.MULTILINE)}

    def found(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return [*homes], found


class NamedAlike(ModuleType):
    """A package with the name of a function of the package above it: it may be called in its place.

    Loading a package puts it into the one above, where it hides what had its name.
    """

    def __call__(self, *given: Any, **named: Any) -> Any:
        """What the function of this name returns."""
        above, _, name = self.__name__.rpartition(".")
        return import_module(above).__getattr__(name)(*given, **named)
