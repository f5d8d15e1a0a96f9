"""Whether an estimate can be defended, and what was found for or against it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import Any, Literal

Level = Literal["ok", "degraded", "refused"]
ABOUT = ("part", "joint", "load", "variable", "sensors")  # values that say what a finding is about


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or to be known, and the verdict that it leads to by itself.

    code: of the catalogue; values: the numbers and names in the sentence, by name, None for what is not
    finite; text: the sentence, with a next step.
    """

    code: str
    level: Level
    values: Mapping[str, str | float | None]
    text: str

    @property
    def cause(self) -> tuple[str, ...]:
        """What findings of one cause have in common: the code, and what it is about, without numbers."""
        return (self.code, *(str(self.values[name]) for name in ABOUT if name in self.values))


@dataclass(frozen=True)
class Verdict:
    """Accurate (`ok`), degraded or refused, and why: each reason is one sentence with a next step."""

    level: Level = "ok"
    findings: tuple[Finding, ...] = ()

    @property
    def reasons(self) -> tuple[str, ...]:
        """The sentences of the findings."""
        return tuple(finding.text for finding in self.findings)

    @property
    def codes(self) -> tuple[str, ...]:
        """The codes of the findings, in the order of the reasons."""
        return tuple(finding.code for finding in self.findings)

    def _repr_html_(self) -> str:
        reasons = "".join(f"<li>{escape(text)}</li>" for text in self.reasons)
        return f"<p>verdict <b>{self.level}</b></p>" + (f"<ul>{reasons}</ul>" if reasons else "")

    @property
    def coded(self) -> dict[str, list[Any]]:
        """The findings as lists of plain values in one order, by the names of result files."""
        return {
            "reason_codes": list(self.codes),
            "reason_levels": [finding.level for finding in self.findings],
            "reason_values": [dict(finding.values) for finding in self.findings],
        }
