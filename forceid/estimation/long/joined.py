"""Stretches of a recording, cut from it and put together as one estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from forceid.estimation.verdict.finding import judge
from forceid.estimation.verdict.innovations import wild_innovation
from forceid.files.schema import WITNESSED
from forceid.records import (
    Aero,
    Array,
    Estimate,
    Finding,
    Flown,
    HiddenLoad,
    Impulses,
    Loads,
    ModalForces,
    Verdict,
    Witness,
)
from forceid.timing import in_order

NUMBERS = ("tuned", "ladder", "leakage", "sensitivity")
# records with samples of their own
RECORDS = ("loads", "witness", "flown", "aero", "modal", "feet")
STANDING = ("null_space", "estimable")  # what is true of loads whatever a stretch shows


def cut(record: Any, first: int, last: int, frames: int) -> Any:
    """A record with those of `frames` samples, in every array that has one a frame."""
    kept = {}
    for f in fields(record):
        value = getattr(record, f.name)
        if isinstance(value, np.ndarray) and value.ndim and len(value) == frames:
            kept[f.name] = value[first:last].copy()
        elif f.name in RECORDS and value is not None:
            kept[f.name] = cut(value, first, last, frames)
    return replace(record, **kept)


def joined_windows(pieces: Sequence[Estimate]) -> Estimate:
    """Stretches as one estimate: worst verdict, every reason once, sums and medians of the numbers."""
    numbers: dict[str, Any] = {}
    for name in NUMBERS:
        each = [getattr(p, name) for p in pieces]
        keys = dict.fromkeys(key for one in each for key in one)
        numbers[name] = {key: float(np.median([one[key] for one in each if key in one])) for key in keys}
    known = [p for p in pieces if p.engine != "none"] or list(pieces)
    if loads := next((p.loads for p in pieces if p.loads is not None), None):
        pieces = [p if p.loads else replace(p, loads=emptied(loads, len(p.time))) for p in pieces]
    if not same_modes([p.modal for p in pieces]):
        pieces = [replace(p, modal=None) for p in pieces]
    whole: Estimate = chained(pieces)
    seen = np.isfinite(whole.innovation).any()
    if (
        not seen or wild_innovation(whole.time, whole.innovation, whole.nis) is None
    ):  # what chance does in one of a hundred, a long record has many of
        said = [[f for f in p.verdict.findings if f.code != "innovation-wild"] for p in pieces]
        pieces = [replace(p, verdict=judge(kept)) for p, kept in zip(pieces, said, strict=True)]
    return replace(
        whole,
        engine=known[0].engine,
        mass=known[0].mass,
        model_choice=known[0].model_choice,
        log_likelihood=float(sum(p.log_likelihood for p in pieces)),
        runtime_s=sum(p.runtime_s for p in pieces),
        timing=in_order(*(p.timing for p in pieces)),
        verdict=worst_of(pieces),
        hidden=widest([p.hidden for p in pieces]),
        witness=farthest(pieces),
        impulses=between_edges(pieces),
        **numbers,
    )


def same_modes(modes: Sequence[ModalForces | None]) -> bool:
    """Whether all stretches show the same modes, each about a mean shape of its own."""
    known = [one.shape for one in modes if one is not None]
    if len(known) < len(modes) or len({one.shape for one in known}) > 1:
        return False
    unit = [one / np.linalg.norm(one, axis=(1, 2), keepdims=True) for one in known]
    return all(np.einsum("kna,kna->k", unit[0], one).min() > 0.5 for one in unit)  # others share no half


def widest(hidden: Sequence[HiddenLoad | None]) -> HiddenLoad | None:
    """What may hide in any of several stretches: the narrowest band, the largest load."""
    known = [h for h in hidden if h is not None]
    if not known:
        return None
    at = known[0].frequency
    most = [[np.interp(at, h.frequency, a) for a in h.amplitude.T] for h in known]
    band = np.stack([h.band for h in known])
    return HiddenLoad(at, np.fmax.reduce(np.array(most)).T, np.fmin.reduce(band))


def between_edges(pieces: Sequence[Estimate]) -> Impulses | None:
    """What loads give between edges that one stretch shows: not what begins or ends where a stretch does."""
    found: list[tuple[Array, ...]] = []
    last = len(pieces) - 1
    for k, piece in enumerate(pieces):
        if (one := piece.impulses) is None:
            continue
        own = (one.start >= piece.time[0]) & ((k == last) | (one.stop < one.stop[-1]))
        if k < last:
            own &= one.start < pieces[k + 1].time[0]
        found.append(tuple(a[own] for a in (one.start, one.stop, one.impulse, one.cov)))
    each = [np.concatenate(a) for a in zip(*found, strict=True)]
    return Impulses(*each) if each and len(each[0]) else None


def farthest(pieces: Sequence[Estimate]) -> Witness | None:
    """The witness of several stretches: its loads in a row, its numbers, by axis, where they differ most."""
    known = next((p.witness for p in pieces if p.witness is not None), None)
    if known is None:
        return None
    each = [p.witness or emptied(known, len(p.time)) for p in pieces]
    numbers = {}
    for load in ("force", "moment"):
        off = [getattr(w, f"difference_{load}") / getattr(w, f"limit_{load}") for w in each]
        at = np.argmax(np.nan_to_num(off, nan=-1.0), axis=0)
        for name in (f"{number}_{load}" for number in WITNESSED):
            numbers[name] = np.array([getattr(w, name) for w in each])[at, np.arange(3)]
    whole: Witness = chained(each)
    return replace(whole, **numbers)


def chained(records: Sequence[Any]) -> Any:
    """Records with their samples one after the other; None where one of them has none."""
    lengths = [len(samples_of(r)) for r in records]
    joint: dict[str, Any] = {}
    for f in fields(records[0]):
        values = [getattr(r, f.name) for r in records]
        if any(v is None for v in values):
            joint[f.name] = None
        elif f.name in RECORDS:
            joint[f.name] = chained(values)
        elif isinstance(values[0], np.ndarray) and all(
            v.ndim and len(v) == n for v, n in zip(values, lengths, strict=True)
        ):
            wide = max(v.shape[1:] for v in values)
            joint[f.name] = np.concatenate(
                [v if v.shape[1:] == wide else np.full((len(v), *wide), np.nan) for v in values]
            )
    return replace(records[0], **joint)


def emptied(record: Any, frames: int) -> Any:
    """A record of another stretch as that of one which is refused, of so many frames: all numbers NaN."""
    samples, gone = len(samples_of(record)), {}
    for f in fields(record):
        value = getattr(record, f.name)
        if isinstance(value, np.ndarray) and f.name not in STANDING:
            shape = (frames, *value.shape[1:]) if len(value) == samples else value.shape
            gone[f.name] = np.full(shape, np.nan)
    return replace(record, **gone)


def samples_of(record: Any) -> Any:
    """An array of a record that has one entry a frame."""
    if isinstance(record, Estimate):
        return record.time
    named = {Loads: "load", Flown: "center", Aero: "value"}
    return getattr(record, named.get(type(record), "force"))


def worst_of(pieces: Sequence[Estimate]) -> Verdict:
    """The worst verdict; a cause that several stretches give is told once, since when and how often.

    Where a stretch is refused and others are not, its loads are NaN and the whole is degraded.
    """
    some = any(piece.verdict.level != "refused" for piece in pieces)
    by_cause: dict[tuple[str, ...], list[tuple[float, Finding]]] = {}
    for piece in pieces:
        for finding in piece.verdict.findings:
            by_cause.setdefault(finding.cause, []).append((float(piece.time[0]), finding))
    return judge([in_windows(times, len(pieces), some) for times in by_cause.values()])


def in_windows(times: Sequence[tuple[float, Finding]], count: int, some: bool) -> Finding:
    """The findings of one cause, with the starts of their stretches, as one of all `count` stretches.

    some: whether any of these is not refused.
    """
    start, first = times[0]
    more = len({begin for begin, _ in times}) - 1
    several = f" (so do {more} more of {count} stretches)" if more else ""
    level = judge([finding for _, finding in times]).level
    return replace(
        first,
        level="degraded" if some and level == "refused" else level,
        values={**first.values, "from_s": start},
        text=f"from {start:.6g} s on, {first.text}{several}",
    )
