"""What goes into a live estimate, and what comes out, a frame at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from forceid.records.arrays import Array
from forceid.records.verdict import Level


class Frame(NamedTuple):
    """A frame of markers: time s and position (node, 3) m, world axes, NaN where not seen."""

    time: float
    position: Array


@dataclass(frozen=True)
class LiveWrench:
    """The wrench at one frame, told a lag later: world axes, weight excluded, moment about the mass center.

    time s; force (3,) N and moment (3,) N m with force_std and moment_std (3,), NaN where the markers do not
    show it; reasons: why it is less sure than the frames around it, none where nothing is wrong.
    """

    time: float
    force: Array
    moment: Array
    force_std: Array
    moment_std: Array
    reasons: tuple[str, ...] = ()

    @property
    def flag(self) -> Level:
        """`ok`, or `degraded` where there are reasons."""
        return "degraded" if self.reasons else "ok"
