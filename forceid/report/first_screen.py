"""What a page says first: the verdict in one sentence, three numbers, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from forceid.estimation import CATALOGUE
from forceid.records import Estimate, Finding, Level, Verdict
from forceid.report.numbers import plain, rms, typeset

SURE = 2.0  # sigma on either side, as the bands have it
LEVELS = ("refused", "degraded", "ok")
NAMES = {"ok": "Accurate", "degraded": "Degraded", "refused": "Refused"}
MARKS = {"ok": "#00855f", "degraded": "#a87400", "refused": "#c94f00"}  # seen on white and on black


@dataclass(frozen=True)
class Card:
    """One of the three numbers: what it is, its value, its uncertainty, and what else where there is room."""

    name: str
    value: str
    note: str
    more: str = ""


@dataclass(frozen=True)
class Step:
    """What to do next, and the findings that ask for it."""

    action: str
    level: Level
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Headline:
    """What a page says first. A notebook shows it as HTML, print as text."""

    level: Level
    sentence: str
    cards: tuple[Card, ...]
    steps: tuple[Step, ...]

    def __str__(self) -> str:
        numbers = [f"{c.name}: {' '.join(filter(None, [c.value, c.note]))}" for c in self.cards]
        return "\n".join(
            [f"{NAMES[self.level]}. {self.sentence}", *numbers, *(f"- {s.action}." for s in self.steps)]
        )

    def _repr_html_(self) -> str:
        cells = "".join(
            f'<td style="text-align:left;padding-right:2em">{escape(c.name)}<br>'
            f"<b>{escape(c.value)}</b> {escape(c.note)}</td>"
            for c in self.cards
        )
        steps = "".join(f"<li>{escape(s.action)}.</li>" for s in self.steps)
        return (
            f'<div style="border-left:6px solid {MARKS[self.level]};padding-left:1em">'
            f"<p><b>{NAMES[self.level]}.</b> {escape(self.sentence)}</p>"
            f"<table><tr>{cells}</tr></table>{f'<ul>{steps}</ul>' if steps else ''}</div>"
        )


def headline(estimate: Estimate) -> Headline:
    """Verdict, three numbers and next steps of an estimate."""
    verdict = estimate.verdict
    steps = next_steps(verdict.findings)
    return Headline(verdict.level, sentence(verdict, estimate), tuple(cards(estimate)), tuple(steps))


def sentence(verdict: Verdict, estimate: Estimate) -> str:
    """The verdict for who does not know the field.

    >>> from types import SimpleNamespace as Namespace
    >>> sentence(Verdict("refused"), Namespace())
    'This recording does not show what pushed the body.'
    """
    if verdict.level == "refused":
        return "This recording does not show what pushed the body."
    known = [name for name in ("force", "moment") if np.isfinite(getattr(estimate, name)).any()]
    told = f"{' and '.join(known)} explain{'s' if len(known) == 1 else ''} the measured motion"
    unknown = "" if len(known) == 2 else f"; the {'moment' if known == ['force'] else 'force'} is not known"
    if verdict.level == "ok" and all(weak(estimate, name) for name in known):
        return f"You can rely on this: within the shaded bands nothing but weight acts on the body{unknown}."
    if verdict.level == "ok":
        return f"You can rely on this: {told}, and 19 of 20 true values lie within the shaded bands{unknown}."
    count = sum(finding.level == "degraded" for finding in verdict.findings)
    why = "one reason" if count == 1 else f"{count} reasons"
    return f"Use with care: {told}, but for {why} the error may be larger than the shaded bands{unknown}."


def sizes(estimate: Estimate, name: str) -> tuple[float, float]:
    """Typical size of the force or the moment, and the half-width of its band."""
    values, std = getattr(estimate, name), getattr(estimate, f"{name}_std")
    return float(np.linalg.norm(rms(values))), SURE * float(np.linalg.norm(rms(std)))


def weak(estimate: Estimate, name: str) -> bool:
    """Whether the force or the moment is not told apart from none."""
    size, spread = sizes(estimate, name)
    return size < spread


def cards(estimate: Estimate) -> list[Card]:
    """The three numbers that matter: typical force, typical moment, and how fast a change is followed."""
    band = np.nan if estimate.hidden is None else np.max(np.nan_to_num(estimate.hidden.band), initial=0.0)
    seconds = plain(float(estimate.time[-1] - estimate.time[0]), 3)
    if np.isnan(band):
        last = Card("Recording", f"{seconds} s", "", f"{len(estimate.time)} samples")
    elif band > 0:
        last = Card(
            "Changes followed up to", f"{plain(float(band), 2)} Hz", "", "faster ones: see Hidden load"
        )
    else:
        last = Card("Changes followed", "none", "", f"one mean value over {seconds} s")
    return [load_card(estimate, "force", "N"), load_card(estimate, "moment", "N m"), last]


def load_card(estimate: Estimate, name: str, unit: str) -> Card:
    """Typical size of a force or moment, its band, and where it is largest."""
    title, (size, spread) = f"Typical {name}", sizes(estimate, name)
    if not np.isfinite(size):
        return Card(title, "not known", "", "the motion does not show it")
    value = f"{typeset(plain(size, 3))} {unit}"
    if not np.isfinite(spread):
        return Card(title, value, "", "its uncertainty is not known")
    give = f"± {typeset(plain(spread, 2))} {unit} (2σ)"
    if size < spread:
        return Card(title, value, give, "not told apart from none")
    length = np.linalg.norm(getattr(estimate, name), axis=1)
    k = int(np.nanargmax(length))
    peak = (
        f"peak {typeset(plain(float(length[k]), 3))} {unit} at {typeset(plain(float(estimate.time[k]), 3))} s"
    )
    return Card(title, value, give, peak)


def next_steps(findings: Sequence[Finding]) -> list[Step]:
    """What to do about the findings, the gravest first, each action once, and last what asks for nothing."""
    found: dict[str, list[Finding]] = {}
    for finding in sorted(findings, key=lambda f: LEVELS.index(f.level)):
        entry = CATALOGUE.get(finding.code)
        action = finding.text.rpartition(";")[2].strip() if entry is None else entry.action
        found.setdefault(action[:1].upper() + action[1:].rstrip("."), []).append(finding)
    steps = [Step(action, of[0].level, tuple(f.text for f in of)) for action, of in found.items()]
    return sorted(steps, key=lambda step: step.action.startswith("Nothing"))
