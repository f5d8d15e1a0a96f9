"""A failure: one thing that goes wrong, swept from healthy to hopeless."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

Make = Callable[[float, np.random.Generator], Any]  # what contestants take on
M = TypeVar("M", bound=Make)


@dataclass(frozen=True)
class Failure:
    """A sweep. levels run from healthy to hopeless, in `unit`; breaks: what fails, in physical words; make:
    the record of a level; deforms: whether it is about the model of the body, so that each is tried.
    """

    name: str
    group: str
    title: str
    unit: str
    levels: tuple[float, ...]
    breaks: str
    make: Make
    deforms: bool = False


KNOWN: list[Failure] = []  # of every module that was imported


def failure(
    group: str,
    title: str,
    unit: str,
    levels: tuple[float, ...],
    *,
    name: str = "",
    breaks: str = "",
    **of: bool,
) -> Callable[[M], M]:
    """Enter a function into the list: its name is that of the failure, its docstring says what breaks."""

    def enter(make: M) -> M:
        said = (make.__doc__ or "").strip().rstrip(".")
        what = breaks or said[:1].lower() + said[1:]
        KNOWN.append(Failure(name or make.__name__, group, title, unit, levels, what, make, **of))
        return make

    return enter
