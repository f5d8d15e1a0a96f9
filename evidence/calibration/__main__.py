"""Drawn records by the thousand: coverage, error over claim, and how many are silently wrong.

    python -m evidence.calibration [--count 200] [--seed 1] [--frames 100 1500] [-o docs] [-j 1]

Writes calibration.md where a folder is given, and goes on there after an interruption. Every record is a draw
of body, markers, motion, loads, camera and of what its user states; see `evidence.calibration.distributions`.
Records of more frames than the longest of these are estimated in stretches.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from evidence.calibration.distributions import SAMPLES, Span
from evidence.calibration.judged import Outcome, outcome_of
from evidence.calibration.page import page
from evidence.journal import Journal, key, version
from evidence.written import asked, each, paged

MODULES = [
    *(f"calibration.{p.stem}" for p in Path(__file__).parent.glob("[a-z]*.py") if p.stem != "page"),
    "strangers.attempt", "judged", "vectors", "drawn.records.scored",
]  # fmt: skip


def outcomes(
    seed: int, numbers: Sequence[int], journal: Journal, workers: int, frames: Span = SAMPLES
) -> list[Outcome]:
    """What came of records of a seed, in order: from the journal, or drawn and estimated now."""
    stamp = version(*MODULES)
    keys = {number: key(stamp, seed, number, *frames) for number in numbers}
    left = [number for number in numbers if keys[number] not in journal.lines]

    def keep(found: Outcome) -> None:
        journal.once(keys[found.number], lambda: asdict(found))

    for found in each(outcome_of, [(seed, number, frames) for number in left], workers) if left else ():
        keep(found)
    return [Outcome(**journal.lines[keys[number]]) for number in numbers]


def main() -> None:
    """Draw, estimate, judge, and write the page."""
    given = asked(
        "evidence.calibration", __doc__, page=False, count=200, seed=1, frames=SAMPLES, output="", jobs=1
    )
    low, high = given.frames
    folder = Path(given.output) if given.output else None
    kept = folder / "calibration" / "calibration.jsonl" if folder else Path(os.devnull)
    found = outcomes(given.seed, range(given.count), Journal.opened(kept), given.jobs, (low, high))
    parts = page(found, given.seed, given.command)
    if folder is None:
        print("\n\n".join(parts))
    else:
        paged(folder, "calibration", "Drawn records by the thousand", *parts)


if __name__ == "__main__":
    main()
