"""Index symbols of a homogeneous ellipsoid: A_i by Carlson integrals, A_ij and B_ij by quadrature.

With Delta^2 = prod_i (a_i^2 + u) and J = a1 a2 a3, integrals over u from 0 to infinity:
A_i = J int du / (Delta (a_i^2 + u)), A_ij = J int du / (Delta (a_i^2 + u)(a_j^2 + u)) and
B_ij = J int u du / (Delta (a_i^2 + u)(a_j^2 + u)). Divided differences of A_i give the same A_ij and lose all
digits at equal axes; integrands of one sign lose none. Source: pseudo-rigid bodies, section 8.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprd, elliprf

from forceid.errors import DataError
from forceid.pseudorigid.validation import real_values
from forceid.records import Array

QUADRATURE_STEP = (
    0.16  # of the trapezoidal rule: error exp(-2 pi d / step), the poles being d = 1.2 or more off the line
)
SHORTEST_AXIS, LONGEST_AXIS = 1e-75, 1e75  # of semi-axes, whose fourth powers are numbers
FAR_ENDS = 3.8  # beyond the logarithms of the squared axes, where the integrand is below 1e-17 of its largest


def inside(given: ArrayLike, name: str, highest: float, whole: bool = True) -> Array:
    """The numbers as an array, above 0 and up to `highest`, that included if whole. DataError otherwise."""
    x = real_values(given, name)
    bad = ~((x > SHORTEST_AXIS) & ((x <= highest) if whole else (x < highest)))
    if bad.any():
        length, end = highest == LONGEST_AXIS, "]" if whole else ")"
        expected = "a positive length" if length else f"inside (0, {highest:g}{end}"
        advice = "order the axes so that a1 = 1 is not below a2" if name == "a2" else f"give another {name}"
        raise DataError(f"is {x[bad].flat[0]:g}, expected {expected}", name, advice)
    return x


def checked_axes(*axes: ArrayLike) -> tuple[Array, ...]:
    """Semi-axes broadcast against each other. DataError where one is not a positive finite number."""
    return np.broadcast_arrays(*(inside(a, f"axis a{i}", LONGEST_AXIS) for i, a in enumerate(axes, 1)))


def index_symbols(a1: ArrayLike, a2: ArrayLike, a3: ArrayLike) -> Array:
    """A_1, A_2, A_3 (..., 3) of semi-axes that broadcast; their sum is 2.

    A_i = (2/3) a1 a2 a3 R_D(a_j^2, a_k^2, a_i^2), no unit: gravity inside is -2 pi G rho A_i x_i on axis i.
    The axes may be equal, in any order; DataError where one is not positive. Source: pseudo-rigid bodies, 8.

    >>> index_symbols(1, 0.9, 0.6).round(6)
    array([0.503667, 0.575386, 0.920946])
    """
    a, b, c = checked_axes(a1, a2, a3)
    x, y, z = a * a, b * b, c * c
    carlson = np.stack([elliprd(y, z, x), elliprd(z, x, y), elliprd(x, y, z)], -1)
    return np.asarray(2 / 3 * (a * b * c)[..., None] * carlson)


def pair_symbols(a1: ArrayLike, a2: ArrayLike, a3: ArrayLike) -> tuple[Array, Array]:
    """A_ij and B_ij (..., 3, 3) of semi-axes that broadcast, symmetric and positive.

    A_ij in 1/length^2, B_ij without unit. To rounding at equal axes and at axes of any ratio, by the
    trapezoidal rule in s, u = u_min exp(s - e^-s + e^(s - S)). They hold A_i = a_j^2 A_ij + B_ij and
    (a_i^2 - a_j^2) B_ij = a_i^2 A_i - a_j^2 A_j. Source: pseudo-rigid bodies, section 8.

    >>> A, B = pair_symbols(1, 1, 1)
    >>> print(f"{A[0, 1]:.6f} {B[0, 1]:.6f}")
    0.400000 0.266667
    """
    axes = np.stack(checked_axes(a1, a2, a3), -1)
    x = axes**2
    u, weight = half_line(x.min(-1), x.max(-1))
    root = np.sqrt(x[..., None] + u[..., None, :])
    density = weight * np.prod(axes[..., None] / root, axis=-2)
    pole = 1 / root**2
    A = np.einsum("...n,...in,...jn->...ij", density, pole, pole)
    B = np.einsum("...n,...in,...jn->...ij", density * u, pole, pole)
    return A, B


def half_line(smallest: Array, largest: Array) -> tuple[Array, Array]:
    """Nodes u and weights (..., n) on (0, inf) for integrands that change about `smallest` to `largest`."""
    span = np.log(largest / smallest)
    count = int(np.ceil((2 * FAR_ENDS + span.max(initial=0.0)) / QUADRATURE_STEP)) + 1
    step = ((2 * FAR_ENDS + span) / (count - 1))[..., None]
    s = -FAR_ENDS + step * np.arange(count)
    left, right = np.exp(-s), np.exp(s - span[..., None])
    u = smallest[..., None] * np.exp(s - left + right)
    return u, step * u * (1 + left + right)


def potential_integral(a1: ArrayLike, a2: ArrayLike, a3: ArrayLike) -> Array:
    """R_F(a1^2, a2^2, a3^2) = (1/2) int du / Delta (...,) of semi-axes that broadcast, in 1/length."""
    a, b, c = checked_axes(a1, a2, a3)
    return np.asarray(elliprf(a * a, b * b, c * c))
