"""Second harmonics of Maclaurin spheroids in closed form, and where their sequence turns, branches and fails.

Units: a1 = a2 = 1, pi G rho = 1; frequencies in the rotating frame. Source: pseudo-rigid bodies, 8 and 12.2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from forceid.pseudorigid.steady.ellipsoids import Ellipsoid, maclaurin
from forceid.pseudorigid.steady.index_symbols import index_symbols, pair_symbols
from forceid.records import Array

BRACKET = (0.5, 0.999)  # of the eccentricities that are sought


@dataclass(frozen=True)
class MaclaurinModes:
    """Second harmonics of spheroids (...,), in sqrt(pi G rho), as exp(i sigma t) in the rotating frame.

    discriminant: 4 B_11 - Omega^2, negative where the spheroid is unstable even without friction. toroidal
    (..., 2): -Omega + and - sqrt(discriminant), complex. transverse (..., 2): the two shears across the axis
    that are not a tilt. pulsation: squared frequency at constant circulation about the axis.
    """

    discriminant: Array
    toroidal: Array
    transverse: Array
    pulsation: Array


def maclaurin_modes(e: ArrayLike) -> MaclaurinModes:
    """Second harmonics of Maclaurin spheroids of eccentricity e (...,). DataError outside (0, 1).

    >>> modes = maclaurin_modes(0.5)
    >>> print(f"{modes.pulsation:.10f} {modes.discriminant:.10f}")
    1.2461552747 0.8412165299
    """
    spheroid = maclaurin(e)
    omega, c = spheroid.w, spheroid.axes[..., 2]
    B = pair_symbols(1.0, 1.0, c)[1]
    discriminant = 4 * B[..., 0, 0] - spheroid.omega_squared
    root = np.sqrt(discriminant.astype(complex))
    # of the cubic, sigma = -Omega is a tilt of the whole, at rest in space; what it leaves is quadratic
    across = np.sqrt(omega**2 + 16 * B[..., 0, 2])
    return MaclaurinModes(
        np.asarray(discriminant),
        np.stack([-omega + root, -omega - root], -1),
        np.stack([across - omega, -across - omega], -1) / 2,
        pulsation(c),
    )


def pulsation(c: Array) -> Array:
    """Squared pulsation frequency (...,) of spheroids of axes 1, 1, c (...,): V''(c) / m(c) at a^2 c = 1."""
    z = np.cbrt(c**2)  # the axis c of unit volume, the other two z^(-1/2)
    a = 1 / np.sqrt(z)
    A, P = index_symbols(a, a, z), pair_symbols(a, a, z)[0]
    dA1 = 2 * P[..., 0, 0] / z**2 - P[..., 0, 2] * z
    dA3 = P[..., 0, 2] / z**2 - 3 * P[..., 2, 2] * z
    curvature = 4 * A[..., 0] / z**3 - 2 * dA1 / z**2 + 2 * A[..., 2] + 2 * z * dA3
    return np.asarray(curvature / (1 + 0.5 / z**3))


def fastest_spheroid() -> Ellipsoid:
    """The Maclaurin spheroid of the largest Omega^2: asin e = e sqrt(1 - e^2) (9 - 2 e^2) / (9 - 8 e^2).

    >>> print(f"{fastest_spheroid().omega_squared:.12f}")
    0.449331412124
    """

    def slope(e: float) -> float:
        return float(np.arcsin(e) * (9 - 8 * e**2) - e * np.sqrt((1 - e) * (1 + e)) * (9 - 2 * e**2))

    return spheroid_where(slope)


def jacobi_bifurcation() -> Ellipsoid:
    """The Maclaurin spheroid where Jacobi's and Dedekind's ellipsoids branch off: Omega^2 = 2 B_11.

    From here on friction destroys it: secular instability.

    >>> print(f"{jacobi_bifurcation().energy_ratio:.12f}")
    0.137528147874
    """
    return spheroid_where(lambda e: rate_excess(e, 2.0))


def dynamical_instability() -> Ellipsoid:
    """The Maclaurin spheroid from which on the toroidal modes grow without friction: Omega^2 = 4 B_11.

    >>> print(f"{dynamical_instability().energy_ratio:.4f}")
    0.2738
    """
    return spheroid_where(lambda e: rate_excess(e, 4.0))


def rate_excess(e: float, times: float) -> float:
    """Omega^2 - times B_11 of the spheroid of eccentricity e."""
    B = pair_symbols(1.0, 1.0, np.sqrt((1 - e) * (1 + e)))[1]
    return float(2 * e**2 * B[0, 2] - times * B[0, 0])


def spheroid_where(condition: Callable[[float], float]) -> Ellipsoid:
    """The Maclaurin spheroid whose eccentricity is the root of `condition`."""
    return maclaurin(brentq(condition, *BRACKET, xtol=1e-16, rtol=8.9e-16))
