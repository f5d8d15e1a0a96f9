"""A kind of case that the chart can show: what it takes to run, judge and describe one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from evidence.subject import Answer, Contestant

Plain = Mapping[str, Any]


def always(contestant: Contestant, answers: Mapping[str, Sequence[Plain]]) -> bool:
    """Everyone says something new."""
    return True


def nothing(case: Any) -> None:
    """No bound is known."""


@dataclass(frozen=True)
class Charted:
    """A subject of the chart.

    name, title: of its part of the page; reading: how to read it, with a place for how often was timed.
    counted: modules, and folders: of forceid, that results depend on. records(source, seeds): a case once for
    every seed; each has `name` and `key`. contestants(case): who takes part, ours first, and the libraries
    that are not installed; worth: whether one says anything new after what the others answered. score: an
    answer as plain numbers; bound: of a case; facts: a case as plain data, without rows: `title`,
    `quantities`, `units` (None for relative errors), `resolved` and what `described` tells; judged: a row, of
    the answers to all seeds. heads, cells: of its table. default: who stands for default settings, if anyone.
    levels: relative errors at which the fastest are compared; margin: ratio of errors that is no difference.
    clock: unit of time, and how many are in a second; time, lines: what the axis of time, and a line in a
    picture, are.
    """

    name: str
    title: str
    reading: str
    counted: Sequence[str]
    folders: Sequence[str]
    records: Callable[[Any, int], Sequence[Any]]
    contestants: Callable[[Any], tuple[list[Contestant], list[str]]]
    score: Callable[[Any, Answer], dict[str, Any]]
    facts: Callable[[Sequence[Any], Sequence[Any]], dict[str, Any]]
    judged: Callable[[Plain, Sequence[Plain]], dict[str, Any]]
    described: Callable[[Plain], str]
    heads: Callable[[Plain], Sequence[str]]
    cells: Callable[[Plain, Plain], Sequence[str]]
    clock: tuple[str, float]
    time: str
    lines: str = ""
    default: str = ""
    margin: float = 1.0
    levels: Callable[[Plain], Sequence[float]] = lambda case: ()
    bound: Callable[[Any], Any] = nothing
    worth: Callable[[Contestant, Mapping[str, Sequence[Plain]]], bool] = always

    @property
    def better(self) -> str:
        """What a peer has to be to be ahead."""
        return "more accurate" if self.margin > 1 else "no less accurate"
