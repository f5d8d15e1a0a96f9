"""Who takes part in the chart: a way from a recording to a wrench, and what it answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from evidence.subjects.flights.cases import Case
from forceid.records import Array


@dataclass(frozen=True)
class Answer:
    """A wrench (time, 6), what is claimed of its error (time, 6), and what is said of it.

    std: None where nothing is claimed. verdict: empty where the method gives none. chosen: what it settled
    for, in words: a model, a window, a cut.
    """

    wrench: Array
    std: Array | None = None
    verdict: str = ""
    reasons: tuple[str, ...] = ()
    chosen: str = ""


@dataclass(frozen=True)
class Contestant:
    """One way to do the job.

    prepare(case) gives the job that is timed: raw recording in, answer out. told: it was told the truth of
    the case, to choose its parameter or its prior by; what it spends on that is not timed. kind: "method",
    "level" of the model, "engine", or "modes" kept, of ours; "peer". about: one line on what it is. key: of
    its configuration. slow: left out of the short chart.
    """

    name: str
    kind: Literal["method", "level", "engine", "modes", "peer"]
    prepare: Callable[[Case], Callable[[], Answer]]
    about: str
    key: str
    told: bool = False
    slow: bool = False

    @property
    def ours(self) -> bool:
        """Whether forceid does it."""
        return self.kind != "peer"
