"""Units of a variable to SI: products of powers such as "mm", "deg/s", "kg m2" or "m s-2"."""

from __future__ import annotations

import re
import tomllib
from functools import lru_cache
from importlib.resources import files

from forceid.errors import DataError

Dimension = tuple[int, int, int, int, int]  # powers of meter, kilogram, second, radian, ampere

_NONE: Dimension = (0, 0, 0, 0, 0)
_BASE: dict[str, tuple[float, Dimension]] = {
    "m": (1.0, (1, 0, 0, 0, 0)),
    "g": (1e-3, (0, 1, 0, 0, 0)),
    "s": (1.0, (0, 0, 1, 0, 0)),
    "rad": (1.0, (0, 0, 0, 1, 0)),
    "A": (1.0, (0, 0, 0, 0, 1)),
}
UNIT_TABLES = tomllib.loads((files("forceid.files") / "units.toml").read_text("utf-8"))
_PREFIX, _PREFIXED, _WHOLE, _NAME = (UNIT_TABLES[name] for name in ("prefix", "prefixed", "whole", "name"))
_SUPERSCRIPT = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻·⋅", "0123456789-**")


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
    try:
        b, wanted = parse(expected)
        a, dimension = parse("g0" if wanted == parse("g0")[1] and found.strip() in ("g", "G") else found)
    except KeyError as e:
        raise DataError(
            f"has units {found!r}, expected {expected!r}",
            where,
            f"{e.args[0]!r} is no known unit: write the units as in 'm', 'mm', 'deg/s'",
        ) from e
    if dimension == wanted:
        return float(f"{a / b:.15g}")  # 1e-3 / 1e3 is 1e-6, not 1.0000000000000002e-6
    hint = f"convert it to {expected!r} or correct the attribute 'units'"
    raise DataError(f"has units {found!r}, expected {expected!r}", where, hint)


@lru_cache(maxsize=256)
def parse(text: str) -> tuple[float, Dimension]:
    """Factor to SI and dimension of a unit; KeyError holds the part that is not known.

    >>> parse("deg/s")[1]
    (0, 0, -1, 1, 0)
    """
    factor, power = 1.0, list(_NONE)
    text = re.sub(r"(?<=[a-zA-Z])[.-](?=[a-zA-Z])", " ", text.translate(_SUPERSCRIPT))  # N.m, N-m
    tokens = re.findall(r"/|[^\s*/]+", text.replace("**", "^"))
    sign = 1
    for token in tokens:
        if token == "/":
            sign = -1
            continue
        scale, dimension, exponent = _atom(token)
        factor *= scale ** (sign * exponent)
        power = [p + sign * exponent * d for p, d in zip(power, dimension, strict=True)]
        sign = 1
    return factor, (power[0], power[1], power[2], power[3], power[4])


def _atom(token: str) -> tuple[float, Dimension, int]:
    if re.fullmatch(r"\d+(\.\d*)?([eE][+-]?\d+)?", token) and float(token) > 0:
        return float(token), _NONE, 1
    symbol, exponent = token, 1
    if token not in _WHOLE and (m := re.fullmatch(r"(.*?)\^?([+-]?\d+)", token)):
        symbol, exponent = m[1], int(m[2])
    name = symbol.lower().removesuffix("s") if len(symbol) > 2 else symbol
    symbol = _NAME.get(symbol.lower(), _NAME.get(name, symbol))
    if symbol == "1":
        return 1.0, _NONE, 1
    if known := _BASE.get(symbol):
        return *known, exponent
    if text := _PREFIXED.get(symbol) or _WHOLE.get(symbol):
        return *parse(text), exponent
    if symbol[:1] in _PREFIX and (symbol[1:] in _BASE or symbol[1:] in _PREFIXED):
        factor, dimension = parse(symbol[1:])
        return _PREFIX[symbol[0]] * factor, dimension, exponent
    raise KeyError(token)
