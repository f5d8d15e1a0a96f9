"""What forceid says of a stranger, and how it is counted by kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evidence.judged import FAR, LOADS, NEAR, UNKNOWN, Judged, silent_share

HEADS = (
    "kind", "records", "ok and right", "degraded, within 1.5", "degraded, beyond 3", "silent",
    "refused or crashed", "force: error over claim", "moment: error over claim", "CPU (s)",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class StrangerOutcome(Judged):
    """What came of a record. over: rms error over rms claim, of force and moment, within the band.

    beside: rms error over that of the witness, within the band; plain, beside_plain: both without a band,
    which steps and waves beyond it are in; relative: over the rms of truth.

    NaN where nothing is claimed. verdict: ok, degraded, refused, crashed or not simulated; codes: of its
    findings, or what it crashed of; facts: how it was watched; seconds of CPU.
    """

    kind: str
    seed: int
    verdict: str
    codes: tuple[str, ...]
    over: tuple[float, ...] = UNKNOWN
    beside: tuple[float, ...] = UNKNOWN
    plain: tuple[float, ...] = UNKNOWN
    beside_plain: tuple[float, ...] = UNKNOWN
    relative: tuple[float, ...] = UNKNOWN
    facts: str = ""
    seconds: float = 0.0

    def __repr__(self) -> str:
        values = ", ".join(
            f"{name} {off:.2f}, beside the witness {other:.2f}, plain {plain:.2f} ({100 * part:.3g} %)"
            for name, off, other, plain, part in zip(
                LOADS, self.over, self.beside, self.plain, self.relative, strict=True
            )
        )
        said = f"{self.verdict}{' SILENT' if self.silent else ''}"
        how = "; ".join([f"Took {self.seconds:.1f} s", ", ".join(self.codes), self.facts])
        return f"{self.kind} {self.seed}: {said}; {values}. {how}"


def counted(kind: str, of: Sequence[StrangerOutcome]) -> list[str]:
    """A kind in the table."""
    ok = sum(j.verdict == "ok" and not j.silent for j in of)
    worst = np.array([j.worst for j in of if j.verdict == "degraded"])
    few = len({j.kind for j in of}) == 1  # whose interval tells nothing
    silent = sum(j.silent for j in of) if few else silent_share(j.silent for j in of)
    out = sum(j.verdict in ("refused", "crashed") for j in of)
    numbers = len(of), ok, (worst <= NEAR).sum(), (worst > FAR).sum(), silent, out
    middle = []
    for off in np.array([j.over for j in of]).T:
        known = off[np.isfinite(off)]
        middle.append(f"{np.median(known):.2f}" if len(known) else "")
    return [kind, *map(str, numbers), *middle, f"{np.median([j.seconds for j in of]):.1f}"]
