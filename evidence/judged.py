"""The one judge of estimates: error over claim and beside the plain route, and what is silently wrong.

Everything is over the central three quarters of a record, and within the band up to which a result claims to
follow a load; a result that names no band claims all frequencies. Every record counts once, by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.stats import binomtest

from forceid.records import Array

LOADS = ("force", "moment")
UNKNOWN = (np.nan, np.nan)  # of both
WRONG = 2.0  # times the claim, or the error of the plain route: beyond it an `ok` is silently wrong
NEAR, FAR = 1.5, 3.0  # error over claim: one that is degraded was so in vain, or still claims too little
NEGLIGIBLE = 0.1  # times the claim
COARSE_METHODS = ("difference", "savgol", "spline", "filter")  # chosen so: their claims count alone
TOLD = 13  # numbers: an rms of so many is twice another by chance in one of a hundred, F(13, 13) of 4
SHARE = 0.38  # of the numbers in a band, that count by the weights of `slow_part`
UNBANDED = "`ok`, twice the claim at all frequencies"
RULE = "*Silently wrong* (with 95 % interval): see [drawn records](calibration.md)."


class Judged:
    """A record that was judged: verdict, and over, beside: error over claim, and over that of the witness."""

    verdict: str
    over: tuple[float, ...]
    beside: tuple[float, ...]

    @property
    def worst(self) -> float:
        """The largest error over claim, 0 where none is known."""
        return float(np.nan_to_num(self.over).max(initial=0.0))

    @property
    def silent(self) -> bool:
        """Whether it calls itself ok and is wrong, by its claim or beside the plain route."""
        return silently_wrong(self.verdict, self.over, self.beside)

    @property
    def needless(self) -> bool:
        """Whether it is degraded, though all that is given is within its claim."""
        return self.verdict == "degraded" and self.worst <= NEAR


def unbanded(verdict: str, plain: Sequence[float]) -> bool:
    """Whether a record calls itself ok, and one error at all frequencies is above two of its claims.

    Beyond the band a result claims nothing of a load that it does not name, so that this is told, not held
    against it.
    """
    return verdict == "ok" and float(np.nan_to_num(plain).max(initial=0.0)) > WRONG


def silently_wrong(verdict: str, *ratios: Sequence[float]) -> bool:
    """Whether a record calls itself ok, and one ratio that is known is above two, or none is known.

    ratios: rms error over rms claim, and over the rms error of the plain route, both within the band.
    """
    known = np.concatenate(ratios)
    known = known[np.isfinite(known)]
    return verdict == "ok" and bool(len(known) == 0 or known.max() > WRONG)


def interval(part: int, whole: int) -> str:
    """The exact 95 % interval of a share, in percent, by Clopper and Pearson.

    >>> interval(0, 200)  # 1 - 0.025^(1/200)
    '0.0–1.8'
    """
    low, high = binomtest(part, whole).proportion_ci(method="exact")
    return f"{100 * low:.1f}–{100 * high:.1f}"


def silent_share(silent: Iterable[bool]) -> str:
    """How many records are silently wrong, of each whether it is, and the exact 95 % interval of their share.

    >>> silent_share([False] * 200)
    '0/200 (0.0–1.8 %)'
    """
    each = list(silent)
    return f"{sum(each)}/{len(each)} ({interval(sum(each), len(each))} %)"


def judged_part(values: Array) -> Array:
    """The central three quarters of a record."""
    edge = len(values) // 8
    return values[edge : len(values) - edge]


def rms(values: Array, axis: int | None = None) -> Any:
    """Root mean square over the central three quarters: of all, or along an axis."""
    return np.sqrt(np.mean(judged_part(values) ** 2, axis=axis))


def slow_part(error: Array, band: float, rate: float) -> Array:
    """What of an error (time,) lies below a frequency, its ends weighed least, so that no faster part leaks.

    Of less than three cycles: its mean.
    """
    weight = np.sin(np.pi * np.linspace(0, 1, len(error))) ** 4
    if band * len(error) / rate < 3.0:
        return np.full(1, weight @ error / weight.sum())
    if band < 0.45 * rate:
        error = sosfiltfilt(butter(4, 2 * band / rate, output="sos"), error * weight)
        error = error / np.sqrt(np.mean(weight**2))
    return error


def over_claim(error: Array, std: Array, band: Array, rate: float) -> float:
    """Rms of an error (time, n) within its band (n,) Hz over the rms claim, central three quarters.

    Components and samples without an estimate are left out. NaN where there is none.

    >>> over_claim(np.full((400, 3), 3.0), np.ones((400, 3)), np.full(3, 10.0), 100.0).__round__(6)
    3.0
    """
    error, std = judged_part(error), judged_part(std)  # first: the claims of its ends hold of its ends alone
    (error, std), band = given_parts(band, error, std)
    if not error.size:
        return float("nan")
    return float(np.sqrt(mean_square_within(error, band, rate) / np.mean(std**2)))


def over_witness(error: Array, other: Array, band: Array, rate: float) -> float:
    """Rms of an error (time, n) over that of another, within the band (n,) Hz, where both are known.

    At all frequencies where the band holds too few numbers to tell a factor of two from chance. Central
    three quarters.
    """
    (error, other), band = given_parts(band, judged_part(error), judged_part(other))
    if not error.size:
        return float("nan")
    if np.maximum(2 * SHARE * len(error) / rate * band, 1.0).sum() < TOLD:
        band = np.full(len(band), np.inf)
    return float(np.sqrt(mean_square_within(error, band, rate) / mean_square_within(other, band, rate)))


def given_parts(band: Array, *series: Array) -> tuple[list[Array], Array]:
    """Series (time, n) and their band (n,), of components given at all, at samples where all of these are."""
    there = np.isfinite(sum(series))
    components = there.any(0)
    at = there[:, components].all(1) & components.any()
    return [values[at][:, components] for values in series], np.asarray(band)[components]


def mean_square_within(error: Array, band: Array, rate: float) -> float:
    """Mean square of an error (time, n) within the band (n,) Hz."""
    return float(np.mean([np.mean(slow_part(e, b, rate) ** 2) for e, b in zip(error.T, band, strict=True)]))


def band_of(found: Any) -> Array:
    """Up to what frequency (6,) Hz an estimate claims to follow force and moment; inf where it says none."""
    band = found.hidden.band if found.hidden else np.full(6, np.inf)
    return np.where(np.isfinite(band), band, np.inf)


def samples_a_second(time: Array) -> float:
    """Samples a second (time,) s."""
    return 1 / float(np.median(np.diff(time)))


def scores(
    found: Any, truth: Sequence[Array], band: Array | None = None, rate: float | None = None
) -> dict[str, tuple[float, ...]]:
    """Error over claim within the band (6,) Hz, without one, and error over the truth, of force and moment.

    Beside: over the error of the witness, where there is one and no coarse method was asked for. Each is
    (time, 3), or (time, joint, 3), and then over all joints. A truth far below the claim is none. Band and
    rate: those of an estimate.
    """
    band = band_of(found) if band is None else np.where(np.isfinite(band), band, np.inf)
    rate = samples_a_second(found.time) if rate is None else rate
    over, plain, relative, beside, beside_plain = [], [], [], [], []
    witness = None if getattr(found, "method", "") in COARSE_METHODS else getattr(found, "witness", None)
    for k, (name, true) in enumerate(zip(LOADS, truth, strict=True)):
        error, std = getattr(found, name) - true, getattr(found, f"{name}_std")
        flat, claimed = (a.reshape(len(a), -1) for a in (error, std))
        wide = np.tile(band[3 * k : 3 * k + 3], flat.shape[1] // 3)
        over.append(over_claim(flat, claimed, wide, rate))
        plain.append(over_claim(flat, claimed, np.full_like(wide, np.inf), rate))
        other = np.full_like(error, np.nan) if witness is None else getattr(witness, name) - true
        beside.append(over_witness(flat, other.reshape(flat.shape), wide, rate))
        beside_plain.append(over_witness(flat, other.reshape(flat.shape), np.full_like(wide, np.inf), rate))
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
