"""Paired measurement: who is how many times faster, in process CPU time, with everyone in every round.

Absolute times of a shared machine drift by a factor of three within minutes; the ratio of two contestants
that take turns within a round does not. So each round times every contestant, in an order that reverses from
round to round, and a ratio is formed within the round: minimum, median and maximum are over rounds.
Before any clock starts, every answer is compared with the reference.
"""

from __future__ import annotations

import gc
import resource
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

TOLERANCE = 1e-8  # of the largest entry of the quantity that is compared
LEAST = 0.03  # s that a timed contestant runs at least: shorter ones are repeated
SLOW = 4.0  # s: who takes longer is not run once more to be warm
PATIENCE = 6.0  # times the budget that a contestant may take which must not be cut

RaceAnswer = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Racer:
    """One way to do the job. `prepare(size)` returns what is timed; `read` takes the answer out, untimed.

    whole: never measured on a shorter stretch, because its time is not proportional to the size (unless it
    would take PATIENCE budgets). figures: numbers of interest beside the time, from the answer at full size.
    judged: False where it computes something else on purpose, and is not compared.
    """

    name: str
    prepare: Callable[[int], Callable[[], Any]]
    read: Callable[[Any], RaceAnswer]
    whole: bool = False
    judged: bool = True
    figures: Callable[[RaceAnswer], dict[str, float]] | None = None


@dataclass(frozen=True)
class Goal:
    """Contestant `of` is to be `least` times as fast as `against`."""

    of: str
    against: str
    least: float


@dataclass(frozen=True)
class Limit:
    """A figure of contestant `of` is to be `most` at most."""

    of: str
    figure: str
    most: float


@dataclass(frozen=True)
class Race:
    """A job of `size` units, each of `samples` samples, and who takes part.

    base: whom ratios refer to, and whose answer is taken for right; check: the size on which answers are
    compared; clock: ns, us or ms, in which times are printed; rounds: at most; tolerance: of the largest
    entry, within which answers agree.
    """

    title: str
    contestants: list[Racer]
    base: str
    size: int
    check: int
    goals: list[Goal | Limit] = field(default_factory=list)
    samples: int = 1
    unit: str = "sample"
    clock: str = "ns"
    rounds: int = 100
    tolerance: float = TOLERANCE


@dataclass
class RaceRow:
    """What was found of one contestant: seconds per sample in each round, or why it did not start."""

    name: str
    size: int = 0
    repeats: int = 1
    seconds: list[float] = field(default_factory=list)
    disagreement: dict[str, float] = field(default_factory=dict)
    judged: bool = True
    tolerance: float = TOLERANCE
    absent: str = ""
    figures: dict[str, float] = field(default_factory=dict)

    @property
    def median(self) -> float:
        """Median over rounds of the seconds per sample."""
        return float(np.median(self.seconds))

    def times_as_fast_as(self, other: RaceRow) -> tuple[float, float, float]:
        """Minimum, median and maximum over rounds of the other's time over this one's."""
        ratio = np.array(other.seconds) / np.array(self.seconds)
        return float(ratio.min()), float(np.median(ratio)), float(ratio.max())


@dataclass(frozen=True)
class RaceOutcome:
    """A race that was run."""

    race: Race
    rows: dict[str, RaceRow]

    def verdicts(self) -> list[tuple[str, str, bool | None]]:
        """Each goal in words, what was measured, and whether it is met; None where nobody ran."""
        found: list[tuple[str, str, bool | None]] = []
        for goal in self.race.goals:
            if isinstance(goal, Limit):
                text = f"{goal.figure} of {goal.of} <= {goal.most:g}"
                value = self.rows[goal.of].figures.get(goal.figure)
                held = None if value is None else value <= goal.most
                found.append((text, "-" if value is None else f"{value:.2g}", held))
                continue
            of, against = self.rows[goal.of], self.rows[goal.against]
            text = f"{goal.of} >= {goal.least:g} x {goal.against}"
            if not of.seconds or not against.seconds:
                found.append((text, "-", None))
                continue
            low, middle, high = of.times_as_fast_as(against)
            measured = f"{three_figures(middle)} ({three_figures(low)} to {three_figures(high)})"
            if wrong(of):
                measured += ", answer wrong"
            found.append((text, measured, middle >= goal.least and not wrong(of)))
        return found


