"""A maximum of a few numbers that trade places along a ridge, where each value costs a filter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from forceid.flight.path.settling import SHORTEST
from forceid.flight.tuning import PROBE
from forceid.kalman.tuning.search import cross_of, parabola
from forceid.records import Array
from forceid.rounding import ITERATIONS
from forceid.significance import NUMBER

FARTHER = 1.5  # of a logarithm: as far as one step may lead
NO_GAIN = 0.1  # of a log-likelihood: a step that promises less is no gain
GAINED_SHARE = 0.1  # of what its slope promises that a step has to gain


def bfgs_maximum(value: Callable[[Array], float], p: Array) -> Array:
    """A maximum of value(p) near p (k,), of which nothing is known beforehand."""
    best = value(p)
    _, spread = both_sides(value, p, best, np.eye(len(p)))
    return ascended(value, p, spread)[0]


def ascended(
    value: Callable[[Array], float], p: Array, spread: Array, sure: bool = False
) -> tuple[Array, Array]:
    """A maximum of value(p) near p (k,), by the rule of Broyden, Fletcher, Goldfarb and Shanno.

    spread (k, k): about the inverse of the curvature, or for sure that at p; returned with the maximum as the
    steps have found it.
    """
    best, H = value(p), spread
    slope = slope_of(value, p, best, H)
    for _ in range(ITERATIONS):
        step = H @ slope
        step *= min(1.0, FARTHER / max(float(np.abs(step).max()), 1e-300))
        gain = float(slope @ step)
        share, level = 1.0, -np.inf
        if gain >= NO_GAIN:
            level = value(p + step)
            while not level > best + GAINED_SHARE * share * gain and share > SHORTEST:
                share /= 3
                level = value(p + share * step)
        gained = level - best
        if gained > 0:
            p, best = p + share * step, level
        if gained > NO_GAIN:
            new, sure = slope_of(value, p, best, H), False
            s, y = share * step, slope - new
            slope, curved = new, float(s @ y)
            if curved > 0:
                left = np.eye(len(p)) - np.outer(s, y) / curved
                H = left @ H @ left.T + np.outer(s, s) / curved
        elif sure:
            break
        else:  # if a slope by one side is right
            (slope, H), sure = both_sides(value, p, best, H), True
    return p, H


def spread_about(value: Callable[[Array], float], dims: int) -> Array:
    """Inverse of the curvature (dims, dims) of value(p) at p = 0, by differences.

    Of a direction that bends by less than a log-likelihood of one, that of such a bend.
    """
    grid = cross_of(np.ones(dims, bool))
    _, bend = parabola(grid, np.array([[value(PROBE * p) for p in grid]]))
    curved, axes = np.linalg.eigh(bend[0] / PROBE**2)
    return np.asarray((axes / np.maximum(np.abs(curved), NUMBER)) @ axes.T)


def slope_of(value: Callable[[Array], float], p: Array, here: float, spread: Array) -> Array:
    """Gradient of value at p (k,), where it is `here`, by differences to one side; zero where none is finite.

    What a curvature as of the spread (k, k) adds to such a difference is taken off.
    """
    found = np.array([(value(p + h) - here) / PROBE for h in PROBE * np.eye(len(p))])
    bends = 0.5 * PROBE * np.diagonal(np.linalg.inv(spread))
    return np.asarray(np.where(np.isfinite(found), found + bends, 0.0))


def both_sides(value: Callable[[Array], float], p: Array, here: float, spread: Array) -> tuple[Array, Array]:
    """Gradient of value at p (k,), where it is `here`, by differences to both sides; and the spread (k, k).

    That one is scaled to the curvatures that these show.
    """
    steps = PROBE * np.eye(len(p))
    ahead, behind = (np.nan_to_num([value(p + h) - here for h in way], neginf=0.0) for way in (steps, -steps))
    bend = np.maximum(np.abs(ahead + behind) / PROBE**2, NUMBER)
    scale = np.sqrt(np.diagonal(np.linalg.inv(spread)) / bend)
    return (ahead - behind) / (2 * PROBE), spread * np.outer(scale, scale)
