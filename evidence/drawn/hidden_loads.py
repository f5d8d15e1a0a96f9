"""Loads that a record may hide: whether a result that calls itself ok is wrong and does not say so.

    python -m evidence.drawn.hidden_loads -o docs [--count 250] [--seed 18] [-j 2] [--only KIND...]

Drawn rigid bodies with 3 to 10 markers at 50 to 1000 Hz, noise of 0.1 to 2 mm, stated or not. Beside a smooth
load, or none: oscillating loads at 5 to 45 % of the sample rate, steps, events that last a hundredth of the
record, a wheel inside the body that turns at a constant rate or spins up, nothing. Their sizes are 0.1 to 10
times what just shows (a wheel to 100): seven standard deviations of the noise, beside the start and a
constant load, which are unknown. The torque that spins a wheel up is a moment like any other.

A result is silently wrong where its verdict is ok and the error of a load within its band is more than twice
what it claims, rms over the axes of the load and the central three quarters of the record; or where an
oscillating load beyond the band, larger than `hidden_load` there, was not found.
"""

from __future__ import annotations

import sys
import time as clock
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import interp1d
from scipy.signal import butter, sosfiltfilt

from evidence.drawn.records.hidden_bodies import KINDS, DrawnRecord, draw_record
from evidence.drawn.records.scored import judged_part
from evidence.written import asked, each, paged, tabled
from forceid.config import load_settings
from forceid.errors import EstimationError
from forceid.estimation.run import estimate_recording
from forceid.records import Array, Estimate

WRONG = 2.0  # times the claim
COLUMNS = (
    "force", "moment", "force_plain", "moment_plain", "unseen", "load", "times", "stated", "smooth",
    "samples", "seconds", "orders", "band",
)  # fmt: skip
HEADS = (
    "kind", "records", "ok", "degraded", "refused", "silently wrong", "error over claim", "largest while ok"
)  # fmt: skip
ABOUT = """\
`{command}`: drawn rigid bodies with 3 to 10 markers at 50 to 1000 Hz, 150 to 700 samples, noise of 0.1 to \
2 mm, stated to half of them. Half of them are under smooth forces and moments beside. *oscillation*: at 5 \
to 45 % of the sample rate; *step*: for good, anywhere in the record; *event*: a hundredth of the record \
long; *nothing*: the smooth loads alone.
*wheel*: an angular momentum inside the body, up to half of what the body has, of which nothing is stated. It
is constant or spins up, and the torque that spins it up counts as a moment. Sizes from 0.1 to 10 times \
what just shows, of wheels to 100 times.

*silently wrong*: the verdict is `ok`, and within the band (up to `band` Hz) the rms error of a force or
moment is more than twice its claim. Or a wave beyond the band is larger than `hidden_load` and was not \
found. That is what half of all records would not show, so that one little larger may go unseen too. Error \
over claim: of force and moment within the band, the median, and the largest of all that call themselves
`ok`."""


def slow_part(error: Array, band: float, rate: float) -> Array:
    """What of an error (time,) lies below a frequency, its ends weighed least, so that no faster part leaks.

    Of less than three cycles: its mean.
    """
    weight = np.sin(np.pi * np.linspace(0, 1, len(error))) ** 4
    if band * len(error) / rate < 3.0:
        return np.full(1, weight @ error / weight.sum())
    if band < 0.45 * rate:
        error = sosfiltfilt(butter(4, 2 * band / rate, output="sos"), error * weight)
        error = error / np.sqrt(np.mean(weight**2))
    return error


def amplitude_of(error: Array, frequency: float, t: Array) -> float:
    """Amplitude of the wave of a frequency in an error (time,), the rest of which is slow or noise."""
    weight = np.sin(np.pi * (t - t[0]) / np.ptp(t)) ** 4
    return float(2 * np.abs(weight @ (error * np.exp(-2j * np.pi * frequency * t))) / weight.sum())


def without_wave(error: Array, case: DrawnRecord, t: Array) -> Array:
    """An error (time, 3) without the wave that is beyond the band, which is judged by its amplitude."""
    w = 2 * np.pi * float(case.facts["frequency"])
    A = np.stack([np.cos(w * t), np.sin(w * t)], 1)
    return np.asarray(error - A @ np.linalg.lstsq(A, error, rcond=None)[0])


