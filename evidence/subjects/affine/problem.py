"""A problem of an affine body, with its truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from forceid.records import Array


@dataclass(frozen=True)
class AffineProblem:
    """What a contestant gets, and the truth of it.

    given: the input, of a kind that its contestants know; motion, rate (sample, ...): the truth of the first
    and of the second quantity, NaN where there is none, as after a collapse; promised: relative errors that
    an answer without a word is held to.
    """

    given: Any
    motion: Array
    rate: Array
    promised: tuple[float, float]


def relative_error(found: Array, true: Array) -> float:
    """Length of the difference over that of the truth, of what both give; 1 where there was none to give.

    >>> relative_error(np.array([[3.0, 4.5], [np.nan, 1.0]]), np.array([[3.0, 4.0], [0.0, 0.0]]))
    0.1
    >>> relative_error(np.array([[3.0], [4.0]]), np.array([[3.0], [np.nan]]))
    1.0
    """
    known, given = (np.isfinite(x.reshape(len(x), -1)).all(1) for x in (true, found))
    both = known & given
    if (given & ~known).any():
        return 1.0
    if not both.any():
        return 0.0
    return float(np.linalg.norm(found[both] - true[both]) / np.linalg.norm(true[both]))
