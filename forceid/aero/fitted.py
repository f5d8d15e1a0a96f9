"""Coefficients from flights: a law fitted, its terms chosen by evidence, flown again beside the record."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from forceid.aero.choosing import choose, price
from forceid.aero.courses import course_of
from forceid.aero.fitting import (
    PROBE,
    Fit,
    count_of,
    first_value,
    fit,
    linearized,
    paced,
    solved,
    start_steps,
)
from forceid.aero.flying import Course
from forceid.aero.law import Law, LawSetting, law_of
from forceid.aero.spread import Spread, spread_of
from forceid.config import AeroSetting, Settings, validate
from forceid.errors import ConfigError, DataError
from forceid.records import Array, Estimate
from forceid.significance import DENIED

ROUNDS = 4  # of choosing terms about the law last fitted: the second agrees with the first, mostly


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

    factor: deviations in an interval of 95 %; gain: of every candidate, chi-square less its price that it
    brings to the terms kept, above zero for those; spread: tests of the residuals; replays: a flight each.
    """

    aero: AeroSetting
    name: tuple[str, ...]
    value: Array
    cov: Array
    factor: float
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
                "the flights are further apart than their noise: intervals go by their scatter; "
                "check what differs between them"
            )
        return tuple(said)

    def as_dict(self) -> dict[str, Any]:
        """Plain values by name, as files and --json hold them."""
        columns = zip(self.name, self.value, self.std, self.low, self.high, strict=True)
        return {
            "aero": self.aero.model_dump(mode="json", exclude_none=True),
            "coefficient": [
                {"name": n, "value": float(v), "std": float(s), "low": float(a), "high": float(b)}
                for n, v, s, a, b in columns
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


def fit_flights(estimates: Sequence[tuple[str, Estimate]], setting: LawSetting, where: str) -> FittedLaw:
    """The law of the air of flights, from their estimates by name. ConfigError, DataError, EstimationError.

    setting: the terms to choose from; where: the file that states them.
    """
    courses = [course_of(estimate, name) for name, estimate in estimates]
    aero = setting.aero or stated_aero(estimates[0][1], where)
    if aero.wind == "measured" and (still := [c.name for c in courses if c.wind is None]):
        what = "holds no measured wind, which aero.wind = 'measured' asks for"
        raise DataError(what, f"{still[0]}:/flown/wind", "add /motion/wind to its motion, and estimate again")
    if aero.wind != "measured":
        courses = [c.in_still_air() for c in courses]
    law = law_of(setting, aero, estimates[0][1].mean_shape, where)
    check_seen(law, courses, where)
    always = kept_always(setting, law, where)
    begin = first_value(courses, law)[0]
    courses = [paced(c, law, begin) for c in courses]
    found, which = fit(courses, law), tuple(range(len(law.terms)))
    numbers, gain = found.count, np.full(len(which), np.nan)
    value, cov = found.value, found.cov
    for _ in range(ROUNDS if setting.choose else 0):
        chosen = choose(value, cov, always, numbers)
        if chosen == which:
            break
        which = chosen
        found = fit(courses, law.only(which), found.start, without_others(value, cov, which))
        value, cov = about(courses, law, found, which, 1 / np.sqrt(np.diag(np.linalg.inv(cov))))
    gain = gains(value, cov, which, numbers)
    spread = spread_of(found)
    replays = tuple(replay(c, r) for c, r in zip(courses, found.residual, strict=True))
    return FittedLaw(
        aero, found.law.names, found.value, spread.cov, spread.factor, law.names, gain, spread, replays,
        found.square, found.freedoms,
    )  # fmt: skip


def about(
    courses: Sequence[Course], law: Law, found: Fit, which: Sequence[int], std: Array
) -> tuple[Array, Array]:
    """Best coefficients of all terms (term,) and their covariance, by the slopes about a law of some."""
    value = np.zeros(len(law.terms))
    value[list(which)] = found.value
    step = PROBE * std
    each = zip(courses, found.start, strict=True)
    parts = [linearized(c, law, s, value, np.concatenate([start_steps(c), step])) for c, s in each]
    _, move, cov = solved(parts, 0.0)
    return value + move, cov


def without_others(value: Array, cov: Array, which: Sequence[int]) -> Array:
    """The best coefficients of some terms where all others are zero, to first order."""
    own, others = list(which), [k for k in range(len(value)) if k not in which]
    if not others:
        return value
    return value[own] - cov[np.ix_(own, others)] @ np.linalg.solve(cov[np.ix_(others, others)], value[others])


def gains(value: Array, cov: Array, which: Sequence[int], numbers: int) -> Array:
    """Chi-square less its price that every candidate brings to the other terms that are kept."""
    out = np.empty(len(value))
    for k in range(len(value)):
        others = [j for j in range(len(value)) if j not in which and j != k]
        square = [
            float(value[e] @ np.linalg.solve(cov[np.ix_(e, e)], value[e])) if e else 0.0
            for e in ([*others, k], others)
        ]
        out[k] = square[0] - square[1] - price(numbers)
    return out


def stated_aero(estimate: Estimate, where: str) -> AeroSetting:
    """The table [aero] of the settings that an estimate was made with."""
    stated = validate(Settings, tomllib.loads(estimate.settings), "settings of the result").aero
    if stated is None:
        raise ConfigError(
            "key 'aero' is missing, and the result was made without it", where, "add [aero] area"
        )
    return stated


def kept_always(setting: LawSetting, law: Law, where: str) -> list[int]:
    """The terms that stay whatever the evidence says."""
    own = {n: [k] for k, n in enumerate(law.names)}
    for k, c in enumerate(law.components):
        own.setdefault(c, []).append(k)
    for name in setting.keep:
        if name.replace(" ", "") not in own:
            raise ConfigError(f"key 'keep': {name!r} is no term of law", where, f"one of {', '.join(own)}")
    return sorted({k for name in setting.keep for k in own[name.replace(" ", "")]})


def check_seen(law: Law, courses: Sequence[Course], where: str) -> None:
    """A ConfigError where terms need a rotation that a flight does not show."""
    free = {"drag", "strip_drag"} if law.aero.axes == "ball" else set()
    for course in courses:
        needs = [n for n, c in zip(law.names, law.components, strict=True) if c not in free]
        if not course.turns and needs:
            what = f"asks for {needs[0]}, and {course.name} shows no rotation"
            raise ConfigError(what, where, 'leave it out, and state axes = "ball" for drag alone')


def replay(course: Course, residual: Array) -> Replay:
    """How far a flight under the law is from its record."""
    seen = np.isfinite(course.root).all((1, 2))
    off = np.linalg.pinv(course.root[seen]) @ residual[seen][..., None]
    center, turn = (float(np.sqrt((off[:, p, 0] ** 2).sum(1).mean())) for p in (slice(0, 3), slice(3, 6)))
    misfit = float(np.sqrt((residual**2).sum() / count_of(course)))
    return Replay(course.name, int(seen.sum()), center, turn, misfit)
