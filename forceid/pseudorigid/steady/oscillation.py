"""Motions with one degree of freedom at any amplitude: the other turning point, and the period.

m(q) q'^2 / 2 + V(q) = V(q0), released at rest from q0. Source: pseudo-rigid bodies, 12.2 and 12.6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from forceid.errors import DataError, EstimationError
from forceid.pseudorigid.material.material_law import check_above, check_finite
from forceid.pseudorigid.steady.index_symbols import potential_integral
from forceid.records import Array

CONVERGED, NEARLY_CONVERGED = 1e-14, 1e-7  # of the period, between a rule and the one with twice the nodes
FARTHEST_TURNING = 2.0**40  # times nearer or farther than the start: where the search for it ends
RULES = tuple(16 * 2**i for i in range(10))


@dataclass(frozen=True)
class Oscillation:
    """start and other: the two turning points of a coordinate; period: of the motion between them, s."""

    start: float
    other: float
    period: float


def oscillation(
    potential: Callable[[Array], Array], inertia: Callable[[Array], Array], start: float
) -> Oscillation:
    """Motion of a positive coordinate released at rest from `start`.

    potential and inertia take coordinates (n,); inertia q'^2 / 2 + potential = const. Quadrature in
    the angle between the turning points, as exact as energy differences: 1e-13, 1e-10 at amplitudes of 1e-3.
    DataError where start is not above zero, or where the motion does not come back.
    """
    check_above("oscillation", "start", start)
    level = float(potential(np.array([start]))[0])
    other = turning_point(lambda q: float(potential(np.array([q]))[0]) - level, start)
    middle, half = (start + other) / 2, (other - start) / 2
    last, change = np.nan, np.inf
    for nodes in RULES:
        angle = (np.arange(nodes) + 0.5) * np.pi / nodes
        q = middle + half * np.cos(angle)
        speed = np.sqrt(2 * (level - potential(q)) / inertia(q))
        period = float(2 * np.mean(np.pi * abs(half) * np.sin(angle) / speed))
        # more nodes stand closer to the turning points, where rounding grows: past the best rule it rules
        if change < abs(period - last) < NEARLY_CONVERGED * period:
            return Oscillation(start, other, last)
        last, change = period, abs(period - last) if nodes > RULES[0] else np.inf
        if change < CONVERGED * period:
            return Oscillation(start, other, period)
    raise EstimationError(
        f"did not converge in {RULES[-1]} nodes", "period", "release it nearer to equilibrium"
    )


def turning_point(above: Callable[[float], float], start: float) -> float:
    """Where, downhill from `start`, `above` is zero again: the potential less that at the start."""
    near = 1e-4
    down, up = above(start * (1 - near)), above(start * (1 + near))
    if min(down, up) >= 0:
        raise DataError("is an equilibrium, a body released there stays", "start", "release it elsewhere")
    toward = -1 if down < up else 1
    inner = outer = start * (1 + toward * near)
    factor = 1.02**toward
    while above(outer) < 0:
        inner, outer = outer, outer * factor
        if not start / FARTHEST_TURNING < outer < start * FARTHEST_TURNING:
            end = "expands forever" if toward > 0 else "collapses"
            raise DataError(f"{end}, so it has no period", "a body released there", "add what turns it back")
    return float(brentq(above, inner, outer, xtol=4e-16 * start, rtol=8.9e-16))


def breathing(material: Any, mu: float, stretch: float) -> Oscillation:
    """Breathing F = a I of an isotropic body with E = mu I, released at rest from a = stretch.

    material: with `energy(F)` of F (..., 3, 3). 3 mu a'^2 / 2 + W(a I) = const.
    DataError where it flies apart. Source: pseudo-rigid bodies, 12.6.

    >>> from forceid.pseudorigid.steady.gas_cloud import GasCloud
    >>> print(f"{breathing(GasCloud(1.0, 1.4, trap=1.0), 1.0, 1.3).period:.12f}")
    3.493959224005
    """
    check_above("breathing", "mu", mu)
    return oscillation(
        lambda a: np.asarray(material.energy(a[:, None, None] * np.eye(3))),
        lambda a: np.full_like(a, 3 * mu),
        stretch,
    )


def spheroid_oscillation(start: float, spin: float = 0.0, pi_G_rho: float = 1.0) -> Oscillation:
    """Liquid spheroid of axes (a, a, c), a^2 c = 1, released at rest in c from c = start.

    spin: j = Omega a^2, conserved; pi_G_rho in 1/s^2. Zero spin: irrotational.
    L = c'^2 (1 + 1/(2 c^3)) / 2 - j^2 c + 4 R_F(1/c, 1/c, c^2). Source: pseudo-rigid bodies, section 8, 12.2.

    >>> found = spheroid_oscillation(1.3)
    >>> print(f"{found.other:.12f} {found.period:.11f}")
    0.766670327998 6.26727172211
    """
    check_above("spheroid", "pi_G_rho", pi_G_rho)
    check_finite("spheroid", spin=spin)

    def potential(c: Array) -> Array:
        a = 1 / np.sqrt(c)
        return np.asarray(spin**2 * c - 4 * pi_G_rho * potential_integral(a, a, c))

    return oscillation(potential, lambda c: 1 + 0.5 / c**3, start)
