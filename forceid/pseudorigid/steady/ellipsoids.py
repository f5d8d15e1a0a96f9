"""Riemann ellipsoids in steady motion: Maclaurin, Jacobi, Dedekind, irrotational, any S-type.

A homogeneous liquid under its own gravity moves as x = R_z(w t) D R_z(l t) X, X in the unit ball: w turns
the figure, l the liquid inside it. Units: a1 = 1, pi G rho = 1. Conditions are written in the index symbols
B_ij and A_ij, which lose no digits where axes are equal. Source: pseudo-rigid bodies, section 8.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.principal import cross_matrix
from forceid.pseudorigid.material.material_law import validated_constant
from forceid.pseudorigid.steady.index_symbols import LONGEST_AXIS, index_symbols, inside, pair_symbols
from forceid.records import Array

SPIN_ROUNDING = 1e-13  # of w^2 + l^2: what rounding takes from w^2 + l^2 >= 2 |w l| where w = l or w = -l
THINNEST = 1e-6  # a3 where the search for an ellipsoid begins, in units of a2
BRACKETS = 60  # of a3, in which that search brackets


@dataclass(frozen=True)
class Ellipsoid:
    """Ellipsoids in steady motion; each array (...,), axes (..., 3) with a1 = 1, and pi G rho = 1.

    w, l: rates of the figure and, inside it, of the liquid. angular_momentum and circulation about axis 3,
    in sqrt(G M^3 a), a = (a1 a2 a3)^(1/3). energy_ratio: T/|W|, kinetic to gravitational. pressure: in the
    center, in pi G rho^2 a1^2: A_3 a_3^2, so never tension. Source: pseudo-rigid bodies, section 8.
    """

    axes: Array
    w: Array
    l: Array  # noqa: E741
    angular_momentum: Array
    circulation: Array
    energy_ratio: Array
    pressure: Array

    @property
    def omega_squared(self) -> Array:
        """Squared rate of the figure, w^2 (...,), in pi G rho."""
        return np.asarray(self.w**2)

    @property
    def vorticity(self) -> Array:
        """Vorticity zeta = l (a1^2 + a2^2) / (a1 a2) (...,) in the frame of the figure."""
        a, b = self.axes[..., 0], self.axes[..., 1]
        return np.asarray(self.l * (a / b + b / a))

    @property
    def f(self) -> Array:
        """Chandrasekhar's f = zeta / w (...,): 0 Jacobi, -2 irrotational, infinite Dedekind."""
        w, zeta = np.broadcast_arrays(self.w, self.vorticity)
        return np.asarray(np.divide(zeta, w, out=np.full(w.shape, np.inf), where=w != 0))

    @property
    def unit_axes(self) -> Array:
        """Axes (..., 3) of the same ellipsoid at unit volume, det F = 1."""
        return np.asarray(self.axes / np.cbrt(self.axes.prod(-1))[..., None])

    def motion(self, time: ArrayLike) -> tuple[Array, Array]:
        """F and dF/dt (..., time, 3, 3) at times (time,) or at one, det F = 1, pi G rho = 1.

        F = R_z(w t) D R_z(l t) solves the master system of E = mu I and det F = 1.
        """
        about_z = np.array([0.0, 0.0, 1.0])
        w, l = (np.asarray(rate)[..., None] * about_z for rate in (self.w, self.l))  # noqa: E741
        return steady_motion(self.unit_axes, w, l, time)


def steady_motion(axes: Array, w: Array, l: Array, time: ArrayLike) -> tuple[Array, Array]:  # noqa: E741
    """F = exp(t w^) D exp(t l^) and dF/dt (..., time, 3, 3) of axes, w, l (..., 3), w^ that of w x."""
    t = np.asarray(time, float)
    axes, w, l = (v[(..., *(None,) * t.ndim, slice(None))] for v in np.broadcast_arrays(axes, w, l))  # noqa: E741
    turns = [Rotation.from_rotvec((t[..., None] * v).reshape(-1, 3)).as_matrix() for v in (w, l)]
    L, R = (turn.reshape(*np.broadcast_shapes(w.shape[:-1], t.shape), 3, 3) for turn in turns)
    F = (L * axes[..., None, :]) @ R
    return F, cross_matrix(w) @ F + F @ cross_matrix(l)


