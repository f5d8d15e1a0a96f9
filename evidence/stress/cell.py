"""One cell of a stress map: the color that the trials of a method at one level of a failure add up to.

Each record is judged by the rule of drawn records and strangers (`evidence.judged`). Source: the
shared requirement that every verdict is accurate, degraded and said so, or refused and said why; silently
wrong is the only failure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Literal

import numpy as np

from evidence.judged import UNKNOWN, Judged, silently_wrong

Color = Literal["green", "pale", "amber", "grey", "red"]
TWICE = 2.0  # times the bound that an estimate may be off and be called accurate, not coarse
CAUTIOUS = ("refused", "degraded", "ok")  # among verdicts equally frequent, the first


@dataclass(frozen=True)
class Trial(Judged):
    """One record by one method: error, claimed deviation and bound of two quantities.

    Of a flight force and moment, rms in N and N m over the central three quarters, per axis; of a body in
    parts forces and motions, relative. NaN: not known, or not claimed. verdict:
    ok, degraded, refused or crashed; reason: the first. told: what the budget of the result says that the
    error of the input costs, where no motion reveals it. over: error over claim within the band that is
    claimed; beside: over the error of the witness there; codes: of findings that are more than a note.
    """

    verdict: str
    error: tuple[float, float]
    claimed: tuple[float, float]
    bound: tuple[float, float]
    reason: str = ""
    told: tuple[float, float] = (0.0, 0.0)
    over: tuple[float, ...] = UNKNOWN
    beside: tuple[float, ...] = UNKNOWN
    codes: tuple[str, ...] = ()

    @property
    def budgeted(self) -> bool:
        """Whether it would be silently wrong, but claim and budget together account for its errors."""
        if not (self.silent and any(self.told)):
            return False
        with np.errstate(divide="ignore", invalid="ignore"):
            widened = self.over * np.divide(self.claimed, np.hypot(self.claimed, self.told))
        return not silently_wrong(self.verdict, widened)


@dataclass(frozen=True)
class Cell:
    """Color; cause of a red one; pooled error over bound, and the worst record's error over claim (2,).

    silent: records that are silently wrong; needless: whether it is amber in vain; budgeted: whether it is
    amber for what its budget says alone; ok, degraded, refused: how many; reason: the most frequent; codes:
    of its findings.
    """

    color: Color
    cause: str
    over_bound: tuple[float, float]
    over_claim: tuple[float, float]
    silent: int
    needless: bool
    budgeted: bool
    ok: int
    degraded: int
    refused: int
    reason: str
    codes: tuple[str, ...] = ()


def judge_cell(trials: Sequence[Trial], names: tuple[str, str] = ("force", "moment")) -> Cell:
    """The cell of the trials of all seeds; names: of the two quantities.

    red: an error that is no error of forceid's, or any record silently wrong. Otherwise by the more frequent
    verdict: green, or pale beyond twice the bound; amber where degraded and said so, or where the budget of
    the result, newtons per percent and per millimeter, accounts for an input that is wrong; grey where
    refused.

    >>> honest = Trial("ok", (0.1, 0.01), (0.1, 0.01), (0.08, 0.008), over=(1.0, 1.0))
    >>> boastful = Trial("ok", (0.1, 0.01), (0.01, 0.01), (0.08, 0.008), over=(10.0, 1.0))
    >>> judge_cell([honest]).color, judge_cell([boastful]).color
    ('green', 'red')
    """
    verdicts = [t.verdict for t in trials]
    ok = [t for t in trials if t.verdict == "ok"]
    wrong = [t for t in trials if t.silent and not t.budgeted]
    budgeted = any(t.budgeted for t in trials)
    color: Color
    cause = "crashed" if "crashed" in verdicts else fault(wrong, names)
    most = max(CAUTIOUS, key=verdicts.count)  # the first of the equally frequent
    if cause:
        color = "red"
    elif most == "ok":
        far = bool(over_bound(ok).max(initial=0.0) > TWICE)
        color = "amber" if budgeted else "pale" if far else "green"
    else:
        color = "grey" if most == "refused" else "amber"
    careful = [t for t in trials if t.verdict == "degraded"]
    reasons = [t.reason for t in trials if t.reason]
    answered = [t for t in trials if t.verdict in ("ok", "degraded")]
    over = np.array([t.over for t in answered]).reshape(-1, 2)
    return Cell(
        color,
        cause,
        plain_pair(over_bound(answered)),
        plain_pair(over.max(0) if len(over) else over.sum(0) + np.nan),
        len(wrong),
        color == "amber" and bool(careful) and all(t.needless for t in careful),
        color == "amber" and budgeted and most == "ok",
        len(ok),
        verdicts.count("degraded"),
        verdicts.count("refused"),
        max(reasons, key=reasons.count) if reasons else "",
        tuple(dict.fromkeys(chain.from_iterable(t.codes for t in trials))),
    )


def fault(wrong: Sequence[Trial], names: tuple[str, str]) -> str:
    """What is wrong with the worst of the records that are silently wrong; empty for none."""
    ratios = [
        (value, f"{name} error {value:.1f} times {what}")
        for t in wrong
        for what, off in (("the claimed one", t.over), ("that of the plain route", t.beside))
        for name, value in zip(names, off, strict=True)
        if np.isfinite(value)
    ]
    return max(ratios)[1] if ratios else "nothing claimed" if wrong else ""


def over_bound(trials: Sequence[Trial]) -> np.ndarray:
    """Rms error over rms bound of all trials together, of both quantities (2,)."""
    if not trials:
        return np.full(2, np.nan)
    return ratio(*(np.sqrt(np.square([getattr(t, of) for t in trials]).mean(0)) for of in ("error", "bound")))


def ratio(error: Sequence[float], other: Sequence[float]) -> np.ndarray:
    """One over the other (2,); no error is 0 times anything."""
    above, below = np.asarray(error, float), np.asarray(other, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(above == 0, 0.0, above / below))


def plain_pair(values: np.ndarray) -> tuple[float, float]:
    """Two plain numbers."""
    return float(values[0]), float(values[1])
