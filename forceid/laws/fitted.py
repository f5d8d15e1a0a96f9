"""A law that was fitted: coefficients with covariance and intervals, and the motions flown again under it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from forceid.config import AeroSetting
from forceid.laws.fitting import count_of
from forceid.laws.flying import Course
from forceid.laws.ground import GroundSetting
from forceid.laws.spread import Spread
from forceid.records import Array
from forceid.significance import DENIED


@dataclass(frozen=True)
class Replay:
    """The law flown again beside the record: rms of what it is off by, center m and turn rad, of a flight."""

    name: str
    samples: int
    center_rms: float
    turn_rms: float
    misfit: float


@dataclass(frozen=True)
class FittedLaw:
    """Coefficients (term,) by name with covariance, interval and what was left out.

    factor (term,): deviations in an interval of 95 %; gain: of every candidate, chi-square less its price
    that it brings to the terms kept, above zero for those; spread: tests of the residuals; replays: a flight
    each.
    """

    aero: AeroSetting | None
    ground: GroundSetting | None
    name: tuple[str, ...]
    value: Array
    cov: Array
    factor: Array
    candidates: tuple[str, ...]
    gain: Array
    spread: Spread
    replays: tuple[Replay, ...]
    square: float
    freedoms: int

    @property
    def std(self) -> Array:
        """Standard deviation of every coefficient."""
        return np.asarray(np.sqrt(np.diag(self.cov)))

    @property
    def low(self) -> Array:
        """Lower ends of intervals of 95 %."""
        return self.value - self.factor * self.std

    @property
    def high(self) -> Array:
        """Upper ends."""
        return self.value + self.factor * self.std

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to say of the fit beside its numbers, a sentence each."""
        said = []
        if self.spread.within < DENIED:
            size = float(np.sqrt(max(self.spread.bands[0], 0.0)))
            said.append(
                f"the law leaves residuals that hang together, {size:.2g} times the noise at the slow end: "
                "intervals allow for it; add terms, or check sizes, air and wind"
            )
        if self.spread.between < DENIED:
            said.append(
                "the flights are further apart than their noise: intervals go by how coefficients scatter "
                "from flight to flight; check what differs between them"
            )
        return tuple(said)

    def as_dict(self) -> dict[str, Any]:
        """Plain values by name, as files and --json hold them."""
        columns = zip(self.name, self.value, self.std, self.low, self.high, self.spread.scatter, strict=True)
        return {
            **{
                n: of.model_dump(mode="json", exclude_none=True)
                for n, of in (("aero", self.aero), ("ground", self.ground))
                if of is not None
            },
            "coefficient": [
                {"name": n, "value": float(v), "std": float(s), "low": float(a), "high": float(b)}
                | ({"scatter": float(apart)} if np.isfinite(apart) else {})
                for n, v, s, a, b, apart in columns
            ],
            "covariance": dict(zip(self.name, self.cov.tolist(), strict=True)),
            "left_out": {
                n: float(g) for n, g in zip(self.candidates, self.gain, strict=True) if n not in self.name
            },
            "fit": {
                "chi_square": self.square,
                "freedoms": self.freedoms,
                "chance_within": self.spread.within,
                "chance_between": self.spread.between,
                "bands": self.spread.bands.tolist(),
                "notes": list(self.notes),
            },
            "flight": [
                {
                    "name": r.name, "samples": r.samples, "center_rms_m": r.center_rms,
                    "turn_rms_rad": r.turn_rms, "misfit": r.misfit,
                }
                for r in self.replays
            ],
        }  # fmt: skip


def replay(course: Course, residual: Array) -> Replay:
    """How far a flight under the law is from its record."""
    seen = np.isfinite(course.root).all((1, 2))
    off = np.linalg.pinv(course.root[seen]) @ residual[seen][..., None]
    center, turn = (float(np.sqrt((off[:, p, 0] ** 2).sum(1).mean())) for p in (slice(0, 3), slice(3, 6)))
    misfit = float(np.sqrt((residual**2).sum() / count_of(course)))
    return Replay(course.name, int(seen.sum()), center, turn, misfit)
