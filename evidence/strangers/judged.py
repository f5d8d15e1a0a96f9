"""What forceid says of a stranger: error over claim, and whether it is silently wrong; counted by kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evidence.drawn.hidden_loads import WRONG, slow_part
from evidence.drawn.records.scored import judged_part, rms
from forceid.records import Array

LOADS = ("force", "moment")
NEGLIGIBLE = 0.1  # times the claim
TOLD = 13  # numbers: an rms of so many is twice another by chance in one of a hundred, F(13, 13) of 4
SHARE = 0.38  # of the numbers in a band, that count by the weights of `slow_part`
NEAR, FAR = 1.5, 3.0  # error over claim: one that is degraded was so in vain, or still claims too little
HEADS = (
    "kind", "records", "ok and right", "degraded, within 1.5", "degraded, beyond 3", "silent", "refused",
    "crashed", "force: error over claim", "moment: error over claim", "CPU (s)",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class Judged:
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
    over: tuple[float, ...] = (np.nan, np.nan)
    beside: tuple[float, ...] = (np.nan, np.nan)
    plain: tuple[float, ...] = (np.nan, np.nan)
    beside_plain: tuple[float, ...] = (np.nan, np.nan)
    relative: tuple[float, ...] = (np.nan, np.nan)
    facts: str = ""
    seconds: float = 0.0

    @property
    def worst(self) -> float:
        """The larger error over claim, 0 where none is known."""
        return float(np.nan_to_num(self.over).max())

    @property
    def silent(self) -> bool:
        """Whether it calls itself ok and is wrong."""
        return silently_wrong(self.verdict, self.over, self.beside)

    def __repr__(self) -> str:
        values = ", ".join(
            f"{name} {off:.2f}, beside the witness {other:.2f}, plain {plain:.2f} ({100 * part:.3g} %)"
            for name, off, other, plain, part in zip(
                LOADS, self.over, self.beside, self.plain, self.relative, strict=True
            )
        )
        said = f"{self.verdict}{' SILENT' if self.silent else ''}"
        parts = f"{self.kind} {self.seed}: {said}", values, f"{self.seconds:.1f} s", ", ".join(self.codes)
        return "; ".join([*parts, self.facts])


def silently_wrong(verdict: str, *ratios: Sequence[float]) -> bool:
    """Whether a record calls itself ok, and one ratio that is known is above two.

    ratios: rms error over rms claim, and over the rms error of the plain route, both within the band.
    """
    return verdict == "ok" and float(np.nan_to_num(np.concatenate(ratios)).max(initial=0.0)) > WRONG


def careful_in_vain(verdict: str, over: Sequence[float]) -> bool:
    """Whether a record is degraded, though all of force and moment that is given is within its claim."""
    return verdict == "degraded" and float(np.nan_to_num(over).max(initial=0.0)) <= NEAR


def over_witness(error: Array, other: Array, band: Array, rate: float) -> float:
    """Rms of an error (time, axis) over that of another, within the band (axis,) Hz, where both are known.

    At all frequencies where the band holds too few numbers to tell a factor of two from chance.
    """
    both = np.isfinite(error + other).all(1)
    if not both.any():
        return float("nan")
    if np.maximum(2 * SHARE * both.sum() / rate * band, 1.0).sum() < TOLD:
        band = np.full(len(band), np.inf)
    squares = [
        sum(np.mean(slow_part(e, b, rate) ** 2) for e, b in zip(off[both].T, band, strict=True))
        for off in (error, other)
    ]
    return float(np.sqrt(squares[0] / squares[1]))


def over_claim(error: Array, std: Array, band: Array, rate: float) -> float:
    """Rms of an error (time, axis) within its band (axis,) Hz over the rms claim, central three quarters.

    Samples without an estimate are left out. NaN where there is none.

    >>> over_claim(np.full((400, 3), 3.0), np.ones((400, 3)), np.full(3, 10.0), 100.0).__round__(6)
    3.0
    """
    error, std = judged_part(error), judged_part(std)  # first: the claims of its ends hold of its ends alone
    seen = np.isfinite(error + std).all(1)
    if not seen.any():
        return float("nan")
    slow = [np.mean(slow_part(e, b, rate) ** 2) for e, b in zip(error[seen].T, band, strict=True)]
    return float(np.sqrt(np.mean(slow) / np.mean(std[seen] ** 2)))


def band_of(found: Any) -> Array:
    """Up to what frequency (6,) Hz an estimate claims to follow force and moment; inf where it says none."""
    band = found.hidden.band if found.hidden else np.full(6, np.inf)
    return np.where(np.isfinite(band), band, np.inf)


def scores(found: Any, truth: Sequence[Array], band: Array, rate: float) -> dict[str, tuple[float, ...]]:
    """Error over claim within the band (6,) Hz, without one, and error over the truth, of force and moment.

    Beside: over the error of the witness, where there is one. Each is (time, 3), or (time, joint, 3), and
    then over all joints. A truth far below the claim is none.
    """
    over, plain, relative, beside, beside_plain = [], [], [], [], []
    witness = getattr(found, "witness", None)
    for k, (name, true) in enumerate(zip(LOADS, truth, strict=True)):
        error, std = getattr(found, name) - true, getattr(found, f"{name}_std")
        flat, claimed = (a.reshape(len(a), -1) for a in (error, std))
        wide = np.tile(np.where(np.isfinite(band), band, np.inf)[3 * k : 3 * k + 3], flat.shape[1] // 3)
        over.append(over_claim(flat, claimed, wide, rate))
        plain.append(over_claim(flat, claimed, np.full_like(wide, np.inf), rate))
        other = np.full_like(error, np.nan) if witness is None else getattr(witness, name) - true
        pair = judged_part(flat), judged_part(other.reshape(flat.shape))
        beside.append(over_witness(*pair, wide, rate))
        beside_plain.append(over_witness(*pair, np.full_like(wide, np.inf), rate))
        there = rms(true) > NEGLIGIBLE * rms(std)
        relative.append(float(rms(error) / rms(true)) if there else float("nan"))
    named = {
        "over": over,
        "beside": beside,
        "plain": plain,
        "beside_plain": beside_plain,
        "relative": relative,
    }
    return {name: tuple(values) for name, values in named.items()}


def counted(kind: str, of: Sequence[Judged]) -> list[str]:
    """A kind in the table."""
    ok = sum(j.verdict == "ok" and not j.silent for j in of)
    worst = np.array([j.worst for j in of if j.verdict == "degraded"])
    silent = sum(j.silent for j in of)
    out = [sum(j.verdict == level for j in of) for level in ("refused", "crashed")]
    numbers = len(of), ok, (worst <= NEAR).sum(), (worst > FAR).sum(), silent, *out
    middle = []
    for off in np.array([j.over for j in of]).T:
        known = off[np.isfinite(off)]
        middle.append(f"{np.median(known):.2f}" if len(known) else "")
    return [kind, *map(str, numbers), *middle, f"{np.median([j.seconds for j in of]):.1f}"]
