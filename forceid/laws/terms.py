"""Terms of a law: products of angles, rates, depths and splines, read from short texts."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from forceid.aero import Flow, dot
from forceid.errors import ConfigError
from forceid.records import Array

AIR = (
    "alpha", "beta", "p", "q", "r", "spin", "roll_rate", "pitch_rate", "yaw_rate", "spin_rate", "speed",
)  # fmt: skip
RATES = {"roll_rate": "x", "pitch_rate": "y", "yaw_rate": "z"}
ABOUT = {"p": (1, "roll_rate"), "q": (0, "pitch_rate"), "r": (1, "yaw_rate"), "spin": (1, "spin_rate")}
POWER = re.compile(r"(\w+)(?:\^(\d(?:\.\d+)?))?")
SPLINE = re.compile(r"spline\((\w+),(-?[\d.]+(?:e-?\d+)?)\)")
SWING = re.compile(r"(sin|cos)\(([\d.]+)\)")


class Variables(dict[str, Array]):
    """What terms are made of, by name (...), each worked out when it is asked for: angles rad; p, q, r and
    spin as shares of the speed, over half of span, chord, span and span; the rates themselves, rad/s; speed.
    """

    def __init__(self, seen: Flow, lengths: tuple[float, float]) -> None:
        super().__init__(alpha=seen.alpha, beta=seen.beta, speed=seen.speed, spin_rate=seen.spin)
        self.seen, self.lengths = seen, lengths

    def __missing__(self, name: str) -> Array:
        if name in ABOUT:
            axis, rate = ABOUT[name]
            self[name] = 0.5 * self.lengths[axis] * self[rate] / self["speed"]
        else:
            self[name] = dot(self.seen.omega, getattr(self.seen, RATES[name]))
        return self[name]


Value = Callable[[Mapping[str, Array], float | Array], Array]


@dataclass(frozen=True)
class Term:
    """A term by its text, its value by the variables and the time, and its powers of variables, by name."""

    text: str
    value: Value
    powers: Mapping[str, float]


def term_of(text: str, where: str, variables: Sequence[str] = AIR) -> Term:
    """The term that a text names: factors with `*` between, each 1, a variable, its power, `spline(x, knot)`,
    which is (x - knot)^2 above the knot and nothing below, or `sin(f)`, `cos(f)` of f Hz. A power that is not
    whole keeps the sign of what is below zero. ConfigError: none.

    >>> term = term_of("alpha^2 * spline(beta, 0.1)", "law.lift")
    >>> float(term.value({"alpha": np.array(2.0), "beta": np.array(0.4)}, 0.0).round(6))
    0.36
    """
    factors = [factor_of(part, text, where, variables) for part in text.replace(" ", "").split("*")]

    def value(of: Mapping[str, Array], time: float | Array) -> Array:
        return np.asarray(reduce(np.multiply, [factor(of, time) for factor in factors]))

    powers = {name: float(n or 1) for name, n in POWER.findall(text) if name in variables}
    return Term(text.replace(" ", ""), value, powers)


def factor_of(part: str, text: str, where: str, variables: Sequence[str]) -> Value:
    """The value of one factor of a term."""
    if part == "1":
        return lambda of, time: np.asarray(1.0)
    if (swing := SWING.fullmatch(part)) is not None:
        turn, w = (np.sin if swing[1] == "sin" else np.cos), 2 * np.pi * float(swing[2])
        return lambda of, time: np.asarray(turn(w * np.asarray(time)))
    spline, power = SPLINE.fullmatch(part), POWER.fullmatch(part)
    if spline is not None and spline[1] in variables:
        name, knot = spline[1], float(spline[2])
        return lambda of, time: np.maximum(of[name] - knot, 0.0) ** 2
    if power is not None and power[1] in variables:
        own, n = power[1], float(power[2] or 1)
        if n.is_integer():
            return lambda of, time: of[own] ** int(n)
        return lambda of, time: np.sign(of[own]) * np.abs(of[own]) ** n
    what = f"holds {part!r} in {text!r}, expected factors of {', '.join(variables)}, spline, sin, cos"
    a, b, *_ = variables
    raise ConfigError(what, where, f"write it as {a}, {a}^2, {a}*{b} or spline({a}, 0.2)")
