"""CPU time by stage: every second of an estimate counts for the innermost stage that it was spent in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from time import process_time
from typing import Literal, get_args

Stage = Literal[
    "loading", "reading", "kinematics", "deformation", "level", "noise", "force", "moment", "instruments",
    "flight", "flight_tuning", "frames", "lines", "axes", "claims", "witness", "joints", "verdict", "rest",
    "writing",
]  # fmt: skip
STAGES: tuple[Stage, ...] = get_args(Stage)

_spent: ContextVar[dict[str, float] | None] = ContextVar("spent", default=None)


@contextmanager
def recorded() -> Iterator[dict[str, float]]:
    """The CPU seconds of every stage within, by its name, as they are spent."""
    spent: dict[str, float] = {}
    before = _spent.set(spent)
    try:
        yield spent
    finally:
        _spent.reset(before)


@contextmanager
def stage(name: Stage) -> Iterator[None]:
    """A stage, as a context or on a function: its time counts for it, less that of the stages within.

    Nothing happens where nobody records.
    """
    spent = _spent.get()
    if spent is None:
        yield
        return
    began, within = process_time(), sum(spent.values())
    try:
        yield
    finally:
        spent[name] = spent.get(name, 0.0) + process_time() - began - (sum(spent.values()) - within)


def in_order(*spent: Mapping[str, float]) -> dict[str, float]:
    """Seconds by stage, summed over records, in the order in which the stages are met."""
    known = {name for record in spent for name in record}
    return {name: sum(record.get(name, 0.0) for record in spent) for name in STAGES if name in known}
