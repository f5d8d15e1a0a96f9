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
STAGES: dict[Stage, str] = {
    "loading": "modules that load on first use",
    "reading": "the file, its fingerprint, and what it holds",
    "kinematics": "poses, shapes and their noise; outliers and gaps",
    "deformation": "amplitudes of the shapes, smoothed",
    "level": "which model is enough: rigid, affine or modal",
    "noise": "of the markers, and errors that last",
    "force": "tuning of the prior of the force",
    "moment": "tuning of the prior of the moment",
    "instruments": "sensors and gauges beside the poses",
    "flight": "motion and loads, filtered and smoothed",
    "flight_tuning": "priors by the likelihood of the whole flight",
    "frames": "those that nothing else agrees with",
    "lines": "oscillating loads that the innovations show",
    "axes": "loads that turn with the body, or do not",
    "claims": "what the claimed errors must allow for",
    "witness": "the plain route beside",
    "joints": "what passes through them, less stages of parts",
    "verdict": "checks, costs of wrong inputs, applied loads",
    "rest": "all else",
    "writing": "the result file, which lacks this line",
}
assert tuple(STAGES) == get_args(Stage)

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

    >>> with recorded() as spent:
    ...     with stage("level"), stage("flight"):
    ...         pass
    >>> sorted(spent)
    ['flight', 'level']
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
