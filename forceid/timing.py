"""CPU time by stage: every second of an estimate counts for the innermost stage that it was spent in."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
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
_watcher: ContextVar[Callable[[str], None] | None] = ContextVar("watcher", default=None)
_around: ContextVar[str] = ContextVar("around", default="")


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
def watched(by: Callable[[str], None]) -> Iterator[None]:
    """Tell `by` the name of every stage within as it begins, and that of the one around it as it ends."""
    before = _watcher.set(by)
    try:
        yield
    finally:
        _watcher.reset(before)


@contextmanager
def stage(name: Stage) -> Iterator[None]:
    """A stage, as a context or on a function: its time counts for it, less that of the stages within.

    Nothing happens where nobody records or watches.
    """
    spent, tell, outer = _spent.get(), _watcher.get(), _around.get()
    if spent is None and tell is None:
        yield
        return
    around = _around.set(name)
    if tell is not None:
        tell(name)
    began, within = process_time(), sum((spent or {}).values())
    try:
        yield
    finally:
        _around.reset(around)
        if tell is not None and outer:
            tell(outer)
        if spent is not None:
            spent[name] = spent.get(name, 0.0) + process_time() - began - (sum(spent.values()) - within)


def in_order(*spent: Mapping[str, float]) -> dict[str, float]:
    """Seconds by stage, summed over records, in the order in which the stages are met."""
    known = {name for record in spent for name in record}
    return {name: sum(record.get(name, 0.0) for record in spent) for name in STAGES if name in known}
