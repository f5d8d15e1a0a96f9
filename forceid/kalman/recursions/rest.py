"""When a covariance stands still, and the recursion of a whole record from there on, as matrix products."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.records import Array, Flags
from forceid.rounding import ROUNDED

LAG = 8  # samples between two looks at whether a covariance has come to rest
ROUNDING = 1e-13  # a change over LAG samples that rounding alone makes
ROWS = 256  # of a matrix product below which it is not worth its call


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


def scan(A: Array, b: Array, y: Array) -> Array:
    """All y_k = A y_{k-1} + b_k; b (time, signal, state), y (signal, state) before the first.

    In blocks: every block from zero, all at once; then from block to block; then what each block inherits.
    """
    time, signals, n = b.shape
    blocks = min(max(ROWS // signals, 1), time)
    length = -(-time // blocks)
    if blocks < 4 or length < 4:
        out = np.empty_like(b)
        for k in range(time):
            out[k] = y = y @ A.T + b[k]
        return out
    blocks = -(-time // length)
    padded = np.zeros((blocks * length, signals, n))
    padded[:time] = b
    # one step of all blocks is one product of (block and signal, state)
    out = np.ascontiguousarray(padded.reshape(blocks, length, signals * n).swapaxes(0, 1))
    out = out.reshape(length, blocks * signals, n)
    powers = [A.T]
    for i in range(1, length):
        out[i] += out[i - 1] @ A.T
        powers.append(powers[-1] @ A.T)
    inherited, ends = np.empty((blocks, signals, n)), out[-1].reshape(blocks, signals, n)
    for j in range(blocks):
        inherited[j] = y
        y = y @ powers[-1] + ends[j]
    rows = inherited.reshape(-1, n)
    for i in range(length):
        out[i] += rows @ powers[i]
    out = out.reshape(length, blocks, signals * n).swapaxes(0, 1)
    return np.ascontiguousarray(out).reshape(-1, signals, n)[:time]