def judge_record(case: DrawnRecord, found: Estimate) -> dict[str, float]:
    """Error over claim within the band, and the amplitude of an unseen wave beyond it over hidden_load."""
    t, hidden = case.recording.motion.time, found.hidden
    assert hidden is not None
    rate, scores = 1 / float(np.median(np.diff(t))), {}
    for first, name in enumerate(("force", "moment")):
        error = getattr(found, name) - case.load(name)
        std, band = (
            judged_part(getattr(found, f"{name}_std")),
            hidden.band[3 * first : 3 * first + 3],
        )
        slow, waves = error, case.kind == "oscillation" and case.facts["load"] == name
        if waves:
            slow = np.where(float(case.facts["frequency"]) > band, without_wave(error, case, t), error)
        parts = [np.mean(slow_part(judged_part(e), b, rate) ** 2) for e, b in zip(slow.T, band, strict=True)]
        scores[name] = float(np.sqrt(np.mean(np.array(parts) / (std**2).mean(0))))
        scores[f"{name}_plain"] = float(np.sqrt(np.mean((judged_part(error) / std) ** 2)))
        if waves:
            frequency, scores["unseen"] = float(case.facts["frequency"]), 0.0
            for axis, beyond in enumerate(frequency > band):
                curve = interp1d(np.log(hidden.frequency), np.log(hidden.amplitude[:, 3 * first + axis]))
                least = float(np.exp(curve(np.log(frequency))))
                if beyond:
                    left = amplitude_of(error[:, axis], frequency, t)
                    scores["unseen"] = max(scores["unseen"], left / least)
    return scores


def run(case: DrawnRecord) -> dict[str, Any]:
    """What came out of a record, and whether it is silently wrong."""
    began = clock.perf_counter()
    try:
        found = estimate_recording(case.recording, load_settings(model="rigid"))
    except EstimationError as e:
        return {"verdict": "refused", "reasons": [str(e)], "wrong": False, "kind": case.kind} | case.facts
    row: dict[str, Any] = {"verdict": found.verdict.level, "reasons": list(found.verdict.reasons)}
    row |= judge_record(case, found)
    row["orders"] = [found.tuned[f"{name}_order"] for name in ("force", "moment")]
    row["band"] = found.hidden.band.round(2).tolist() if found.hidden else []
    off = max(row["force"], row["moment"]) > WRONG or row.get("unseen", 0.0) > 1.0
    row["wrong"] = bool(row["verdict"] == "ok" and off)
    return row | {"kind": case.kind, "seconds": clock.perf_counter() - began} | case.facts


def record_line(row: dict[str, Any]) -> str:
    """A row on one line."""
    values = (
        f"{n}={row[n]:.3g}" if isinstance(row[n], float) else f"{n}={row[n]}" for n in COLUMNS if n in row
    )
    return f"{row['kind']:12} {row['verdict']:9} {'WRONG' if row['wrong'] else '     '} {' '.join(values)}"


def judged_record(seed: int, k: int, kinds: list[str]) -> dict[str, Any]:
    """What came out of record k."""
    return run(draw_record(kinds[k % len(kinds)], np.random.default_rng([seed, k]))) | {"record": k}


def counts_of_kind(rows: list[dict[str, Any]], kind: str) -> list[str]:
    """A kind of load in the table."""
    of = [r for r in rows if kind in (r["kind"], "all")]
    level = [r["verdict"] for r in of]
    scores = [r[name] for r in of if "force" in r for name in ("force", "moment")]
    ok = [r[name] for r in of if r["verdict"] == "ok" for name in ("force", "moment")]
    numbers = len(of), *map(level.count, ("ok", "degraded", "refused")), sum(r["wrong"] for r in of)
    return [kind, *map(str, numbers), f"{np.median(scores):.2f}", f"{max(ok, default=np.nan):.2f}"]


def main() -> int:
    """Draw, estimate, judge, write the table."""
    taken = {"count": 250, "first": 0, "seed": 18, "jobs": 1, "only": KINDS}
    given = asked("evidence.drawn.hidden_loads", __doc__, **taken)
    which = range(given.first, given.first + given.count)
    rows = list(each(partial(judged_record, given.seed, kinds=given.only), which, given.jobs))
    wrong = [f"- record {r['record']}: `{record_line(r)}`" for r in rows if r["wrong"]]
    paged(
        given.output, "hidden_loads", "Loads that a record may hide", ABOUT.format(command=given.command),
        tabled(HEADS, [counts_of_kind(rows, kind) for kind in (*given.only, "all")]),
        *["Silently wrong:"] * bool(wrong), *["\n".join(wrong)] * bool(wrong),
    )  # fmt: skip
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
