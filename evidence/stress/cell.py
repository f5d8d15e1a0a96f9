"""One cell of a stress map: the color that the trials of a method at one level of a failure add up to.

Source: the shared requirement that the verdict on every failure is accurate (within twice the bound and
calibrated), degraded and said so, or refused and said why; silently wrong is the only failure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

Color = Literal["green", "pale", "amber", "grey", "red"]
TWICE = 2.0  # times what is claimed, and times the bound, that an accurate estimate may be off
BEYOND = "the bound"
CAUTIOUS = ("refused", "degraded", "ok")  # among verdicts equally frequent, the first


@dataclass(frozen=True)
class Trial:
    """One record by one method: error, claimed deviation and bound of two quantities.

    Of a flight force and moment, rms in N and N m over the central three quarters, per axis; of a body in
    parts forces and motions, relative. NaN: not known, or not claimed. verdict:
    ok, degraded, refused or crashed; reason: the first. told: what the budget of the result says that the
    error of the input costs, where no motion reveals it.
    """

    verdict: str
    error: tuple[float, float]
    claimed: tuple[float, float]
    bound: tuple[float, float]
    reason: str = ""
    told: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Cell:
    """Color; cause of a red one; pooled error over bound and error over claim, of both quantities (2,).

    alone: seeds that would be red by themselves; ok, degraded, refused: how many; reason: the most frequent.
    """

    color: Color
    cause: str
    over_bound: tuple[float, float]
    over_claim: tuple[float, float]
    alone: int
    ok: int
    degraded: int
    refused: int
    reason: str

    @property
    def honest_red(self) -> bool:
        """Whether a red cell is so for its distance from the bound only, and not for its claim."""
        return self.color == "red" and self.cause.endswith(BEYOND)


def judge_cell(trials: Sequence[Trial], coarse: bool, names: tuple[str, str] = ("force", "moment")) -> Cell:
    """The cell of the trials of all seeds; names: of the two quantities.

    red: an error that is no error of forceid's; or the verdict says ok and, over the seeds that say so, the
    rms error exceeds twice the claimed one, or no number is claimed, or it exceeds twice the bound. coarse:
    whether a method may be honestly worse than that; it is pale green then. Otherwise by the more frequent
    verdict: green, amber where degraded and said so, or where the budget of the result, newtons per percent
    and per millimeter, accounts for an input that is wrong; grey where refused.

    >>> honest = Trial("ok", (0.1, 0.01), (0.1, 0.01), (0.08, 0.008))
    >>> boastful = Trial("ok", (0.1, 0.01), (0.01, 0.01), (0.08, 0.008))
    >>> judge_cell([honest], False).color, judge_cell([boastful], False).color
    ('green', 'red')
    """
    verdicts = [t.verdict for t in trials]
    ok = [t for t in trials if t.verdict == "ok"]
    answered = [t for t in trials if t.verdict in ("ok", "degraded")]
    cause = "crashed" if "crashed" in verdicts else fault(ok, coarse, names)
    color: Color
    if cause and "crashed" not in verdicts and budgeted(ok):
        cause, color = "", "amber"
    elif cause:
        color = "red"
    else:
        most = max(CAUTIOUS, key=verdicts.count)  # the first of the equally frequent
        fine = "pale" if coarse and rms_ratio(ok, "bound").max(initial=0.0) > TWICE else "green"
        color = {"refused": "grey", "degraded": "amber"}.get(most, fine)  # type: ignore[assignment]
    reasons = [t.reason for t in trials if t.reason]
    return Cell(
        color,
        cause,
        plain_pair(rms_ratio(answered, "bound")),
        plain_pair(rms_ratio(answered, "claimed")),
        sum(bool(fault([t], coarse)) and not budgeted([t]) for t in trials),
        len(ok),
        verdicts.count("degraded"),
        verdicts.count("refused"),
        max(reasons, key=reasons.count) if reasons else "",
    )


def fault(trials: Sequence[Trial], coarse: bool, names: tuple[str, str] = ("force", "moment")) -> str:
    """What is wrong with trials that say ok, together; empty where nothing is."""
    ok = [t for t in trials if t.verdict == "ok"]
    if not ok:
        return ""
    known = np.all(np.isfinite([t.bound for t in ok]), axis=0).tolist()
    claims = rms_ratio(ok, "claimed")
    if not np.isfinite(claims).all():
        return "nothing claimed"
    for name, ratio in zip(names, claims, strict=True):
        if ratio > TWICE:
            return f"{name} error {ratio:.1f} times the claimed one"
    bounds = rms_ratio(ok, "bound")
    for name, ratio, told in zip(names, bounds, known, strict=True):
        if told and ratio > TWICE and not coarse:
            return f"{name} error {ratio:.1f} times {BEYOND}"
    return ""


def budgeted(trials: Sequence[Trial]) -> bool:
    """Whether claim and budget together account for the errors of trials that say ok."""
    ok = [t for t in trials if t.verdict == "ok"]
    told = np.square([t.told for t in ok]).mean(0) if ok else np.zeros(2)
    if not told.any():
        return False
    error, claimed = (np.square([getattr(t, what) for t in ok]).mean(0) for what in ("error", "claimed"))
    return bool((error <= TWICE**2 * (claimed + told)).all())


def rms_ratio(trials: Sequence[Trial], what: Literal["bound", "claimed"]) -> np.ndarray:
    """Rms error over rms bound or claim of all trials together, of both quantities (2,)."""
    if not trials:
        return np.full(2, np.nan)
    error = np.square([t.error for t in trials]).mean(0)
    other = np.square([getattr(t, what) for t in trials]).mean(0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(error / other)
    return np.asarray(np.where(error == 0, 0.0, ratio))


def plain_pair(values: np.ndarray) -> tuple[float, float]:
    """Two plain numbers."""
    return float(values[0]), float(values[1])
