"""Second harmonics of Maclaurin spheroids in closed form, and where their sequence turns, branches and fails.

Units: a1 = a2 = 1, pi G rho = 1; frequencies in the rotating frame. Source: pseudo-rigid bodies, 8 and 12.2.
"""

from types import SimpleNamespace

import numpy as np
from scipy.optimize import brentq

from forceid.pseudorigid import index_symbols, maclaurin, pair_symbols


def maclaurin_modes(e):
    """discriminant 4 B_11 - Omega^2; toroidal, transverse (..., 2); pulsation, squared."""
    spheroid = maclaurin(e)
    omega, c = spheroid.w, spheroid.axes[..., 2]
    B = pair_symbols(1.0, 1.0, c)[1]
    discriminant = 4 * B[..., 0, 0] - spheroid.omega_squared
    root = np.sqrt(discriminant.astype(complex))
    # of the cubic, sigma = -Omega is a tilt of the whole, at rest in space; what it leaves is quadratic
    across = np.sqrt(omega**2 + 16 * B[..., 0, 2])
    return SimpleNamespace(
        discriminant=discriminant,
        toroidal=np.stack([-omega + root, -omega - root], -1),
        transverse=np.stack([across - omega, -across - omega], -1) / 2,
        pulsation=pulsation(c),
    )


def pulsation(c):
    """Squared pulsation frequency (...,) of spheroids of axes 1, 1, c (...,): V''(c) / m(c) at a^2 c = 1."""
    z = np.cbrt(c**2)  # the axis c of unit volume, the other two z^(-1/2)
    a = 1 / np.sqrt(z)
    A, P = index_symbols(a, a, z), pair_symbols(a, a, z)[0]
    dA1 = 2 * P[..., 0, 0] / z**2 - P[..., 0, 2] * z
    dA3 = P[..., 0, 2] / z**2 - 3 * P[..., 2, 2] * z
    curvature = 4 * A[..., 0] / z**3 - 2 * dA1 / z**2 + 2 * A[..., 2] + 2 * z * dA3
    return curvature / (1 + 0.5 / z**3)


def fastest_spheroid():
    """The spheroid of the largest Omega^2: asin e = e sqrt(1 - e^2) (9 - 2 e^2) / (9 - 8 e^2)."""
    return spheroid_where(
        lambda e: np.arcsin(e) * (9 - 8 * e**2) - e * np.sqrt((1 - e) * (1 + e)) * (9 - 2 * e**2)
    )


def spheroid_of_excess(times):
    """The spheroid of Omega^2 = times B_11: 2 at the bifurcation, 4 where toroidal modes begin to grow."""

    def excess(e):
        B = pair_symbols(1.0, 1.0, np.sqrt((1 - e) * (1 + e)))[1]
        return 2 * e**2 * B[0, 2] - times * B[0, 0]

    return spheroid_where(excess)


def spheroid_where(condition):
    """The Maclaurin spheroid whose eccentricity is the root of `condition`."""
    return maclaurin(brentq(condition, 0.5, 0.999, xtol=1e-16, rtol=8.9e-16))
