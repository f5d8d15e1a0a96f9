"""The page of drawn records: shares with exact intervals, by what was drawn, and what asks for caution."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import t

from evidence.calibration.distributions import WORDS
from evidence.calibration.judged import PATIENCE, Outcome
from evidence.judged import LOADS, NEAR, interval, unbanded
from evidence.written import tabled

Test = Callable[[Outcome], bool]
SHARES: dict[str, Test] = {
    "ok": lambda o: o.verdict == "ok",
    "ok and right": lambda o: o.verdict == "ok" and not o.silent,
    "silently wrong": lambda o: o.silent,
    "of these beyond twice the claim": lambda o: o.beyond_claim,
    "of these beyond twice the plain route": lambda o: o.beyond_witness,
    "of these under a body told wrong, and not said so": lambda o: o.silent and o.drawn["told"] == "wrong",
    "of these under blows": lambda o: o.silent and o.drawn["load"] == "impacts",
    "`ok`, and beyond twice the claim at all frequencies": lambda o: unbanded(o.verdict, o.plain),
    "needlessly degraded": lambda o: o.needless,
    "of these within at all frequencies": lambda o: o.needless and o.worst_plain <= NEAR,
    "degraded": lambda o: o.verdict == "degraded",
    "refused": lambda o: o.verdict == "refused",
    "crashed": lambda o: o.verdict == "crashed",
    "stopped": lambda o: o.verdict == "stopped",
}
GROUPS = {"load": "load", "error": "errors", "told": "body told"}
HEADS = "drawn", "records", "silent", "needlessly degraded"
COUNTED = "silently wrong", "needlessly degraded"
MOST = 8  # findings in the table
ABOUT = """\
`{command}`: {count} records, numbers 0 to {last} of seed {seed}. Record i is drawn from
`default_rng([seed, i])` and estimated as it comes.

{words}

The truth is integrated by DOP853 at a relative tolerance of 1e-9, begins anew at every step and blow, and
shares no code with the estimator. Force and moment are those at the instant of a sample, of a blow or a
jump the mean over one.

*Silently wrong*: the verdict is `ok`, and the rms error of force or moment is too large. It is so within
the band (up to `band` Hz), over the central three quarters, beyond twice its rms claim, or beyond twice
that of the plain route beside it (the witness). Where a band holds fewer than 13 numbers, and chance alone
makes one error twice another, that is taken at all frequencies. Beyond the band a result claims nothing of
a load that it does not name: see the lines *at all frequencies*. Ends of a record count least, so that
nothing faster leaks into a band.
*Needlessly degraded*: both errors are within {near} times their claims; where no moment is given, the force.
Every record counts once. Intervals: 95 %, of shares by Clopper and Pearson, of coverage over records. An
estimate is stopped after {patience:.0f} s of CPU. CPU times are measured beside other work."""


def coverage(of: Sequence[Outcome], load: int) -> str:
    """Share of components in their 95 % intervals, a record counts once, and its interval over records."""
    inside = np.array([o.inside[load] for o in of])
    inside = 100 * inside[np.isfinite(inside)]
    if len(inside) < 2:
        return ""
    half = t.ppf(0.975, len(inside) - 1) * inside.std(ddof=1) / np.sqrt(len(inside))
    low, high = inside.mean() - half, inside.mean() + half
    return f"{inside.mean():.1f} % ({low:.1f} to {high:.1f}), {len(inside)} records"


def quantiles(of: Sequence[Outcome], part: float) -> str:
    """A quantile of the error over the claim, of force and moment."""
    values = np.array([o.over for o in of]).T
    known = (v[np.isfinite(v)] for v in values)
    return ", ".join(f"{np.quantile(v, part):.2f}" if len(v) else "-" for v in known)


def summary(of: Sequence[Outcome]) -> str:
    """All records at a glance."""
    counts = {name: sum(map(test, of)) for name, test in SHARES.items()}
    rows = [
        [name, f"{n} of {len(of)}", f"{100 * n / len(of):.1f} % ({interval(n, len(of))})"]
        for name, n in counts.items()
    ]
    ok, seconds = [o for o in of if o.verdict == "ok"], np.array([o.seconds for o in of])
    for load, name in enumerate(LOADS):
        rows.append([f"{name}: in 95 % intervals of `ok` records", "", coverage(ok, load)])
    told = f"{quantiles(of, 0.5)}; {quantiles(of, 0.9)}"
    rows.append(["error over claim, force and moment: median; 90 % below", "", told])
    rows.append(["CPU (s): median, longest", "", f"{np.median(seconds):.1f}, {seconds.max():.1f}"])
    return tabled(("", "records", "share (95 % interval)"), rows)


def group_row(name: str, of: Sequence[Outcome]) -> list[str]:
    """Some records in the table by what was drawn."""
    return [name, str(len(of)), *(str(sum(map(SHARES[what], of))) for what in COUNTED)]


def by_drawn(of: Sequence[Outcome]) -> str:
    """The table by all that was drawn."""
    rows = []
    for key, title in GROUPS.items():
        values = sorted({str(o.drawn[key]) for o in of})
        rows += [group_row(f"{title}: {v}", [o for o in of if str(o.drawn[key]) == v]) for v in values]
    return tabled(HEADS, [*rows, group_row("all", of)])


def findings(of: Sequence[Outcome]) -> str:
    """The findings that degraded records hold most often, notes among them, needless ones first."""
    degraded = [o for o in of if o.verdict == "degraded"]
    needless = Counter(code for o in degraded if o.needless for code in set(o.degrading))
    alone = Counter(o.degrading[0] for o in degraded if o.needless and len(set(o.degrading)) == 1)
    every = Counter(code for o in degraded for code in set(o.degrading))
    rows = [[f"`{code}`", *map(str, (n, alone[code], every[code]))] for code, n in needless.most_common(MOST)]
    return tabled(("finding", "in needlessly degraded", "as their only one", "in all degraded"), rows)


def page(of: Sequence[Outcome], seed: int, command: str) -> tuple[str, ...]:
    """The parts of the page."""
    words = tabled(("drawn", "from"), [[name, text] for name, text in WORDS.items()])
    about = ABOUT.format(
        command=command, count=len(of), last=len(of) - 1, seed=seed, words=words, near=NEAR, patience=PATIENCE
    )
    wrong = ", ".join(str(o.number) for o in of if o.silent) or "none"
    return (
        about, summary(of), f"Silently wrong: records `{wrong}`.", "By what was drawn:", by_drawn(of),
        "What degrades in vain:", findings(of),
    )  # fmt: skip
