"""From estimates of motions to a law: fitted, its terms chosen by evidence, flown again beside them."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from forceid.config import AeroSetting, Settings
from forceid.errors import ConfigError, DataError, EstimationError
from forceid.laws.beginning import begun
from forceid.laws.choosing import choose, of_other_terms, price
from forceid.laws.courses import course_of
from forceid.laws.fitted import FittedLaw, replay
from forceid.laws.fitting import SLOPE_STEP, Fit, fit, linearized, paced, solved, start_steps
from forceid.laws.flying import Course
from forceid.laws.law import RISE, Law, LawSetting, law_of
from forceid.laws.spread import spread_of
from forceid.records import Array, Estimate
from forceid.sections import validate

ROUNDS = 4  # of choosing terms about the law last fitted: the second agrees with the first, mostly


def fit_flights(estimates: Sequence[tuple[str, Estimate]], setting: LawSetting, where: str) -> FittedLaw:
    """The law of what pushed bodies, from their estimates by name. ConfigError, DataError, EstimationError.

    setting: the terms to choose from; where: the file that states them.
    """
    courses = [course_of(estimate, name) for name, estimate in estimates]
    aero = (setting.aero or stated_aero(estimates[0][1], where)) if setting.of_air else None
    measured = aero is not None and aero.wind == "measured"
    if measured and (still := [c.name for c in courses if c.wind is None]):
        what = "holds no measured wind, which aero.wind = 'measured' asks for"
        raise DataError(what, f"{still[0]}:/flown/wind", "add /motion/wind to its motion, and estimate again")
    if not measured:
        courses = [c.in_still_air() for c in courses]
    law = law_of(setting, aero, estimates[0][1].mean_shape, where)
    check_seen(law, courses, where)
    always = kept_always(setting, law, where)
    courses, begin, near = begun(courses, law)
    courses = [paced(c, law, begin) for c in courses]
    which = tuple(range(len(law.terms)))
    found = told(fit(courses, law, np.stack([c.start for c in courses]), begin, near))
    if law.ground is not None:  # steps as fine as they have to be where the fit has come to
        courses = [
            paced(replace(c, start=s), law, found.value) for c, s in zip(courses, found.start, strict=True)
        ]
        found = told(fit(courses, law, found.start, found.value, np.sqrt(np.diag(found.cov))))
        near = np.sqrt(np.diag(found.cov))
    numbers, gain = found.count, np.full(len(which), np.nan)
    value, cov = found.value, found.cov
    for _ in range(ROUNDS if setting.choose else 0):
        chosen = choose(value, cov, always, numbers)
        if chosen == which:
            break
        which = chosen
        kept = without_others(value, cov, which)
        found = fit(courses, law.only(which), found.start, kept, near[list(which)])
        value, cov = about(courses, law, found, which, 1 / np.sqrt(np.diag(np.linalg.inv(cov))))
    gain = gains(value, cov, which, numbers)
    spread = spread_of(found)
    claimed = spread.cov
    if setting.choose and which:
        claimed = claimed + of_other_terms(value, cov, which, always, numbers)
    replays = tuple(replay(c, r) for c, r in zip(courses, found.residual, strict=True))
    return FittedLaw(
        aero, setting.ground, found.law.names, found.value, claimed, spread.factor, law.names, gain,
        spread, replays, found.square, found.freedoms,
    )  # fmt: skip


def told(found: Fit) -> Fit:
    """The fit, or an EstimationError where the motion tells nothing of one of its coefficients."""
    unknown = ~np.isfinite(np.diag(found.cov))
    if unknown.any():
        k = int(np.argmax(unknown))
        what = f"key 'law': the motion tells nothing of {found.law.names[k]}, about {found.value[k]:.3g}"
        next_step = "leave it out, or add a motion that shows it, as one that slides shows friction"
        raise EstimationError(what, "the law", next_step)
    return found


def about(
    courses: Sequence[Course], law: Law, found: Fit, which: Sequence[int], std: Array
) -> tuple[Array, Array]:
    """Best coefficients of all terms (term,) and their covariance, by the slopes about a law of some."""
    value = np.zeros(len(law.terms))
    value[list(which)] = found.value
    step = SLOPE_STEP * std
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
    own[""] = [k for k, term in enumerate(law.terms) if term is RISE]  # where the ground is, is no choice
    return sorted({k for name in ("", *setting.keep) for k in own[name.replace(" ", "")]})


def check_seen(law: Law, courses: Sequence[Course], where: str) -> None:
    """A ConfigError where terms need a rotation that a flight does not show."""
    free = {"drag", "strip_drag"} if law.aero is not None and law.aero.axes == "ball" else set()
    free |= {"contact"} if law.ground is not None and law.ground.points is None else set()
    for course in courses:
        needs = [n for n, c in zip(law.names, law.components, strict=True) if c not in free]
        if not course.turns and needs:
            what = f"asks for {needs[0]}, and {course.name} shows no rotation"
            raise ConfigError(what, where, 'leave it out, and state axes = "ball" for drag alone')
