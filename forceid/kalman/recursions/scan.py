"""A linear recursion over a whole record as matrix products."""

from __future__ import annotations

import numpy as np

from forceid.records import Array

ROWS = 256  # of a matrix product below which it is not worth its call


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
