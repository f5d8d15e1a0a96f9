"""Motions with one degree of freedom at any amplitude: the other turning point, and the period.

m(q) q'^2 / 2 + V(q) = V(q0), released at rest from q0. Source: pseudo-rigid bodies, 12.2 and 12.6.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from forceid.pseudorigid.steady.index_symbols import potential_integral


class Oscillation(NamedTuple):
    """start and other: the two turning points of a coordinate; period: of the motion between them."""

    start: float
    other: float
    period: float


def oscillation(potential, inertia, start):
    """Motion of a coordinate above zero released at rest, by quadrature in the angle between its ends."""

    def above(q):
        return potential(np.array([q]))[0] - potential(np.array([start]))[0]

    toward = -1 if above(0.9999 * start) < above(1.0001 * start) else 1
    inner = outer = start * (1 + toward * 1e-4)
    while above(outer) < 0:
        inner, outer = outer, outer * 1.02**toward
    other = brentq(above, inner, outer, xtol=4e-16 * start, rtol=8.9e-16)
    last, change = np.nan, np.inf
    for nodes in 16 * 2 ** np.arange(10):
        angle = (np.arange(nodes) + 0.5) * np.pi / nodes
        q = (start + other) / 2 + (other - start) / 2 * np.cos(angle)
        speed = np.sqrt(-2 * np.array([above(x) for x in q]) / inertia(q))
        period = np.mean(np.pi * abs(other - start) * np.sin(angle) / speed)
        # more nodes stand closer to the turning points, where rounding grows: past the best rule it rules
        if change < abs(period - last) < 1e-7 * period:
            return Oscillation(start, other, last)
        last, change = period, abs(period - last) if nodes > 16 else np.inf
        if change < 1e-14 * period:
            break
    return Oscillation(start, other, period)


def breathing(material, mu, stretch):
    """Breathing F = a I of an isotropic body with E = mu I: 3 mu a'^2 / 2 + W(a I) = const."""
    return oscillation(
        lambda a: material.energy(a[:, None, None] * np.eye(3)), lambda a: np.full_like(a, 3 * mu), stretch
    )


def spheroid_oscillation(start):
    """Liquid spheroid of axes (a, a, c), a^2 c = 1, irrotational, released at rest in c, pi G rho = 1."""

    def potential(c):
        a = 1 / np.sqrt(c)
        return -4 * potential_integral(a, a, c)

    return oscillation(potential, lambda c: 1 + 0.5 / c**3, start)
