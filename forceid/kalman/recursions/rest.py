"""When a covariance stands still: what its recursion does from there on, it does at every sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.records import Array, Flags
from forceid.rounding import ROUNDED

LAG = 8  # samples between two looks at whether a covariance has come to rest
ROUNDING = 1e-13  # a change over LAG samples that rounding alone makes


@dataclass
class Rest:
    """Whether a covariance that is looked at sample by sample has come to rest."""

    before: Array | None = None
    change: float = 0.0
    since: int = 0

    def reached(self, P: Array) -> bool:
        """Look at the covariance (..., state, state) of one more sample."""
        if self.before is None:
            self.before, self.change, self.since = P.copy(), 0.0, 0
            return False
        self.since += 1
        if self.since < LAG:
            return False
        size = np.sqrt(np.abs(np.diagonal(P, axis1=-2, axis2=-1)))
        scale, moved = size[..., None] * size[..., None, :], np.abs(P - self.before)
        now = float((moved / np.where(moved > 0, scale, 1.0)).max())
        # no rate tells that while it still falls from a start as good as unknown
        ratio = now / self.change if 0 < self.change < 1 else 1.0
        self.before, self.change, self.since = P.copy(), now, 0
        return now < ROUNDING or (ratio < 1 and now * ratio < ROUNDED * (1 - ratio))


def channel_changes(which: Flags) -> set[int]:
    """Samples whose channels present (time, channel) are not those of the sample before."""
    return set((1 + np.flatnonzero((which[1:] != which[:-1]).any(1))).tolist())
