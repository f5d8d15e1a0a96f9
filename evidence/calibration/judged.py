"""What came of a drawn record, and whether it is silently wrong or careful in vain."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from evidence.calibration.record import DrawnRecord, drawn_record
from evidence.drawn.hidden_loads import WRONG
from evidence.drawn.records.scored import QUANTILE, judged_part
from evidence.strangers.attempt import attempt
from evidence.strangers.judged import LOADS, NEAR, scores
from forceid.records import Array, Estimate

UNKNOWN = (np.nan, np.nan)
KINDS = ("load", "error", "told", "place", "stated", "soft")  # by which results are counted


@dataclass(frozen=True)
class Outcome:
    """What came of record `number`: verdict (ok, degraded, refused, crashed), codes of its findings, and of
    those that are more than a note: degrading.

    Of force and moment, NaN where none is known, over the central three quarters: over: rms error over rms
    claim within the band; beside: rms error over that of the witness; inside: share of the components within
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
    plain: tuple[float, ...] = field(default=UNKNOWN)  # as over, without a band
    relative: tuple[float, ...] = field(default=UNKNOWN)  # rms error over that of the truth

    @property
    def worst(self) -> float:
        """The larger error over claim, 0 where none is known."""
        return float(np.nan_to_num(self.over).max())

    @property
    def beyond_claim(self) -> bool:
        """Whether it calls itself ok and is off by more than twice its claim."""
        return self.verdict == "ok" and self.worst > WRONG

    @property
    def beyond_witness(self) -> bool:
        """Whether it calls itself ok and is off by more than twice what the plain route is."""
        return self.verdict == "ok" and float(np.nan_to_num(self.beside).max()) > WRONG

    @property
    def silent(self) -> bool:
        """Whether it calls itself ok and is wrong, by its claim or beside the plain route."""
        return self.beyond_claim or self.beyond_witness

    @property
    def needless(self) -> bool:
        """Whether it is degraded, though all of force and moment that is given is within its claim."""
        return self.verdict == "degraded" and self.worst <= NEAR

    def __repr__(self) -> str:
        kinds = ", ".join(str(self.drawn[name]) for name in KINDS if self.drawn[name] is not False)
        numbers = "{rate:.0f} Hz, {samples} samples, {markers} markers, {noise:.1e} m".format(**self.drawn)
        off = "; ".join(
            f"{name} {over:.2f}, beside {beside:.2f}, plain {plain:.2f}, {100 * inside:.0f} % inside, "
            f"{100 * relative:.3g} %"
            for name, over, beside, plain, inside, relative in zip(
                LOADS, self.over, self.beside, self.plain, self.inside, self.relative, strict=True
            )
        )
        said = f"{self.verdict}{' SILENT' * self.silent}{' needless' * self.needless}"
        codes = ", ".join(self.codes)
        return f"{self.number}: {said}; {off}; {kinds}; {numbers}, {self.seconds:.1f} s; {codes}"


def judged(case: DrawnRecord, found: Estimate) -> dict[str, tuple[float, ...]]:
    """Errors of an estimate over its claim, beside the witness, and how often intervals hold the truth."""
    truth = [case.recording.truth[name] for name in LOADS]
    band = found.hidden.band if found.hidden else np.full(6, np.inf)
    beside, inside = [], []
    for name, true in zip(LOADS, truth, strict=True):
        error, std = (judged_part(a) for a in (getattr(found, name) - true, getattr(found, f"{name}_std")))
        known = np.isfinite(error) & np.isfinite(std)
        held = np.abs(error)[known] <= QUANTILE * std[known]
        inside.append(float(np.mean(held)) if known.any() else np.nan)
        plain = None if found.witness is None else getattr(found.witness, name)
        beside.append(np.nan if plain is None else over(error, judged_part(plain - true)))
    return {**scores(found, truth, band, case.drawn.rate), "beside": tuple(beside), "inside": tuple(inside)}


def over(error: Array, other: Array) -> float:
    """Rms of an error (time, 3) over that of another, where both are known."""
    both = np.isfinite(error) & np.isfinite(other)
    if not both.any():
        return float("nan")
    return float(np.sqrt(np.mean(error[both] ** 2) / np.mean(other[both] ** 2)))


def outcome_of(job: tuple[int, int]) -> Outcome:
    """What comes of a record of a seed and a number."""
    seed, number = job
    case = drawn_record(seed, number)
    tried = attempt(case.recording, **case.settings)
    drawn = asdict(case.drawn)
    if tried.found is None:
        return Outcome(number, drawn, tried.verdict, tried.codes, tried.seconds)
    held = tuple(f.code for f in tried.found.verdict.findings if f.level != "ok")
    off = judged(case, tried.found)
    return Outcome(number, drawn, tried.verdict, tried.codes, tried.seconds, held, **off)