def steady_ellipsoid(axes: Array, w: Array, l: Array) -> Ellipsoid:  # noqa: E741
    """The record of an ellipsoid of axes (..., 3), a1 = 1, in steady motion with rates w and l (...,)."""
    w, l = np.broadcast_arrays(np.asarray(w, float), np.asarray(l, float))  # noqa: E741
    a, b = axes[..., 0], axes[..., 1]
    A = index_symbols(*np.moveaxis(axes, -1, 0))
    kinetic = (a**2 + b**2) * (w**2 + l**2) + 4 * a * b * w * l  # 2 T / mu
    unit = 5 * np.sqrt(4 / 3) * axes.prod(-1) ** (2 / 3)  # of sqrt(G M^3 a) / mu
    return Ellipsoid(
        axes,
        w,
        l,
        ((a**2 + b**2) * w + 2 * a * b * l) / unit,
        ((a**2 + b**2) * l + 2 * a * b * w) / unit,
        kinetic / (4 * (A * axes**2).sum(-1)),
        A[..., 2] * axes[..., 2] ** 2,
    )


def maclaurin(e: ArrayLike) -> Ellipsoid:
    """Maclaurin spheroid of eccentricity e (...,), 0 < e < 1: a3 = sqrt(1 - e^2), l = 0.

    Omega^2 = 2 e^2 B_13. DataError where e is not inside (0, 1). Source: pseudo-rigid bodies, section 8.

    >>> print(f"{maclaurin(0.9).omega_squared:.10f}")
    0.4405288821
    """
    e = inside(e, "eccentricity", 1.0, whole=False)
    one = np.ones_like(e)
    axes = np.stack([one, one, np.sqrt((1 - e) * (1 + e))], -1)
    B = pair_symbols(one, one, axes[..., 2])[1]
    return steady_ellipsoid(axes, e * np.sqrt(2 * B[..., 0, 2]), np.zeros_like(e))


def riemann_s(a2: ArrayLike, a3: ArrayLike, adjoint: bool = False) -> Ellipsoid:
    """S-type ellipsoid of axes 1, a2 <= 1 and a3 (...,), the figure being the faster: w >= |l|.

    adjoint: w and l exchanged, F to its transpose. w^2 + l^2 = 2 B_12, a1 a2 w l = a1^2 a2^2 A_12 - a3^2 A_3.
    DataError where a2 is not in (0, 1] or a3 not above 0, and where the pair has no real solution, which
    needs w^2 + l^2 >= 2 |w l|. Source: pseudo-rigid bodies, section 8.

    >>> found = riemann_s(0.8, 0.5)
    >>> print(f"{found.w:.9f} {found.l:.9f}")
    0.597858492 0.017304361
    """
    b, c = np.broadcast_arrays(inside(a2, "a2", 1.0), inside(a3, "a3", LONGEST_AXIS))
    s, twice = conditions(b, c)
    bad = s * (1 + SPIN_ROUNDING) < np.abs(twice)
    if bad.any():
        raise DataError(
            f"({b[bad].flat[0]:g}, {c[bad].flat[0]:g}) have w^2 + l^2 = {s[bad].flat[0]:.6g} below "
            f"2 |w l| = {np.abs(twice[bad]).flat[0]:.6g}, so no S-type ellipsoid has them",
            "axes (a2, a3)",
            "take a3 nearer to the Jacobi or the irrotational ellipsoid of this a2",
        )
    w = (np.sqrt(np.maximum(s + twice, 0)) + np.sqrt(np.maximum(s - twice, 0))) / 2
    l = twice / (2 * w)  # noqa: E741
    axes = np.stack([np.ones_like(b), b, c], -1)
    return steady_ellipsoid(axes, l, w) if adjoint else steady_ellipsoid(axes, w, l)


