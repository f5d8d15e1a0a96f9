"""Frames that show no pose and that nothing bridges, and readings that nothing else agrees with."""

from __future__ import annotations

from math import comb

import numpy as np

from forceid.estimation.body.cleaning import Dropped, Mended, Wild
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.catalogue import note
from forceid.flight.instruments import INSTRUMENTS
from forceid.kalman.tuning.robust import BURST, runs
from forceid.motion import WIDE_STEP
from forceid.records import Array, Finding, Flags, Level, Motion
from forceid.significance import CHANCE, WILD, WORSE

# of frames: as many mistakes as were found may be left below the limit, evenly spread up to it, and make the
# noise that much larger
BORNE = (WORSE**2 - 1) / (WILD**2 / 3)
MANY = 0.05  # of readings that are spikes, or frames at an edge: of so many one stands beside another
NAMED = 4  # markers in a sentence: as many as a reader takes in at a look


def judge_mending(mended: Mended) -> list[Finding]:
    """Markers that were exchanged back, and spikes that were taken out."""
    found = []
    if mended.stuck:
        at, count, frames = mended.edge, mended.stuck, mended.frames
        # beside an edge noise is cut off on one side, which pulls those that are left
        level: Level = "ok" if count <= MANY * frames else "degraded"
        found.append(note("markers-stuck", level, axis=mended.axis, edge_m=at, count=count, frames=frames))
    if mended.source is not None and mended.left is not None:
        cut, upto = mended.source.cut, mended.left.cut
        found.append(note("filter-undone", order=mended.source.order, cut_hz=cut, upto_hz=upto))
    if mended.rates:
        found.append(note("gyro-spikes", count=mended.rates, time_s=mended.rates_s))
    if mended.exchanges:
        names, first = ", ".join(mended.exchanged), mended.exchanged_s
        found.append(note("markers-exchanged", markers=names, count=mended.exchanges, time_s=first))
    if mended.spikes:
        worst = [f"{name} {count}" for name, count in mended.spikes.items()]
        several = ", ".join(worst[:NAMED]) + (" and others" if len(worst) > NAMED else "")
        count, first = sum(mended.spikes.values()), mended.spikes_s
        found.append(note("spikes", count=count, readings=mended.readings, markers=several, time_s=first))
        if count > MANY * mended.readings:
            found.append(note("many-spikes"))
    return found


def judge_wild(wild: Wild | None) -> list[Finding]:
    """Frames that nothing explains, however many are taken out."""
    if wild is None:
        return []
    return [note("wild-innovations", sigma=wild.sigma, limit=WILD, time_s=wild.time_s)]


def judge_rejected(dropped: Dropped) -> list[Finding]:
    """Frames that were taken out, and whether more than their information went with them.

    Mistakes come as chance spreads them; a motion that the prior does not follow, such as a blow, comes at
    once, and with its frames its load is gone.
    """
    if not dropped.any:
        return []
    frames = dropped.frames
    count, alone = int(frames.sum()), sum(length == 1 for _, length in runs(frames))
    found = [
        note(
            "frames-rejected", count=count, alone=alone, in_bursts=count - alone, time_s=dropped.time_s,
            sigma=dropped.sigma,
        )
    ]  # fmt: skip
    if count > BORNE * len(frames):
        found.append(note("many-rejected", count=count, frames=len(frames)))
    together, span, chance = closest_together(frames)
    if chance < CHANCE:
        found.append(note("rejected-together", together=together, span=span, count=count))
    return found


def closest_together(frames: Flags) -> tuple[int, int, float]:
    """How many of some frames (time,) stand together in how many samples, least by chance; and that chance.

    Of m frames anywhere among n, the chance that k stand in some w samples is at most k C(m, k) (w / n)^(k-1)
    (Naus, J. Am. Stat. Assoc. 60 (1965) 532).

    >>> flags = np.zeros(1000, bool)
    >>> flags[[100, 300, 301, 302, 900]] = True
    >>> together, span, chance = closest_together(flags)
    >>> together, span, round(chance, 5)
    (3, 3, 0.00027)
    """
    at, n = np.flatnonzero(frames), len(frames)
    best = (0, 0, 1.0)
    for k in range(2, min(len(at), BURST) + 1):
        span = int((at[k - 1 :] - at[: -k + 1]).min()) + 1
        if span > BURST:  # so far apart one has no part in the other
            break
        chance = float(k * comb(len(at), k) * (span / n) ** (k - 1))
        best = min(best, (k, span, chance), key=lambda one: one[2])
    return best


def lost_frames(kin: Kinematics, motion: Motion | None = None) -> Flags:
    """Samples (time,) that show no pose, and that nothing bridges.

    Beside sensors on the body, what shows the pose may have a rate of its own: between two of its frames none
    is lost. Nor where sensors that tell of force and of moment read on.
    """
    time, seen = kin.time, np.asarray(np.isfinite(kin.pose.center).all(1))
    if motion is None or not any(one.name in motion.readings for one in INSTRUMENTS):
        return ~seen
    read = np.ones_like(seen)
    for name in (one.name for one in INSTRUMENTS if one.tells):
        reading = motion.readings.get(name)
        own = np.zeros_like(seen) if reading is None else np.asarray(np.isfinite(reading).any((1, 2)))
        read &= on_its_clock(time, own)
    return np.asarray(~(on_its_clock(time, seen) | read))


def on_its_clock(time: Array, seen: Flags) -> Flags:
    """Samples (time,) that are seen, or no farther from one seen than it usually is to the next.

    >>> on_its_clock(np.arange(9.0), np.array([1, 0, 1, 0, 1, 0, 0, 0, 1], bool)).astype(int)
    array([1, 1, 1, 1, 1, 0, 0, 0, 1])
    """
    at = time[seen]
    if len(at) < 2:
        return seen
    k = np.searchsorted(at, time, "right")
    before, after = np.append(-np.inf, at)[k], np.append(at, np.inf)[k]
    gap = np.where(
        np.isfinite(before) & np.isfinite(after), after - before, np.minimum(time - before, after - time)
    )
    return np.asarray(seen | (gap < WIDE_STEP * np.median(np.diff(at))))
