"""Stretches in which a load is of a size of its own, and loads that are strong and weak by turns.

By ratios of likelihoods of one size and of two, of what a smoother makes of a load.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from forceid.records import Array, Flags
from forceid.significance import PATIENCE


def uneven(w: Array, cuts: Sequence[int] = ()) -> list[tuple[int, int]]:
    """First and last step of the stretch that drives each axis of w (step, axis) the hardest, if one does.

    Of that stretch of a piece between cuts (steps) that stands out of its piece most.
    """
    found = []
    for one in w.T:
        each = [(0.0, 0, 0)]
        for a, b in pairwise([-1, *cuts, len(w)]):
            gain, first, last = stretch_of_its_own(one[a + 1 : b])  # a step with a cut draws the load anew
            each.append((gain, a + 1 + first, a + 1 + last))
        gain, first, last = max(each)
        found += [(first, last)] * (gain > PATIENCE)
    return found


def stretch_of_its_own(w: Array) -> tuple[float, int, int]:
    """Log-likelihood that a stretch of w (step,) of a size of its own gains, its first step and its last.

    Of stretches of half of it and less; steps that know of each other count as one.
    """
    best, steps = (0.0, 0, 0), len(w)
    if steps < 4 or not w.any():
        return best
    follows = np.fft.irfft(np.abs(np.fft.rfft(w, 2 * steps)) ** 2)[:steps]
    each = 1 / (2 * float(((follows / follows[0]) ** 2).sum()) - 1)  # numbers a step
    total, length = np.concatenate([[0.0], np.cumsum(w**2 / np.mean(w**2))]), steps // 2
    while length >= 2:
        first = np.arange(0, steps - length + 1, max(length // 2, 1))
        inside = total[first + length] - total[first]
        gain = unlikely(each * inside, each * length)
        gain += unlikely(each * (total[-1] - inside), each * (steps - length))
        at = int(gain.argmax())
        best = max(best, (float(gain[at]), int(first[at]), int(first[at]) + length))
        length //= 2
    return best


def strong_by_turns(load: Array, numbers: float, cost: float) -> Flags:
    """At which samples a load (time,) is of the larger of two sizes: the likeliest turns, each at a cost.

    numbers: that each sample is as good as, where they know of each other.

    >>> load = np.array([0.1, -0.1, 0.1, 3.0, -2.0, 0.1, 0.2, -0.1])
    >>> strong_by_turns(load, 1.0, 1.0).astype(int).tolist()
    [0, 0, 0, 1, 1, 0, 0, 0]
    """
    energy = load**2 + np.finfo(float).tiny
    strong: Flags = np.asarray(energy > energy.mean())
    for _ in range(2):  # the sizes tell the turns, and these the sizes
        if strong.all() or not strong.any():
            break
        quiet, loud = energy[~strong].mean(), energy[strong].mean()
        gain = 0.5 * numbers * (energy / quiet - energy / loud - np.log(loud / quiet))
        best, before = (0.0, 0.0), []
        for one in gain.tolist():
            before.append((best[1] - cost > best[0], best[0] - cost > best[1]))
            best = max(best[0], best[1] - cost), max(best[1], best[0] - cost) + one
        now = best[1] > best[0]
        for k in range(len(before) - 1, -1, -1):
            strong[k] = now
            now ^= before[k][now]
    return strong


def unlikely(energy: Array, numbers: float) -> Array:
    """Log-likelihood that a stretch gains which has a size of its own, by the energy of so many numbers.

    One more of energy one: no stretch is known to be still.
    """
    return np.asarray(-0.5 * (numbers + 1) * np.log((energy + 1) / (numbers + 1)))