def conditions(a2: Array, a3: Array) -> tuple[Array, Array]:
    """w^2 + l^2 and 2 w l (...,) of steady motion of the axes 1, a2, a3 (...,)."""
    A, (A_pair, B_pair) = index_symbols(1.0, a2, a3), pair_symbols(1.0, a2, a3)
    product = a2**2 * A_pair[..., 0, 1] - a3**2 * A[..., 2]
    return np.asarray(2 * B_pair[..., 0, 1]), np.asarray(2 * product / a2)


def riemann_sequence(a2: ArrayLike, f: float) -> Ellipsoid:
    """S-type ellipsoid of given a2 (...,) <= a1 = 1 and f = zeta / w: solved for a3.

    Any finite f; the limit of large f is `dedekind`. DataError where a2 is not inside (0, 1], or no a3 does.
    Source: pseudo-rigid bodies, section 8.

    >>> print(f"{riemann_sequence(0.7, -2.0).axes[2]:.9f}")
    0.813567048
    """
    if not np.isfinite(validated_constant("ellipsoid", "f", f)):
        raise DataError(f"is {f}, expected finite", "f", "call dedekind(a2) for the infinite one")
    b = inside(a2, "a2", 1.0)
    r = f * b / (1 + b**2)  # l / w

    def condition(a2: float, ratio: float, a3: float) -> float:
        s, twice = conditions(np.asarray(a2), np.asarray(a3))
        return float(twice - 2 * ratio / (1 + ratio**2) * s)

    solved = [
        solve_a3(lambda c, x=x, q=q: condition(x, q, c), x, f)  # type: ignore[misc]
        for x, q in zip(b.ravel(), r.ravel(), strict=True)
    ]
    c = np.reshape(solved, b.shape)
    s = conditions(b, c)[0]
    w = np.sqrt(s / (1 + r**2))
    return steady_ellipsoid(np.stack([np.ones_like(b), b, c], -1), w, r * w)


def solve_a3(condition: Callable[[float], float], a2: float, f: float) -> float:
    """The largest a3 where `condition` changes its sign, between a disk and the longest axis."""
    tried = a2 * np.geomspace(THINNEST, 1.001 / a2, BRACKETS)
    signs = np.sign([condition(c) for c in tried])
    changes = np.flatnonzero(signs[:-1] != signs[1:])
    if not len(changes):
        raise DataError(
            f"= {a2:g} has no S-type ellipsoid with f = {f:g}", "a2", "take an f nearer to 0, or a larger a2"
        )
    i = changes[-1]
    return float(brentq(condition, tried[i], tried[i + 1], xtol=1e-16, rtol=8.9e-16))


def jacobi(a2: ArrayLike) -> Ellipsoid:
    """Jacobi ellipsoid of given a2 (...,) <= a1 = 1: l = 0, a1^2 a2^2 A_12 = a3^2 A_3.

    a2 = 1 is where the sequence leaves the Maclaurin spheroids. DataError where a2 is not inside (0, 1].
    Source: pseudo-rigid bodies, section 8.

    >>> found = jacobi(0.8)
    >>> print(f"{found.axes[2]:.9f} {found.omega_squared:.9f}")
    0.517216059 0.366837037
    """
    return riemann_sequence(a2, 0.0)


def dedekind(a2: ArrayLike) -> Ellipsoid:
    """Dedekind ellipsoid of given a2 (...,) <= a1 = 1: the axes of Jacobi's at rest, w = 0 and l = Omega.

    >>> found = dedekind(0.8)
    >>> print(f"{found.w:.1f} {found.l**2:.9f} {found.f}")
    0.0 0.366837037 inf
    """
    found = jacobi(a2)
    return steady_ellipsoid(found.axes, found.l, found.w)


def irrotational(a2: ArrayLike) -> Ellipsoid:
    """Irrotational ellipsoid of given a2 (...,) <= a1 = 1: f = -2, no circulation.

    >>> found = irrotational(0.5)
    >>> print(f"{found.axes[2]:.9f} {found.w:.9f} {found.l:.9f}")
    0.632524186 0.515733323 -0.412586658
    """
    return riemann_sequence(a2, -2.0)
