"""Persons whose markers stay on segments: force and moment beside the best low-pass, claims, and time.

    python -m evidence.drawn.people -o FOLDER [--seeds 8]

Drawn by `evidence.drawn.records.person`, estimated with model = "segments", whose claims have the errors that
joint gaps show. The Butterworth filter has the cut that is best on the truth, by axis, and is told beside the
6 Hz one. By kind of motion: the geometric mean over persons and axes; error over claim: rms over rms.
"""

from __future__ import annotations

from functools import partial
from time import process_time
from typing import Any

import numpy as np

from evidence.drawn.records.person import Skin, person
from evidence.drawn.records.scored import low_passed
from evidence.judged import LOADS, scores, silently_wrong
from evidence.written import asked, each, paged, table
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Array

TASKS = "walk", "run", "squat", "jump"
EDGE_FRAMES = 20  # frames at either end that are not judged
ABOUT = """\
Persons of 12 segments and 52 markers, 5 s at 100 Hz, on whose bones skin and mass tables err; {seeds} a kind
of motion, tracks raw or low-passed at 12 Hz. Errors of force and moment with `model = "segments"` are
told over that of the best Butterworth filter, its cut chosen on the truth by axis, and over that of one of
6 Hz. They are geometric means over persons and axes. Then the error over claim of all pooled, the most of it,
what is `ok` or [silently wrong](calibration.md), and CPU a second."""


def off(values: Array) -> Array:
    """Rms (axis,) without the ends."""
    return np.asarray(np.sqrt((values[EDGE_FRAMES:-EDGE_FRAMES] ** 2).mean(0)))


def kind_rows(kind: tuple[str, float], seeds: int) -> list[dict[str, Any]]:
    """Force and moment of one kind of motion."""
    task, cut = kind
    found: dict[str, list[Array]] = {"force": [], "moment": []}
    spent, ok, silent = 0.0, 0, []
    for seed in range(seeds):
        recording, began = person(seed, task, skin=Skin(cut=cut)), process_time()
        estimate = estimate_recording(recording, load_settings(model="segments"))
        spent = max(spent, (process_time() - began) / float(np.ptp(recording.motion.time)))
        of = scores(estimate, [recording.truth[load] for load in LOADS])
        ok += estimate.verdict.level == "ok"
        silent.append(silently_wrong(estimate.verdict.level, of["over"], of["beside"]))
        rivals = [low_passed(recording, hertz) for hertz in np.arange(1.5, 25.0, 0.5)]
        six = low_passed(recording, 6.0)
        for load, rows in found.items():
            truth, std = recording.truth[load], getattr(estimate, f"{load}_std")
            best = np.min([off(rival[load] - truth) for rival in rivals], axis=0)
            rows.append(
                np.array([off(getattr(estimate, load) - truth), best, off(six[load] - truth), off(std)])
            )
    said = {"ok": f"{ok}/{seeds}", "silently wrong": f"{sum(silent)}/{seeds}", "CPU (s)": spent}
    return [one_row(task, cut, load, np.array(rows)) | said for load, rows in found.items()]


def one_row(task: str, cut: float, load: str, rows: Array) -> dict[str, Any]:
    """A row of the table; rows (seed, kind of error, axis)."""
    error, best, six, claim = np.moveaxis(rows, 1, 0)
    ratio = error / claim
    return {
        "motion": task, "tracks": f"{cut:g} Hz" if cut else "raw", "load": load,
        "over the best cut": float(np.exp(np.log(error / best).mean())),
        "over 6 Hz": float(np.exp(np.log(error / six).mean())),
        "error over claim": float(np.sqrt((error**2 / (claim**2).mean(0)).mean())),
        "most": float(ratio.max()),
    }  # fmt: skip


def main() -> None:
    """Draw, estimate, and write the table."""
    given = asked("evidence.drawn.people", __doc__, seeds=8)
    kinds = [(task, cut) for task in TASKS for cut in (0.0, 12.0)]
    rows = [row for rows in each(partial(kind_rows, seeds=given.seeds), kinds, 1) for row in rows]
    about = ABOUT.format(seeds=given.seeds)
    paged(given.output, "people", "People in segments", f"`{given.command}`", about, table(rows))


if __name__ == "__main__":
    main()
