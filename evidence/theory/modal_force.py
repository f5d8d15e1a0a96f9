"""Forces on the modes of a bending plate, and loads of one resultant told apart by them, beside the truth.

    python -m evidence.theory.modal_force -o docs [--count 20] [--seed 0] [--jobs 2]

A plate of 40 masses on springs, softest at about 50 Hz, flies, turns and bends for a second. Three loads
of 2 to 40 Hz act on its nodes: one in its middle, one of the same force spread over its corners, and a twist
that has no resultant. Body axes, DOP853, no damping. Its stiffness is told, and the modal level asked
for. All errors and claims count for all frequencies. Above: the share of records beyond 1.3.

A prior of order n expects of a load beyond its band what these loads, which end at 40 Hz, do not have.
Tuned without fault, the force would err by (1 - 5 / (2 n + 4))^1/2 of its claim: 0.83 at order 6, 0.76 at 4,
0.61 at 2.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from evidence.drawn.records.bent_plate import flown
from evidence.judged import (
    LOADS,
    RULE,
    over_claim,
    rms,
    scores,
    silent_share,
    silently_wrong,
)
from evidence.written import asked, each, paged, table
from forceid.config import load_settings
from forceid.estimation.run import estimate_recording
from forceid.records import Array, deviation

NOISE = ((2e-4, 500.0), (1e-4, 1000.0), (1e-3, 250.0))  # m, Hz
NOISE_AND_MARKERS = tuple((*noise, markers) for noise in NOISE for markers in (40, 8))
ABOVE = 1.3  # error over claim that counts as above it
CLAIMED = (*LOADS, "modal", "loads")


def record_score(seed: int, case: tuple[float, float, int]) -> dict[str, Any]:
    """One record: error over claim of forces on modes and of loads, and their sizes."""
    recording, truth, pattern = flown(seed, case[0], case[1], case[2])
    loads = [
        {
            "name": f"load {k}",
            "pattern": {recording.body.node[i]: tuple(p[i]) for i in np.flatnonzero(p.any(1))},
        }
        for k, p in enumerate(pattern)
    ]
    found = estimate_recording(recording, load_settings(model="modal", load=loads))
    ratios = scores(found, [recording.truth[name] for name in LOADS])
    row = {"ok": found.verdict.level == "ok", "modes": 0} | dict(zip(LOADS, ratios["plain"], strict=True))

    def over(error: Array, cov: Array) -> float:
        return over_claim(error, deviation(cov), np.full(error.shape[1], np.inf), case[1])

    if found.modal is not None:
        g = np.einsum("kna,tl,lna->tk", found.modal.shape, truth, pattern)
        row |= {"modes": g.shape[1], "modal": over(found.modal.force - g, found.modal.cov)}
    if not found.loads.null_space.shape[1]:
        error = found.loads.load - truth
        row |= {"loads": over(error, found.loads.load_cov), "off": rms(error) / rms(truth)}
    judged = [*ratios["over"], *(row[name] for name in CLAIMED[2:] if name in row)]
    return row | {"silent": silently_wrong(found.verdict.level, judged, ratios["beside"])}


def case_line(case: tuple[float, float, int], seeds: range, jobs: int) -> dict[str, str]:
    """A line of the table."""
    rows = list(each(partial(record_score, case=case), seeds, jobs))
    said: dict[str, str] = {
        "noise (mm), rate (Hz), markers": f"{1e3 * case[0]:.1f}, {case[1]:.0f}, {case[2]}",
        "modes told": f"{np.median([r['modes'] for r in rows if r['modes']] or [0]):.0f}",
    }
    for name in CLAIMED:
        ratio = np.array([r[name] for r in rows if name in r] or [np.nan])
        said |= {
            f"{name}: error over claim": f"{np.median(ratio):.2f} ({ratio.min():.2f} to {ratio.max():.2f})",
            f"{name}: above": f"{100 * np.mean(ratio >= ABOVE):.0f} %",
        }
    off = [100 * r["off"] for r in rows if "off" in r]
    return said | {
        "loads off by": f"{np.median(off or [np.nan]):.1f} %",
        "ok": f"{sum(r['ok'] for r in rows)}",
        "silently wrong": silent_share(r["silent"] for r in rows),
    }


def main() -> None:
    """Draw, estimate, and write the page."""
    given = asked("evidence.theory.modal_force", __doc__, count=20, seed=0, jobs=2)
    seeds = range(given.seed, given.seed + given.count)
    rows = [case_line(case, seeds, given.jobs) for case in NOISE_AND_MARKERS]
    what, title = (__doc__ or "").split("]", 3)[3].strip(), "Forces on modes"
    paged(given.output, "modal_force", title, f"`{given.command}`", what, RULE, table(rows))


if __name__ == "__main__":
    main()