def run(race: Race, rounds: int, budget: float) -> RaceOutcome:
    """Check, then time: `rounds` rounds, each contestant on a stretch that takes it about `budget` s."""
    rows: dict[str, RaceRow] = {}
    answers: dict[str, RaceAnswer] = {}
    jobs: dict[str, Callable[[], Any]] = {}
    gc.collect()
    gc.freeze()
    for c in race.contestants:
        row = rows[c.name] = RaceRow(c.name, judged=c.judged, tolerance=race.tolerance)
        try:
            job = c.prepare(race.check)
            found, pace = timed_once(job)
            answers[c.name] = c.read(found)
            if pace < SLOW:
                pace = cpu_seconds(job, 1)  # warm, and compiled
            pace = pace / race.check
            row.size = timed_size(c, race, pace, budget)
            if row.size != race.check:
                job = c.prepare(row.size)
                job()  # warm, and compiled for this size
                pace = cpu_seconds(job, 1) / row.size
                found = job() if c.figures is not None else found
            if c.figures is not None:
                row.figures = c.figures(c.read(found))
            del found
            row.repeats = max(1, int(np.ceil(LEAST / max(pace * row.size, 1e-9))))
            jobs[c.name] = job
        except Exception as e:  # a peer that fails is reported, and the race goes on without it
            row.absent = f"{type(e).__name__}: {' '.join(str(e).split())[:160]}"
            jobs.pop(c.name, None)
    reference = answers.get(race.base, {})
    for name, answer in answers.items():
        rows[name].disagreement = compare(reference, answer)
    gc.collect()
    gc.freeze()  # what the peers loaded is looked through once, not before every turn
    for turn in range(min(rounds, race.rounds)):
        for name in list(jobs)[:: 1 if turn % 2 == 0 else -1]:
            row = rows[name]
            row.seconds.append(cpu_seconds(jobs[name], row.repeats) / (row.repeats * row.size * race.samples))
    gc.unfreeze()
    return RaceOutcome(race, rows)


def timed_size(c: Racer, race: Race, pace: float, budget: float) -> int:
    """The size on which a contestant that takes `pace` s a unit is timed."""
    limit = PATIENCE * budget if c.whole else budget
    if pace * race.size <= limit:
        return race.size
    return int(np.clip(limit / pace, min(race.check, race.size), race.size))


def cpu_seconds(job: Callable[[], Any], repeats: int) -> float:
    """CPU seconds of so many runs, of this process and of those it starts and waits for."""
    gc.collect()
    gc.disable()
    try:
        start = cpu_time()
        for _ in range(repeats):
            job()
        return cpu_time() - start
    finally:
        gc.enable()


def timed_once(job: Callable[[], Any]) -> tuple[Any, float]:
    """What a first run finds, and its CPU seconds."""
    start = cpu_time()
    return job(), cpu_time() - start


def cpu_time() -> float:
    """CPU seconds, user and system, of this process and of its children that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def compare(reference: RaceAnswer, answer: RaceAnswer) -> dict[str, float]:
    """Largest difference of each quantity that both have, relative to its largest entry."""
    shared = [name for name in reference if name in answer]
    return {name: difference(reference[name], answer[name]) for name in shared}


def difference(reference: np.ndarray, answer: np.ndarray) -> float:
    """Largest difference relative to the largest entry; infinite where the shapes differ or a NaN is new."""
    if reference.shape != answer.shape:
        return float("inf")
    difference = np.abs(answer - reference).max() / np.abs(reference).max()
    return float(difference) if np.isfinite(difference) else float("inf")


def wrong(row: RaceRow) -> bool:
    """Whether an answer that should agree does not."""
    return row.judged and max(row.disagreement.values(), default=0.0) > row.tolerance


def agreement(row: RaceRow) -> str:
    """The agreement found, in words."""
    if not row.judged or not row.disagreement:
        return "not compared"
    worst = max(row.disagreement, key=lambda name: row.disagreement[name])
    text = f"{worst} {row.disagreement[worst]:.1e}"
    return f"wrong at {row.tolerance:.0e}: {text}" if wrong(row) else f"agrees: {text}"


def three_figures(value: float) -> str:
    """Three figures, without an exponent: 0.0123, 1.23, 123, 12300."""
    if value == 0 or not np.isfinite(value):
        return str(value)
    digits = 2 - int(np.floor(np.log10(abs(value))))
    return f"{round(value, digits):.{max(digits, 0)}f}"
