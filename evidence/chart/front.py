"""The front of a chart: who is beaten by nobody in both time and error, and sentences on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

ALIKE = 1.02  # errors within this ratio are no difference
ROUNDING = 1.001  # and within this one, the same answer


@dataclass(frozen=True)
class Point:
    """One contestant on one panel: seconds a sample, error, and who it is."""

    name: str
    seconds: float
    error: float
    ours: bool
    told: bool
    kind: str = "method"


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
        if point.error * ROUNDING < best:
            best = point.error
            found.append(point)
    return found


def most_accurate(points: Sequence[Point]) -> Point:
    """The point of least error; of those that answer the same, the first named."""
    least = min(p.error for p in points)
    return next(p for p in points if p.error <= ROUNDING * least)


def ahead(points: Sequence[Point], told: bool) -> list[Point]:
    """Peers, told the truth or not, that are faster and more accurate than our most accurate point."""
    own = [p for p in points if p.ours and not p.told]
    if not own:
        return []
    best = most_accurate(own)
    return [
        p
        for p in points
        if not p.ours and p.told == told and p.seconds < best.seconds and p.error * ALIKE < best.error
    ]


def over_best(points: Sequence[Point], name: str) -> tuple[float, str]:
    """Error of a contestant over that of the best who was told nothing, and who that is."""
    best = most_accurate([p for p in points if not p.told])
    mine = next(p for p in points if p.name == name)
    return (mine.error / best.error if best.error > 0 else 1.0), best.name
