"""What came of a drawn record, and whether it is silently wrong or careful in vain."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from evidence.calibration.distributions import SAMPLES, Span
from evidence.calibration.patience import within
from evidence.calibration.record import DrawnRecord, drawn_record
from evidence.judged import LOADS, UNKNOWN, WRONG, Judged, judged_part, scores
from evidence.strangers.attempt import attempt
from forceid.records import Estimate
from forceid.significance import QUANTILE

PATIENCE = 120.0  # s of CPU: of an estimate, in a long record of each stretch; then it is stopped
KINDS = ("load", "error", "told", "place", "stated", "soft")  # by which results are counted


@dataclass(frozen=True)
class Outcome(Judged):
    """What came of record `number`.

    verdict: ok, degraded, refused, crashed or stopped; codes: of its findings; degrading: of those
    that are more than a note.

    Of force and moment, NaN where none is known, over the central three quarters: over: rms error over rms
    claim within the band; beside: rms error over that of the witness within it; plain and beside_plain: the
    same without a band; relative: rms error over that of the truth; inside: share of the components within
    their 95 % intervals. drawn: names and numbers of what was drawn; seconds: of CPU.
    """

    number: int
    drawn: dict[str, Any]
    verdict: str
    codes: tuple[str, ...]
    seconds: float
    degrading: tuple[str, ...] = ()
    over: tuple[float, ...] = UNKNOWN
    beside: tuple[float, ...] = UNKNOWN
    inside: tuple[float, ...] = UNKNOWN
    plain: tuple[float, ...] = UNKNOWN
    beside_plain: tuple[float, ...] = UNKNOWN
    relative: tuple[float, ...] = UNKNOWN

    @property
    def worst_plain(self) -> float:
        """The same at all frequencies."""
        return float(np.nan_to_num(self.plain).max())

    @property
    def beyond_claim(self) -> bool:
        """Whether it calls itself ok and is off by more than twice its claim."""
        return self.silent and self.worst > WRONG

    @property
    def beyond_witness(self) -> bool:
        """Whether it calls itself ok and is off by more than twice what the plain route is."""
        return self.silent and float(np.nan_to_num(self.beside).max()) > WRONG

    def __repr__(self) -> str:
        kinds = ", ".join(str(self.drawn[name]) for name in KINDS if self.drawn[name] is not False)
        numbers = "{rate:.0f} Hz, {samples} samples, {markers} markers, {noise:.1e} m".format(**self.drawn)
        off = "; ".join(
            f"{name} {over:.2f} (plain {plain:.2f}), beside the witness {beside:.2f} ({whole:.2f}), "
            f"{100 * inside:.0f} % inside, {100 * relative:.3g} % off"
            for name, over, plain, beside, whole, inside, relative in zip(
                LOADS,
                self.over,
                self.plain,
                self.beside,
                self.beside_plain,
                self.inside,
                self.relative,
                strict=True,
            )
        )
        said = f"{self.verdict}{' SILENT' * self.silent}{' needless' * self.needless}"
        codes = ", ".join(self.codes)
        return f"{self.number}: {said}; {off}; {kinds}; {numbers}, {self.seconds:.1f} s; {codes}"


def judged(case: DrawnRecord, found: Estimate) -> dict[str, tuple[float, ...]]:
    """Errors of an estimate over its claim, beside the witness, and how often intervals hold the truth."""
    truth = [case.recording.truth[name] for name in LOADS]
    inside = []
    for name, true in zip(LOADS, truth, strict=True):
        error, std = (judged_part(a) for a in (getattr(found, name) - true, getattr(found, f"{name}_std")))
        known = np.isfinite(error) & np.isfinite(std)
        held = np.abs(error)[known] <= QUANTILE * std[known]
        inside.append(float(np.mean(held)) if known.any() else np.nan)
    return scores(found, truth) | {"inside": tuple(inside)}


def outcome_of(job: tuple[int, int, Span]) -> Outcome:
    """What comes of a record of a seed, a number and a span of frames."""
    seed, number, frames = job
    case = drawn_record(seed, number, frames)
    patience = PATIENCE * max(1.0, case.drawn.samples / SAMPLES[1])
    tried = within(patience, lambda: attempt(case.recording, **case.settings))
    drawn = asdict(case.drawn)
    if tried is None:
        return Outcome(number, drawn, "stopped", (), patience)
    if tried.found is None:
        return Outcome(number, drawn, tried.verdict, tried.codes, tried.seconds)
    held = tuple(f.code for f in tried.found.verdict.findings if f.level != "ok")
    off = judged(case, tried.found)
    return Outcome(number, drawn, tried.verdict, tried.codes, tried.seconds, held, **off)
