"""A failure: one thing that goes wrong, swept from healthy to hopeless."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Make = Callable[[float, np.random.Generator], Any]  # what contestants take on


@dataclass(frozen=True)
class Failure:
    """A sweep. levels run from healthy to hopeless, in `unit`; breaks: what fails, in physical words; make:
    the record of a level; deforms: whether it is about the model of the body, so that each is tried; other:
    whether the load is not drawn from the prior of the bound, so that an honest claim may exceed it.
    """

    name: str
    group: str
    title: str
    unit: str
    levels: tuple[float, ...]
    breaks: str
    make: Make
    deforms: bool = False
    other: bool = False
