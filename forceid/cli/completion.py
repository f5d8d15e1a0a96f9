"""What a shell completes after an option or in place of an argument; each list is imported when asked for.

`forceid --install-completion` installs it for bash, zsh or fish. Where nothing fits, bash completes files.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import get_args


def methods(incomplete: str) -> list[str]:
    """Estimators by name.

    >>> methods("s")
    ['savgol', 'spline', 'smoother']
    """
    from forceid.config import Method

    return fitting(get_args(Method), incomplete)


def models(incomplete: str) -> list[str]:
    """Models of deformation by name.

    >>> models("")
    ['rigid', 'affine', 'modal', 'auto']
    """
    from forceid.config import Model

    return fitting(get_args(Model), incomplete)


def engines(incomplete: str) -> list[str]:
    """Engines of the Kalman passes by name.

    >>> engines("n")
    ['numpy']
    """
    from forceid.kalman.engines import MODULES

    return fitting(["auto", *MODULES], incomplete)


def fitting(names: Iterable[str], incomplete: str) -> list[str]:
    """The names that begin as asked, each once."""
    return [name for name in dict.fromkeys(names) if name.startswith(incomplete)]
