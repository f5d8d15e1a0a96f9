"""Marker sets in use: what the names of markers say of landmarks and segments of a person."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from forceid.files.formats.bodies.tables import SIDES, of_side

TELLING = 0.6  # of the landmarks of a set that must be there to know it by: laboratories leave some out


@dataclass(frozen=True)
class MarkerSet:
    """A set as far as it is there: the markers in whose middle a landmark is, and those on a segment."""

    name: str
    landmark: dict[str, tuple[str, ...]]
    on: dict[str, tuple[str, ...]]


@cache
def known_sets() -> Mapping[str, Mapping[str, Any]]:
    """All sets by name, as the file beside this module has them."""
    return tomllib.loads((files("forceid.files.formats.bodies") / "marker_sets.toml").read_text("utf-8"))


def marker_set(names: Sequence[str]) -> MarkerSet | None:
    """The set that most landmarks are of; None where no set has most of its own. Without subject and case.

    >>> [marker_set(["subject:LASI"]), len(known_sets())]
    [None, 4]
    """
    seen = {name.rsplit(":", 1)[-1].lower(): name for name in names}
    found = [shown_by(seen, name, rows) for name, rows in known_sets().items()]
    share = [
        len(one.landmark) / landmarks_of(rows) for one, rows in zip(found, known_sets().values(), strict=True)
    ]
    best = max(range(len(found)), key=lambda k: (len(found[k].landmark), share[k]))
    return found[best] if share[best] >= TELLING else None


def landmarks_of(rows: Mapping[str, Any]) -> int:
    """How many landmarks a set has, left and right."""
    return sum(len(sides_of(alternatives)) for key, alternatives in rows.items() if key != "on")


def sides_of(markers: Sequence[str]) -> tuple[str, ...]:
    """The sides that markers are on: left and right, or the middle."""
    return SIDES if any("{S}" in name for name in markers) else ("",)


def shown_by(seen: Mapping[str, str], name: str, rows: Mapping[str, Any]) -> MarkerSet:
    """The set `name` as far as markers show it; seen: their names by those without subject and case."""

    def there(wanted: str, side: str) -> str | None:
        return seen.get(wanted.replace("{S}", side[:1]).lower())

    landmark: dict[str, tuple[str, ...]] = {}
    for key, alternatives in rows.items():
        if key == "on":
            continue
        for side in sides_of(alternatives):
            for one in alternatives:
                markers = [there(part.strip(), side) for part in one.split("+")]
                if all(markers):
                    landmark[of_side(key, side)] = tuple(m for m in markers if m)
                    break
    on = {}
    for segment, wanted in rows["on"].items():
        for side in sides_of(wanted):
            on[of_side(segment, side)] = tuple(m for one in wanted if (m := there(one, side)))
    return MarkerSet(name, landmark, on)
