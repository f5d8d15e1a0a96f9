"""The front of a chart: who is beaten by nobody in both time and error, and who is ahead of whom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

SAME_ANSWER = 1.001  # errors within this ratio are the same answer


@dataclass(frozen=True)
class Point:
    """One contestant on one panel: seconds, error, and who it is."""

    name: str
    seconds: float
    error: float
    ours: bool
    told: bool


def points_of(case: Mapping[str, Any], quantity: str) -> list[Point]:
    """Who has an error in a quantity, as the rows stand; errors below those of the truth are one."""
    return [
        Point(
            r["name"],
            r["seconds"],
            max(r["error"][quantity], case["resolved"]),
            r["kind"] != "peer",
            r["told"],
        )
        for r in case["rows"]
        if "failed" not in r and np.isfinite(r["error"][quantity])
    ]


def front(points: Sequence[Point]) -> list[Point]:
    """Points that no other is as fast as and more accurate than, fastest first; who was told counts not.

    >>> names = [p.name for p in front([
    ...     Point("a", 1.0, 3.0, True, False), Point("b", 2.0, 1.0, False, False),
    ...     Point("c", 3.0, 2.0, True, False), Point("d", 0.1, 0.1, False, True)])]
    >>> names
    ['a', 'b']
    """
    best, found = np.inf, []
    for point in sorted((p for p in points if not p.told), key=lambda p: (p.seconds, p.error)):
        if point.error * SAME_ANSWER < best:
            best = point.error
            found.append(point)
    return found


def most_accurate(points: Sequence[Point]) -> Point:
    """The point of least error; of those that answer the same, the first named."""
    least = min(p.error for p in points)
    return next(p for p in points if p.error <= SAME_ANSWER * least)


def ahead(points: Sequence[Point], margin: float) -> list[Point]:
    """Peers that are faster than our most accurate point and, by the margin, no less accurate."""
    own = [p for p in points if p.ours]
    if not own:
        return []
    best = most_accurate(own)
    return [p for p in points if not p.ours and p.seconds < best.seconds and p.error * margin <= best.error]


def over_best(points: Sequence[Point], name: str) -> tuple[float, str]:
    """Error of a contestant over that of the best who was told nothing, and who that is."""
    best = most_accurate([p for p in points if not p.told])
    mine = next(p for p in points if p.name == name)
    return (mine.error / best.error if best.error > 0 else 1.0), best.name
