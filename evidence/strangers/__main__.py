"""Scenes that MuJoCo moves, estimated as they come: how many are right, how many are wrong and silent.

    python -m evidence.strangers [--seeds 1 2] [--only REGEX] [-o docs] [-j 1]

Writes strangers.md where a folder is given, and goes on there after an interruption. Seeds from 5000 up are
held: nobody looks at their records one by one, and no constant is chosen on them.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any

from evidence.journal import Journal, key, version
from evidence.strangers.kinds import KINDS, run
from evidence.strangers.outcome import HEADS, StrangerOutcome, counted
from evidence.written import asked, each, paged, tabled

MODULES = [f"strangers.{p.stem}" for p in Path(__file__).parent.glob("[a-z]*.py")]
ABOUT = """\
`{command}`: one record of every kind and seed. Bodies of 5 cm to 2.4 m are moved by MuJoCo {simulator} in
steps of at most 0.25 ms, and seen by 4 to 15 markers, of some bodies all on one face. Records have 200 to
800 samples at 100 to 500 Hz, and white noise of 0.1 to 1 mm, stated to half. In four of ten, runs of readings
of some markers are missing. Mass is told as it is, but of the wheel in the satellite nothing is. The
truth is the rate of the momenta of what moved, mean over a sample.

*Error over claim*: rms of the error within the band (up to `band` Hz) over the rms of the claimed deviation,
central three quarters. *Silent*: as of [drawn records](calibration.md). Degraded within 1.5: both are, in
vain; beyond 3: one is, and the claim does not cover it. Ratios and CPU: medians."""


def finished(jobs: Sequence[tuple[str, int]], journal: Journal, workers: int) -> list[StrangerOutcome]:
    """What came of every kind and seed, in order: from the journal, or simulated and estimated now."""
    stamp = version(*MODULES, "judged"), version_of("mujoco")
    keys = {job: key(*stamp, *job) for job in jobs}
    left = [job for job in jobs if keys[job] not in journal.lines]

    def keep(job: tuple[str, int], rows: list[StrangerOutcome]) -> None:
        journal.once(keys[job], lambda: [asdict(row) for row in rows])

    for job, rows in zip(left, each(run, left, workers) if left else (), strict=True):
        keep(job, rows)
    found: list[dict[str, Any]] = [row for job in jobs for row in journal.lines[keys[job]]]
    return [StrangerOutcome(**row) for row in found]


def main() -> None:
    """Simulate, estimate, judge: a line a record as it goes, then the table."""
    given = asked("evidence.strangers", __doc__, page=False, seeds=(1, 2), only=".", output="", jobs=1)
    folder = Path(given.output) if given.output else None
    kept = folder / "strangers" / "strangers.jsonl" if folder else Path(os.devnull)
    jobs = [(kind, seed) for seed in given.seeds for kind in KINDS if re.search(given.only, kind)]
    rows = finished(jobs, Journal.opened(kept), given.jobs)
    names = [*dict.fromkeys(row.kind for row in rows)]
    groups = {name: [row for row in rows if row.kind == name] for name in names} | {"all": rows}
    table = tabled(HEADS, [counted(name, of) for name, of in groups.items()])
    amiss = [row for row in rows if row.silent or row.verdict in ("refused", "crashed")]
    told = ", ".join(f"{row.kind} {row.seed}" for row in amiss)
    parts = [
        table,
        *[f"Silent, refused or crashed: `{told}`. To see one: `--only KIND --seeds SEED`."] * bool(told),
    ]
    if folder is None:
        print("\n\n".join(parts))
    else:
        about = ABOUT.format(command=given.command, simulator=version_of("mujoco"))
        paged(folder, "strangers", "Strangers: scenes of another simulator", about, *parts)


if __name__ == "__main__":
    main()
