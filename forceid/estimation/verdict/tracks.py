"""What was done about readings that nothing else agrees with."""

from __future__ import annotations

from forceid.estimation.body.cleaning import Mended, Wild
from forceid.estimation.verdict.catalogue import note
from forceid.kalman.tuning.robust import runs
from forceid.records import Finding
from forceid.significance import WILD

NAMED = 4  # markers in a sentence: as many as a reader takes in at a look


def judge_mending(mended: Mended) -> list[Finding]:
    """Markers that were exchanged back, and spikes that were taken out."""
    found = []
    if mended.exchanges:
        names, first = ", ".join(mended.exchanged), mended.exchanged_s
        found.append(note("markers-exchanged", markers=names, count=mended.exchanges, time_s=first))
    if mended.spikes:
        worst = [f"{name} {count}" for name, count in mended.spikes.items()]
        several = ", ".join(worst[:NAMED]) + (" and others" if len(worst) > NAMED else "")
        count, first = sum(mended.spikes.values()), mended.spikes_s
        found.append(note("spikes", count=count, readings=mended.readings, markers=several, time_s=first))
    return found


def judge_wild(wild: Wild | None) -> list[Finding]:
    """Frames that were taken out, or that nothing explains."""
    if wild is None:
        return []
    if not wild.ended:
        return [note("wild-innovations", sigma=wild.sigma, limit=WILD, time_s=wild.time_s)]
    count, alone = int(wild.frames.sum()), sum(length == 1 for _, length in runs(wild.frames))
    return [
        note(
            "frames-rejected", count=count, alone=alone, in_bursts=count - alone, time_s=wild.time_s,
            sigma=wild.sigma,
        )
    ]  # fmt: skip
