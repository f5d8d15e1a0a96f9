"""Loads beside one that is known: what knowing it beforehand is worth, and whether the claims hold.

    python -m evidence.drawn.known_loads -o docs [--count 20] [--seed 400] [--jobs 2]

Six masses on a plate whose wrench is read at 1000 Hz, or under a thrust that turns with them. Beside it a
force and a moment of three sines each are to be found. Markers at 200 Hz for two seconds, 1 mm of
noise, stated. Medians over drawn records, within the band. `afterwards`: the wrench of all loads is
estimated, and the known one taken off.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from evidence.drawn.records.known_load import flown
from evidence.drawn.records.scored import FORCE, MOMENT, RecordScore, scored
from evidence.judged import RULE, silent_share
from evidence.written import asked, each, paged, table
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording

KINDS = {"a plate of known wrench": False, "a known thrust in body axes": True}


def scores(seed: int, on_body: bool, method: str) -> tuple[RecordScore, RecordScore]:
    """A record with the known load taken into account, and with it taken off afterwards."""
    recording, force, moment, settings = flown(seed, on_body)
    found = estimate_recording(recording, settings.model_copy(update={"method": method}))
    of_all = estimate_recording(replace(recording, known_loads=None), load_settings(method=method))
    assert found.known_force is not None
    assert found.known_moment is not None
    after = replace(of_all, force=of_all.force - found.known_force, moment=of_all.moment - found.known_moment)
    return scored(found, force, moment, verdict=found.verdict.level), scored(after, force, moment)


def row(kind: str, method: str, seeds: range, jobs: int) -> dict[str, str]:
    """A line of the table."""
    both = list(each(partial(scores, on_body=KINDS[kind], method=method), seeds, jobs))
    ratio = np.array([a.over for a, _ in both])
    gain = np.array([[a.error(part) / b.error(part) for part in (FORCE, MOMENT)] for a, b in both])
    inside = np.mean([a.inside for a, _ in both])
    ok = np.array([a.verdict == "ok" for a, _ in both])
    over, less = np.median(ratio, 0), np.median(gain, 0)
    return {
        "known": kind, "method": method, "force, error over claim": f"{over[0]:.2f}",
        "moment, error over claim": f"{over[1]:.2f}", "largest of both": f"{ratio.max():.2f}",
        "95 % interval holds (%)": f"{100 * inside:.1f}", "force over afterwards": f"{less[0]:.2f}",
        "moment over afterwards": f"{less[1]:.2f}", "ok": f"{ok.sum()} of {len(ok)}",
        "silently wrong": silent_share(a.silent for a, _ in both),
    }  # fmt: skip


def main() -> None:
    """Draw, estimate, and write the page."""
    given = asked("evidence.drawn.known_loads", __doc__, count=20, seed=400, jobs=2)
    seeds = range(given.seed, given.seed + given.count)
    rows = [row(kind, method, seeds, given.jobs) for kind in KINDS for method in ("smoother", "savgol")]
    what = (__doc__ or "").split("]", 3)[3].strip()
    paged(
        given.output, "known_loads", "Loads beside known ones", f"`{given.command}`", what, RULE, table(rows)
    )


if __name__ == "__main__":
    main()
