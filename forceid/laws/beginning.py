"""Where the fit of a law begins: by least squares in the air, by trials of a spring on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from forceid.aero import wind_at
from forceid.errors import DataError
from forceid.laws.bounces import by_bounces, heights, near, pressed_height, thinned
from forceid.laws.fitting import MOST_SUBSTEPS, SLOPE_STEP, START, linearized, residual, settled, start_steps
from forceid.laws.flying import Course, fly
from forceid.laws.law import RISE, Law
from forceid.laws.state import State
from forceid.laws.terms import term_of
from forceid.records import Array
from forceid.rounding import ITERATIONS, ROUNDED

AIRBORNE = 8  # frames that tell a start better than the smoothed path does: of its twelve numbers, 48
BOUNCE_DAMPINGS = (0.01, 0.7)  # damping over critical that is tried: 0.97 to 0.05 of a speed come back
RUBS = (0.03, 2.0)  # friction over load: of ice on ice, of rubber on rubber
ROLLS = (1e-4, 0.2)  # resistance to rolling over load: of steel on steel, of a tire in sand
TRIAL_SUBSTEPS = MOST_SUBSTEPS // 16  # steps from sample to sample near the ground while springs are tried
SPREAD = 8  # trials at once for each number
SEED = 0  # of the trials: the same record begins alike
LOST = 1e300  # square of a flight that leaves all bounds


def first_value(courses: Sequence[Course], law: Law) -> tuple[Array, Array]:
    """Coefficients by least squares on the smoothed wrench, and the deviation of each with the others known:
    a beginning, no more.
    """
    k = len(law.terms)
    normal, right = np.zeros((k, k)), np.zeros(k)
    for course in courses:
        center, velocity, R, omega = course.path
        air = velocity
        if law.aero is not None:
            air = velocity - wind_at(law.aero, center, course.gravity, course.wind)
        still = np.zeros((*omega.shape, 3))
        on = None if law.ground is None else np.ones((len(center), law.ground.places), bool)
        at = State(center, velocity, air, R, omega, 0 * omega, course.mass, still, course.gravity, 1.0, on)
        rows = law.columns(course.time, at) / course.wrench_std[..., None]
        y = course.wrench / course.wrench_std
        good = np.isfinite(rows).all(-1) & np.isfinite(y)
        rows, y = rows[good], y[good]
        normal += rows.T @ rows
        right += rows.T @ y
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(size, size) + 1e-9 * np.eye(k)
    value = np.linalg.solve(scaled, right / size) / size
    return value, 1 / size


def begun(courses: Sequence[Course], law: Law) -> tuple[list[Course], Array, Array]:
    """Courses, in pieces by their bounces, coefficients to begin with, and about how well they are known."""
    if law.ground is None:
        return [*courses], *first_value(courses, law)
    low = min(float(heights(c, law.ground).min()) for c in courses)
    height = max(pressed_height(c, law.ground) for c in courses) if RISE in law.terms else law.ground.height
    pieces = [
        piece
        for course in courses
        for piece in by_bounces(replace(course, near=near(course, law.ground, height)))
    ]
    if not any(p.near.any() for p in pieces):
        what = f"never comes to the ground: it stays {low - height:.3g} m above it"
        raise DataError(what, courses[0].name, "check ground.height, and radius or points")
    pieces = [in_flight(p, law) for p in pieces]
    if law.ground.kind == "glued":
        begin = held(courses, law)
    else:
        begin = likeliest(pieces, law, Spring(courses, law, low))
    step = SLOPE_STEP * 1e-2 * np.maximum(np.abs(begin), ROUNDED)
    parts = [linearized(p, law, p.start, begin, np.concatenate([start_steps(p), step])) for p in pieces]
    tells = np.sum([(p.slopes[..., START:] ** 2).sum((0, 1)) for p in parts], 0)
    return pieces, begin, np.where(tells > 0, 1 / np.sqrt(np.maximum(tells, 1e-300)), np.abs(begin))


def in_flight(course: Course, law: Law) -> Course:
    """The course with the start that its frames before the ground show, where those are enough."""
    airborne = int(np.argmax(course.near)) if course.near.any() else len(course.near)
    if airborne < AIRBORNE:
        return course
    before = replace(course.part(np.arange(airborne), course.name), start=course.start)
    start = settled([before], law.only([]), course.start[None], np.zeros(0), np.zeros(0))[0]
    return replace(course, start=start[0])


def held(courses: Sequence[Course], law: Law) -> Array:
    """Coefficients (term,) of a glued contact by least squares: k (depth + height) = k depth + constant."""
    if RISE not in law.terms:
        return first_value(courses, law)[0]
    rise = law.terms.index(RISE)
    constant = replace(law, terms=tuple(term_of("1", "") if t is RISE else t for t in law.terms))
    value = first_value(courses, constant)[0]
    stiff = [k for k, t in enumerate(law.terms) if t.powers == {"depth": 1.0}]
    value[rise] = value[rise] / value[stiff[0]] if stiff else 0.0
    return value


def likeliest(pieces: Sequence[Course], law: Law, spring: Spring) -> Array:
    """Coefficients (term,) under which all pieces fly nearest to what was seen: differential evolution over
    one frequency and one damping of all springs, friction, resistance to rolling, and the height (Storn and
    Price 1997): squares have many valleys, of bounces that come early or late.
    """
    assert law.ground is not None
    thin = [thinned(p, law.ground) for p in pieces]
    fine = [replace(p, substeps=np.where(p.near, TRIAL_SUBSTEPS, 1)) for p in thin]

    def square(x: Array, /) -> Array:
        tries = spring.values(x.T)
        off = [residual(p, fly(p, law, np.repeat(p.start[None], len(tries), 0), tries)) for p in fine]
        total = np.sum([(r**2).sum((0, 1)) for r in off], 0)
        return np.log(np.where(np.isfinite(total), total, LOST))

    found = differential_evolution(
        cast(Any, square), spring.bounds, vectorized=True, updating="deferred", polish=False, init="sobol",
        rng=SEED, maxiter=ITERATIONS, popsize=SPREAD,
    )  # fmt: skip
    return np.asarray(spring.values(found.x[None])[0])


class Spring:
    """Laws of the ground by few numbers: log frequency (rad/s) and damping of all springs, friction and
    resistance to rolling, and the height over the deepest place, in depths that such a spring gives by.
    """

    def __init__(self, courses: Sequence[Course], law: Law, low: float) -> None:
        assert law.ground is not None
        n = law.ground.normal
        self.law, self.low, self.share = law, low, law.ground.places
        self.mass = float(np.mean([c.mass for c in courses]))
        self.weight = self.mass * max(float(np.mean([-(c.gravity @ n) for c in courses])), 0.0)
        self.speed = max(float(np.abs(c.path[1] @ n).max()) for c in courses)
        longest = max(float(c.time[-1]) for c in courses)
        shortest = min(float(np.diff(c.time).min()) for c in courses)
        rates = np.log([2 * np.pi / longest, TRIAL_SUBSTEPS / shortest])
        ends = np.array([rates, np.log(BOUNCE_DAMPINGS), np.log(RUBS), np.log(ROLLS), (0.0, 2.0)])
        self.bounds = Bounds(ends[:, 0], ends[:, 1])

    def values(self, x: Array) -> Array:
        """Coefficients (trial, term) of numbers (trial, 5)."""
        w, zeta, rub, roll = np.exp(x[:, :4].T)
        law, value, sunk = self.law, np.zeros((len(x), len(self.law.terms))), np.zeros(len(x))
        for k, (component, term) in enumerate(zip(law.components, law.terms, strict=True)):
            depth, rate = term.powers.get("depth", 0.0), term.powers.get("depth_rate", 0.0)
            if component == "contact" and depth + rate > 0:
                unit = (
                    self.mass * w * self.speed / ((self.speed / w) ** depth * self.speed**rate) / self.share
                )
                value[:, k] = unit * (2 * zeta if rate else 1.0)
                if not rate:
                    sunk = np.maximum(sunk, (self.weight / self.share / value[:, k]) ** (1 / depth))
            elif not term.powers:
                value[:, k] = {"friction": rub, "rolling": roll}.get(component, 0.0)
        if RISE in law.terms:
            value[:, law.terms.index(RISE)] = self.low + x[:, 4] * np.maximum(sunk, self.speed / w)
        return value
