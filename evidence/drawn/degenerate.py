"""Bodies whose mass lies on a point, a line or a plane: what `inspect` and `estimate` make of them, counted.

    python -m evidence.drawn.degenerate -o docs [--count 300] [--first 0]

Writes degenerate.md. Every recording is drawn from its number alone; each is looked at in a process of its
own, through a file, under a limit of time.
"""

from __future__ import annotations

import resource
import tempfile
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from evidence.drawn.records.degenerate_bodies import ENOUGH, DrawnBody, draw_body
from evidence.judged import LOADS, RULE, UNKNOWN, Judged, scores, silent_share
from evidence.written import asked, each, paged, tabled
from forceid.config import Settings
from forceid.errors import ForceIdError
from forceid.estimation.inspection import inspect_recording
from forceid.estimation.run import estimate_recording
from forceid.files.result import write_result
from forceid.files.stored.hdf5 import read_motion, write_motion

PATIENCE = 30  # s of processor time that one recording may take, inspected and estimated
WAIT = 600.0  # s of wall time after which a process counts as stopped, however busy the machine is
TEXT = """Drawn bodies, each seen through a file by `inspect` and `estimate` in a process of its own.
Their mass lies on a point, a line, a plane or in space. It is stated by nodes, as a matrix of any rank, or as
a total. Up to eleven masses are marked or not, and one to six markers sit on them, among them, around them
or on a line of their own. A third is thrown, and some lines bend. Records have 2 to 250 frames and noise of
0.05 to 1.6 mm, stated or not. Readings are lost in a third. The truth is summed over the nodes. A
component is determined where the geometry of masses and markers says so and 12 frames show every marker.
Refused are bodies whose mass center the markers do not show; an error, of one line, is a record that is
too short, or a total mass without inertia."""
SUMS = 1e-9  # N, N m: what sums over nodes may be off, of loads that are claimed to be none


@dataclass(frozen=True)
class BodyOutcome(Judged):
    """What became of a recording: verdict or error, and how far off force and moment are where given."""

    seed: int
    kind: str
    verdict: str
    said: str = ""
    missing: tuple[str, ...] = ()
    undue: tuple[str, ...] = ()
    over: tuple[float, ...] = UNKNOWN
    beside: tuple[float, ...] = UNKNOWN
    seconds: float = float(PATIENCE)


def judged_body(seed: int, drawn: DrawnBody, path: Path) -> BodyOutcome:
    """What one recording comes to: verdict, what was said, components missing and undue, scores."""
    write_motion(path, drawn.recording)
    expected = {"force": drawn.force, "moment": drawn.moment and drawn.force}
    try:
        recording = read_motion(path)
        inspect_recording(recording, Settings())
        found = estimate_recording(recording, Settings())
        write_result(path.with_suffix(".out.h5"), found, recording)
    except ForceIdError as e:
        due = tuple(name for name, shows in expected.items() if shows)
        return BodyOutcome(seed, drawn.kind, "error", str(e), due)
    given = {name: bool(np.isfinite(getattr(found, name)).any()) for name in expected}
    missing = tuple(name for name, due in expected.items() if due and not given[name])
    undue = tuple(name for name, due in expected.items() if given[name] and not due)
    found = replace(found, wrench_cov=found.wrench_cov + SUMS**2 * np.eye(6))
    off = scores(found, [recording.truth[name] for name in LOADS])
    said, ratios = "; ".join(found.verdict.reasons), (off["over"], off["beside"])
    return BodyOutcome(seed, drawn.kind, found.verdict.level, said, missing, undue, *ratios)


def work(seed: int, folder: str, pipe: Any) -> None:
    """Send the outcome of one recording."""
    warnings.simplefilter("error", RuntimeWarning)
    drawn, began = draw_body(seed), time.process_time()
    resource.setrlimit(resource.RLIMIT_CPU, (int(began) + PATIENCE, int(began) + PATIENCE))
    try:
        found = judged_body(seed, drawn, Path(folder) / f"{seed}.h5")
    except Exception as e:  # what a user would see as unexpected
        frames = [f for f in traceback.extract_tb(e.__traceback__) if "forceid/" in f.filename]
        where = " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in frames[:-4:-1])
        found = BodyOutcome(seed, drawn.kind, "unexpected", f"{type(e).__name__}: {e} {where}")
    pipe.send(replace(found, seconds=time.process_time() - began))


def run_seed(seed: int, folder: str) -> BodyOutcome:
    """The outcome of a seed, in a process that is ended when it takes too long."""
    context = get_context("fork")
    ours, theirs = context.Pipe(False)
    child = context.Process(target=work, args=(seed, folder, theirs))
    child.start()
    theirs.close()
    try:
        found = ours.recv() if ours.poll(WAIT) else None
    except EOFError:  # ended by its limit
        found = None
    child.kill()
    child.join()
    return found or BodyOutcome(seed, draw_body(seed).kind, "too long")


def median_and_middle(values: list[float]) -> str:
    """Median and the middle 90 % of numbers."""
    known = np.array([v for v in values if np.isfinite(v)])
    if not len(known):
        return "none"
    low, mid, high = np.quantile(known, (0.05, 0.5, 0.95))
    return f"{mid:.2f} ({low:.2f} to {high:.2f})"


def outcome_counts(found: list[BodyOutcome]) -> str:
    """What the outcomes add up to."""
    verdicts = Counter(o.verdict for o in found)
    rows = {
        "recordings": len(found),
        "unexpected errors": verdicts["unexpected"],
        f"over {PATIENCE:.0f} s": verdicts["too long"],
        "determined, and not given": sum(bool(o.missing) for o in found),
        f"given, and not determined by {ENOUGH} whole frames": sum(bool(o.undue) for o in found),
        "silently wrong": silent_share(o.silent for o in found),
        "error over claim of the force, median (5 to 95 %)": median_and_middle([o.over[0] for o in found]),
        "error over claim of the moment, median (5 to 95 %)": median_and_middle([o.over[1] for o in found]),
        "time of inspect and estimate, s, median (5 to 95 %)": median_and_middle([o.seconds for o in found]),
        **{f"verdict {name}": count for name, count in sorted(verdicts.items())},
    }
    return tabled(("what", "found"), [[name, str(value)] for name, value in rows.items()])


def main() -> None:
    """Count, and write the page."""
    given = asked("evidence.drawn.degenerate", __doc__, count=300, first=0)
    with tempfile.TemporaryDirectory() as folder:
        seeds = range(given.first, given.first + given.count)
        found = list(each(partial(run_seed, folder=folder), seeds, 1))
    title = "Bodies on points, lines and planes"
    paged(given.output, "degenerate", title, f"`{given.command}`", TEXT, RULE, outcome_counts(found))


if __name__ == "__main__":
    main()
