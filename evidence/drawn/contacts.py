"""Contacts from motions: whether stiffness, damping, friction and rolling resistance come back.

    python -m evidence.drawn.contacts [--count 12] [--seed 2301] [--jobs 2] [-o docs]

Balls that bounce, balls that are thrown along the ground and end up rolling, and blocks that ring on mounts,
drawn at random, with Coulomb's friction. Each is estimated from its markers, and a law of the ground is
fitted to the estimate; that of a rolling ball takes the ground as hard.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

import numpy as np

from evidence.drawn.records.contacts import DrawnContact, drawn_ball, drawn_block
from evidence.written import asked, each, paged, tabled
from forceid.config import load_settings
from forceid.errors import ForceIdError
from forceid.estimation.run import estimate_recording
from forceid.laws import fit_flights, law_setting
from forceid.significance import QUANTILE

KINDS = ("bounce", "roll", "block")
WORDS = {"1": "", "depth": "stiffness", "depth^1.5": "stiffness", "height": "height",
         "depth_rate": "damping", "depth*depth_rate": "damping"}  # fmt: skip
ABOUT = """\
Made by `{command}`. {count} balls bounce, {count} slide and then roll, and {count} blocks ring on mounts. \
Sizes, masses, grounds and throws are drawn; contacts last 8 to 30 ms at 100 to 250 Hz. The height of the \
ground is told in half. 6 to 12 markers have 0.1 to 0.5 mm of noise. Held: true coefficients within their \
interval of 95 %."""


@dataclass(frozen=True)
class JudgedContact:
    """A drawn motion and the law found: error of every coefficient over its deviation, and over its size."""

    kind: str
    off: dict[str, float]
    share: dict[str, float]
    seconds: float
    refused: str = ""


def run_contact(job: tuple[str, int, int]) -> JudgedContact:
    """One drawn motion, estimated and fitted."""
    kind, k, seed = job
    rng = np.random.default_rng([seed, KINDS.index(kind), k])
    drawn: DrawnContact = drawn_block(rng) if kind == "block" else drawn_ball(rng, kind == "roll")
    terms: dict[str, list[str]] = {}
    for component, term in (name.split(".", 1) for name in drawn.true):
        if term != "height" and not (kind == "roll" and component == "contact"):
            terms.setdefault(component, []).append(term)
    estimate = estimate_recording(drawn.recording, load_settings(model="rigid"))
    began = process_time()
    setting = law_setting({"law": terms, "ground": drawn.ground}, "law")
    try:
        law = fit_flights([("motion", estimate)], setting, "law")
    except ForceIdError as e:
        return JudgedContact(kind, {}, {}, process_time() - began, str(e))
    each_one = list(zip(law.name, law.value, law.std, strict=True))
    off = {n: float(v - drawn.true[n]) / s for n, v, s in each_one}
    share = {n: abs(float(v / drawn.true[n]) - 1) for n, v, _ in each_one if n != "contact.height"}
    return JudgedContact(kind, off, share, process_time() - began)


def word(name: str) -> str:
    """What a coefficient is called in the table."""
    component, term = name.split(".", 1)
    return WORDS[term] or component


def rows_of(kind: str, found: list[JudgedContact]) -> list[list[str]]:
    """A row for every coefficient of a kind."""
    own = [j for j in found if j.kind == kind]
    rows = []
    for name in dict.fromkeys(word(n) for j in own for n in j.off):
        off = np.array([z for j in own for n, z in j.off.items() if word(n) == name])
        share = [s for j in own for n, s in j.share.items() if word(n) == name]
        held = f"{(np.abs(off) < QUANTILE).sum()} of {len(off)}"
        median = f"{100 * np.median(share):.2g} %" if share else ""
        rows.append([kind, name, held, f"{np.sqrt(np.mean(off**2)):.2f}", median])
    return rows


def main() -> None:
    """Draw, estimate, fit, and write the page."""
    args = asked("evidence.drawn.contacts", __doc__, count=12, seed=2301, jobs=2)
    jobs = [(kind, k, args.seed) for k in range(args.count) for kind in KINDS]
    found = list(each(run_contact, jobs, args.jobs))
    heads = ("motion", "coefficient", "held", "error over claim", "error, median")
    refused = [j for j in found if j.refused]
    about = ABOUT.format(command=args.command, count=args.count)
    spent = {kind: np.median([j.seconds for j in found if j.kind == kind]) for kind in KINDS}
    said = ", ".join(f"{kind} {s:.0f} s" for kind, s in spent.items())
    after = f"A fit took, in the median: {said}. Refused: {len(refused)} of {len(found)}."
    if refused:
        after += " " + " ".join(sorted({f"*{j.kind}*: {j.refused}." for j in refused}))
    rows = [row for kind in KINDS for row in rows_of(kind, found)]
    paged(args.output, "contacts", "Contacts from motions", about, tabled(heads, rows), after)


if __name__ == "__main__":
    main()
