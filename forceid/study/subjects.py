"""What the stress study puts to the test: estimators of force on flights, solvers on bodies in parts."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Protocol

from forceid.scenes import drawn_loads
from forceid.study import failures, flown_bodies, oracle, parted_bodies, partition_trial, trial
from forceid.study.failures import Failure


class Contender(Protocol):
    """Who meets a failure. coarse: whether it may honestly be worse than twice the bound."""

    @property
    def name(self) -> str:
        """As it is called in a map."""

    @property
    def coarse(self) -> bool:
        """Whether it may."""


@dataclass(frozen=True)
class Subject:
    """One kind of trial.

    contestants: who meets a failure, all or the default only; attempt: a failure, a level, a seed and
    contestants give the trials of a record, as plain numbers; default: by name; quantities: the two that are
    judged; against: what a number in a map is relative to; told: what was done, in words; folders: of code
    under test, and sources: what else the trials depend on.
    """

    contestants: Callable[[Failure, bool], tuple[Any, ...]]
    attempt: Callable[[Failure, float, int, tuple[Any, ...]], dict[str, Any]]
    default: str
    quantities: tuple[str, str]
    against: str
    told: str
    folders: tuple[str, ...]
    sources: tuple[ModuleType, ...]


TOLD_OF_FLIGHTS = """\
Records of a body whose motion was written down together with the force and moment that drove it. *Bound*
is what a smoother attains that is told the prior of the loads, the noise and the body, on the record
without its fault: the same instants and markers. Errors, claims and bounds are root mean squares per axis
over the central three quarters, pooled over the seeds."""
TOLD_OF_PARTS = """\
Bodies in parts at rest, whose motion was written down first; loads and forces between parts were worked
out from it in extended precision. Errors and claims are of all forces between parts and of all motions,
relative to their length, pooled over the seeds. No bound is known: rounding costs one body more than
another."""
FLIGHTS = Subject(
    trial.contestants,
    trial.attempt,
    "smoother",
    ("force", "moment"),
    "bound",
    TOLD_OF_FLIGHTS,
    ("estimation", "kalman", "motion", "principal"),
    (sys.modules[drawn_loads.draw.__module__], flown_bodies, failures, oracle, trial),
)
PARTS = Subject(
    partition_trial.solvers,
    partition_trial.attempt_parts,
    partition_trial.DEFAULT.name,
    ("force", "motion"),
    "claim",
    TOLD_OF_PARTS,
    ("partition",),
    (parted_bodies, partition_trial),
)


def subject_of(failure: Failure) -> Subject:
    """The kind of trial that a failure is met in."""
    return PARTS if failure.group == "partition" else FLIGHTS
