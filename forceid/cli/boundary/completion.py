"""What a shell completes after an option or in place of an argument; each list is imported when asked for.

`forceid --install-completion` installs it for bash, zsh or fish. Where nothing fits, bash completes files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from typing import get_args


def words_of(module: str, name: str, *more: str) -> Callable[[str], list[str]]:
    """What to complete with the words of a Literal, or with the keys of a table, of a module, and with more.

    >>> words_of("forceid.config", "Method")("s"), words_of("forceid.kalman.engines", "MODULES", "auto")("a")
    (['savgol', 'spline', 'smoother'], ['auto'])
    """

    def completed(incomplete: str) -> list[str]:
        known = getattr(import_module(module), name)
        return fitting([*more, *(get_args(known) or known)], incomplete)

    return completed


def fitting(names: Iterable[str], incomplete: str) -> list[str]:
    """The names that begin as asked, each once."""
    return [name for name in dict.fromkeys(names) if name.startswith(incomplete)]
