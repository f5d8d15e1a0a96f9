"""Units of a variable to SI, by pint: products of powers such as "mm", "deg/s", "kg m2" or "m s-2"."""

from __future__ import annotations

import re
from functools import lru_cache
from importlib.resources import files
from typing import Any

from forceid.errors import DataError

POWER = re.compile(r"(?<=[A-Za-zµ])\^?(?=[+-]?[0-9])")  # m2, m-2 and m^2 are m**2
GRAVITY = re.compile(r"\bg_?0\b")  # no power of the gram
DOTTED = re.compile(r"(?<=[a-zA-Z])[.-](?=[a-zA-Z])")  # N.m and N-m are N m
IN_WORDS = re.compile(r"\b(?!Nmm\b)[A-Z][A-Za-z]{2,}\b")  # Meters, RPM
NUMBER_TO_POWER = re.compile(r"(?<![A-Za-zµ_])[0-9.]+ *(\*\*|\^)")  # may take long, and is no unit
SCALE = re.compile(r"\s*(\d[\d.]*(?:[eE][+-]?\d+)?)[ *]+(?=[A-Za-zµ])")  # 1e-3 m
MOST_LETTERS = 100  # characters: a product of powers has fewer


def si_factor(found: str, expected: str, where: str = "") -> float:
    """The number that turns values in `found` into values in `expected`, both written as products of powers.

    Powers are `m2`, `m^2` or `m**2`; factors are separated by a space, `*` or `/` (which divides by the next
    factor only). An angle is a dimension of its own, so that rad/s, deg/s, rpm and Hz convert into each
    other. `g` is the gram, of an acceleration standard gravity: none is measured in grams. DataError: not
    convertible.

    >>> si_factor("mm", "m"), si_factor("g mm^2", "kg m2"), si_factor("N/mm", "N m-1")
    (0.001, 1e-09, 1000.0)
    >>> si_factor("g", "kg"), si_factor("g", "m s-2")
    (0.001, 9.80665)
    >>> si_factor("uT", "T"), si_factor("mG", "T")
    (1e-06, 1e-07)
    """
    if found.strip() == expected:
        return 1.0
    wanted = parse(expected)
    of_gravity = found.strip() in ("g", "G") and wanted.is_compatible_with("standard_gravity")
    try:
        given = parse("gn" if of_gravity else found)
    except Exception as e:  # pint's parser ends in any of ten ways
        hint = f"{found!r} is no known unit: write the units as in 'm', 'mm', 'deg/s'"
        raise DataError(f"has units {found!r}, expected {expected!r}", where, hint) from e
    if given.is_compatible_with(wanted):
        return float(f"{given.m_as(wanted.units) / wanted.m:.15g}")  # 1e-6, not 1.0000000000000002e-6
    hint = f"convert it to {expected!r} or correct the attribute 'units'"
    raise DataError(f"has units {found!r}, expected {expected!r}", where, hint)


@lru_cache(maxsize=1)
def registry() -> Any:
    """Pint's registry of the units in units.txt; angles have a dimension there, unlike in pint's own."""
    from pint import UnitRegistry

    known: Any = UnitRegistry(None)
    known.load_definitions((files("forceid.files") / "units.txt").read_text("utf-8").splitlines())
    return known


@lru_cache(maxsize=256)
def parse(text: str) -> Any:
    """One of a unit as a quantity of pint.

    >>> str(parse("deg/s").dimensionality)
    '[angle] / [time]'
    """
    if len(text) > MOST_LETTERS or NUMBER_TO_POWER.search(text):
        raise ValueError(text)
    text = IN_WORDS.sub(lambda word: word[0].lower(), GRAVITY.sub("gn", text)).replace("%", "percent")
    scale = SCALE.match(text)
    text = text[scale.end() if scale else 0 :].strip()
    text = "" if text in ("none", "dimensionless") else POWER.sub("**", DOTTED.sub(" ", text))
    return registry().Quantity(float(scale[1]) if scale else 1.0, registry().parse_units(text))
