"""How well a model predicts stretches of a record that it has not seen.

Where errors of a measurement follow each other, single samples left out are predicted by their neighbors'
errors, and the roughest model looks best; blocks longer than the errors last do not have that. Source:
Racine, Journal of Econometrics 99 (2000); Burman, Chow and Nolan, Biometrika 81 (1994).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from forceid.kalman.model import Smoothed, StateSpace
from forceid.records import Array, Flags

EVERY = 3  # blocks, of which one is left out at a time


def blocks(count: int, length: int) -> list[Flags]:
    """Samples (time,) to leave out, for each pass: every third block, never the first and last ones.

    >>> [b.nonzero()[0].tolist() for b in blocks(12, 2)]
    [[6, 7], [2, 3, 8, 9], [4, 5]]
    """
    number = np.arange(count) // length
    inner = (number > 0) & (np.arange(count) < count - length)
    return [inner & (number % EVERY == k) for k in range(EVERY)]


def left_out_error(
    model: StateSpace, z: Array, length: int, smoother: Callable[[StateSpace, Array], Smoothed]
) -> float:
    """Mean over blocks of log mean |z - predicted|^2, blocks of `length` samples left out in turn.

    z (time, channel), NaN = missing; channels of one unit, whose axes may be turned. Logarithms, so that a
    block with an impact in it counts for no more than any other. NaN where no block is within the record.
    """
    number, logs = np.arange(len(z)) // length, []
    for out in blocks(len(z), length):
        if not out.any():
            continue
        path = smoother(model, np.where(out[:, None], np.nan, z))
        H = np.broadcast_to(model.H, (len(z), *model.H.shape[-2:]))
        error = ((z - (H @ path.x[..., None])[..., 0]) ** 2).sum(1)
        for block in np.unique(number[out]):
            inside = error[out & (number == block) & np.isfinite(error)]
            if len(inside) and inside.any():
                logs.append(float(np.log(inside.mean())))
    return float(np.mean(logs)) if logs else np.nan
