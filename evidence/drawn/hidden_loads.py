"""Loads that a record may hide: whether a result that calls itself ok is wrong and does not say so.

    python -m evidence.drawn.hidden_loads -o docs [--count 250] [--seed 18] [-j 2] [--only KIND...]

Drawn rigid bodies with 3 to 10 markers at 50 to 1000 Hz, noise of 0.1 to 2 mm, stated or not. Beside a smooth
load, or none: oscillating loads at 5 to 45 % of the sample rate, steps, events that last a hundredth of the
record, a wheel inside the body that turns at a constant rate or spins up, nothing. Their sizes are 0.1 to 10
times what just shows (a wheel to 100): seven standard deviations of the noise, beside the start and a
constant load, which are unknown. The torque that spins a wheel up is a moment like any other.

A wave beyond the band that is larger than `hidden_load` there, and was not found, is counted apart.
"""

from __future__ import annotations

import sys
import time as clock
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import interp1d

from evidence.drawn.records.hidden_bodies import KINDS, DrawnRecord, draw_record
from evidence.judged import LOADS, RULE, scores, silent_share, silently_wrong
from evidence.written import asked, each, paged, tabled
from forceid.config import load_settings
from forceid.errors import EstimationError
from forceid.estimation.run import estimate_recording
from forceid.records import Array, Estimate

COLUMNS = "force", "moment", "force_beside", "moment_beside", "unseen", "load", "times"
HEADS = (
    "kind", "records", "ok", "degraded", "refused", "silently wrong", "`ok`, a wave missed",
    "error over claim", "largest while ok",
)  # fmt: skip
ABOUT = """\
`{command}`: drawn rigid bodies with 3 to 10 markers at 50 to 1000 Hz, 150 to 700 samples, noise of 0.1 to \
2 mm, stated to half of them. Half of them are under smooth forces and moments beside. *oscillation*: at 5 \
to 45 % of the sample rate; *step*: for good, anywhere in the record; *event*: a hundredth of the record \
long; *nothing*: the smooth loads alone. Steps and events are judged as means over a sample.
*wheel*: an angular momentum inside the body, up to half of what the body has, of which nothing is stated. It
is constant or spins up, and the torque that spins it up counts as a moment. Sizes from 0.1 to 10 times \
what just shows, of wheels to 100 times.

*a wave missed*: one beyond the band is larger than `hidden_load` and was not found. That is what half of \
all records would not show, so that one little larger may go unseen too. Error over claim: of force and \
moment within the band, the median, and the largest of all that call themselves `ok`."""


def amplitude_of(error: Array, frequency: float, t: Array) -> float:
    """Amplitude of the wave of a frequency in an error (time,), the rest of which is slow or noise."""
    weight = np.sin(np.pi * (t - t[0]) / np.ptp(t)) ** 4
    return float(2 * np.abs(weight @ (error * np.exp(-2j * np.pi * frequency * t))) / weight.sum())


def unseen_wave(case: DrawnRecord, found: Estimate) -> float:
    """Amplitude of an oscillation beyond the band that is left in the error, over what hides there."""
    if case.kind != "oscillation":
        return 0.0
    name, frequency, hidden = str(case.facts["load"]), float(case.facts["frequency"]), found.hidden
    assert hidden is not None
    error, first, most = getattr(found, name) - case.load(name), 3 * LOADS.index(name), 0.0
    for axis in np.flatnonzero(frequency > hidden.band[first : first + 3]):
        curve = interp1d(np.log(hidden.frequency), np.log(hidden.amplitude[:, first + axis]))
        least = float(np.exp(curve(np.log(frequency))))
        most = max(most, amplitude_of(error[:, axis], frequency, found.time) / least)
    return most


def run(case: DrawnRecord) -> dict[str, Any]:
    """What came out of a record, whether it is silently wrong, and whether it missed a wave."""
    began, row = clock.perf_counter(), {"kind": case.kind, "wrong": False, "missed": False} | case.facts
    try:
        found = estimate_recording(case.recording, load_settings(model="rigid"))
    except EstimationError as e:
        return row | {"verdict": "refused", "reasons": [str(e)]}
    left, level = unseen_wave(case, found), found.verdict.level
    ratios = scores(found, [case.load(name) for name in LOADS])
    for of, tail in (("over", ""), ("plain", "_plain"), ("beside", "_beside")):
        row |= {f"{name}{tail}": ratio for name, ratio in zip(LOADS, ratios[of], strict=True)}
    return row | {
        "verdict": level, "reasons": list(found.verdict.reasons), "unseen": left,
        "wrong": silently_wrong(level, ratios["over"], ratios["beside"]),
        "missed": level == "ok" and left > 1,
        "orders": [found.tuned[f"{name}_order"] for name in LOADS],
        "band": found.hidden.band.round(2).tolist() if found.hidden else [],
        "seconds": clock.perf_counter() - began,
    }  # fmt: skip


def record_line(row: dict[str, Any]) -> str:
    """A row on one line."""
    values = (
        f"{n}={row[n]:.3g}" if isinstance(row[n], float) else f"{n}={row[n]}" for n in COLUMNS if n in row
    )
    said = "WRONG" if row["wrong"] else "missed" * row["missed"]
    return f"{row['kind']:12} {row['verdict']:9} {said:6} {' '.join(values)}"


def judged_record(seed: int, k: int, kinds: list[str]) -> dict[str, Any]:
    """What came out of record k."""
    return run(draw_record(kinds[k % len(kinds)], np.random.default_rng([seed, k]))) | {"record": k}


def counts_of_kind(rows: list[dict[str, Any]], kind: str) -> list[str]:
    """A kind of load in the table."""
    of = [r for r in rows if kind in (r["kind"], "all")]
    level = [r["verdict"] for r in of]
    scores = [r[name] for r in of if "force" in r for name in LOADS]
    ok = [r[name] for r in of if r["verdict"] == "ok" for name in LOADS]
    numbers = [str(n) for n in (len(of), *map(level.count, ("ok", "degraded", "refused")))]
    shares = silent_share(r["wrong"] for r in of), str(sum(r["missed"] for r in of))
    return [kind, *numbers, *shares, f"{np.median(scores):.2f}", f"{max(ok, default=np.nan):.2f}"]


def main() -> int:
    """Draw, estimate, judge, write the table."""
    taken = {"count": 250, "first": 0, "seed": 18, "jobs": 1, "only": KINDS}
    given = asked("evidence.drawn.hidden_loads", __doc__, **taken)
    which = range(given.first, given.first + given.count)
    rows = list(each(partial(judged_record, given.seed, kinds=given.only), which, given.jobs))
    wrong = [f"- record {r['record']}: `{record_line(r)}`" for r in rows if r["wrong"] or r["missed"]]
    paged(
        given.output, "hidden_loads", "Loads that a record may hide", ABOUT.format(command=given.command),
        RULE, tabled(HEADS, [counts_of_kind(rows, kind) for kind in (*given.only, "all")]),
        *["Silently wrong, or a wave missed:", "\n".join(wrong)] * bool(wrong),
    )  # fmt: skip
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
