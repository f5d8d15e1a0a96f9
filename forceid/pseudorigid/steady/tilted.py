"""Riemann ellipsoids of types I, II and III: figure and liquid turn about different axes, both tilted.

A homogeneous liquid under its own gravity moves as F = exp(t w^) D exp(t l^), w^ the matrix of w x. Where w
and l are not along one principal axis they lie in one principal plane. With n its normal, i and j its axes,
p = l_i / w_i and q = l_j / w_j, the acceleration is diagonal where a_j + 2 a_n p + a_i p q = 0 and
a_i + 2 a_n q + a_j p q = 0; its diagonal, -2 A a + Lambda / a with pi G rho = 1, tells w_i^2, w_j^2, Lambda.
Source: pseudo-rigid bodies, section 8; S. Chandrasekhar, Ellipsoidal Figures of Equilibrium, chapter 7.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forceid.pseudorigid.steady.ellipsoids import SPIN_ROUNDING, steady_motion
from forceid.pseudorigid.steady.index_symbols import LONGEST_AXIS, index_symbols, inside
from forceid.records import Array


@dataclass(frozen=True)
class TiltedEllipsoid:
    """An ellipsoid in steady motion whose rates lie in a principal plane, along none of its axes.

    axes (3,), in any unit of length; kind: I, II or III; normal: the principal axis, 0 to 2, across the plane
    of the rates; w, l (3,): rates of the figure, and of the liquid inside it, in sqrt(pi G rho), in the axes
    at t = 0; pressure: in the center, in pi G rho^2 by the square of the unit of the axes.
    Source: pseudo-rigid bodies, section 8; Chandrasekhar, chapter 7.
    """

    axes: Array
    kind: str
    normal: int
    w: Array
    l: Array  # noqa: E741
    pressure: float

    @property
    def vorticity(self) -> Array:
        """Vorticity zeta (3,) in the frame of the figure: l_i (a_j/a_k + a_k/a_j)."""
        ratio = self.axes[[1, 2, 0]] / self.axes[[2, 0, 1]]
        return np.asarray(self.l * (ratio + 1 / ratio))

    @property
    def angular_momentum(self) -> Array:
        """Angular momentum (3,) in sqrt(G M^3 a), a = (a1 a2 a3)^(1/3), as of `Ellipsoid`."""
        return self._momentum(self.w, self.l)

    @property
    def circulation(self) -> Array:
        """Circulation (3,) in the same unit, axes of the reference ball: w and l exchanged."""
        return self._momentum(self.l, self.w)

    def _momentum(self, own: Array, other: Array) -> Array:
        """(a_j^2 + a_k^2) own_i + 2 a_j a_k other_i, at unit volume, by sqrt(G M^3 a) / mu."""
        a = self.axes / np.cbrt(self.axes.prod())
        j, k = a[[1, 2, 0]], a[[2, 0, 1]]
        return np.asarray(((j**2 + k**2) * own + 2 * j * k * other) / (5 * np.sqrt(4 / 3)))

    def motion(self, time: ArrayLike) -> tuple[Array, Array]:
        """F and dF/dt (..., 3, 3) at times (...,), det F = 1, pi G rho = 1.

        F = exp(t w^) D exp(t l^) solves the master system of E = mu I and det F = 1.
        """
        return steady_motion(self.axes / np.cbrt(self.axes.prod()), self.w, self.l, time)


def riemann_tilted(a1: float, a2: float, a3: float) -> tuple[TiltedEllipsoid, ...]:
    """All tilted steady motions of the axes a1, a2, a3, in any order and unit; none where there is none.

    They come in pairs, the faster figure first, then its adjoint, w and l exchanged. With b1 >= b2 >= b3 the
    axes in order: type I, normal to b2, needs 2 b2 >= b1 + b3; type II, normal to b2, 2 b2 <= b1 - b3; type
    III, normal to b3, 2 b3 <= b1 - b2. Given are those of them that have real rates and no tension, with
    w above zero: half turns of w and l about a principal axis make their images. DataError where an axis is
    not a positive length. Source: pseudo-rigid bodies, section 8; Chandrasekhar, chapter 7.

    >>> faster, adjoint = riemann_tilted(1.0, 1.25, 0.4703)
    >>> faster.kind, faster.normal, adjoint.w.round(4).tolist(), adjoint.vorticity.round(4).tolist()
    ('I', 0, [0.0, 0.3639, 0.6633], [0.0, -2.2794, -1.9637])
    """
    given = zip((a1, a2, a3), ("a1", "a2", "a3"), strict=True)
    axes = np.array([inside(a, name, LONGEST_AXIS) for a, name in given])
    found = (motion for normal in range(3) for motion in in_plane(axes, normal))
    return tuple(sorted(found, key=lambda e: (e.normal, -np.linalg.norm(e.w))))


def in_plane(axes: Array, normal: int) -> Iterator[TiltedEllipsoid]:
    """The tilted motions of axes (3,) with the rates across one of them."""
    i, j = (normal + 1) % 3, (normal + 2) % 3
    (n, b, c), A = axes[[normal, i, j]], 2 * index_symbols(*axes)[[normal, i, j]]
    half = (b**2 - c**2 - 4 * n**2) / (4 * n * c)  # p^2 - 2 half p + 1 = 0: an adjoint pair
    if not half**2 >= 1:
        return
    order = ["longest", "middle", "shortest"][int((axes > n).sum())]
    for p in (half + np.sqrt(half**2 - 1), half - np.sqrt(half**2 - 1)):
        q = -(c + 2 * n * p) / (b * p)
        g = c * p - b * q
        with np.errstate(all="ignore"):  # where the plane is round, g = 0 and nothing is found
            by_c = np.divide(n * (1 + q**2) + 2 * b * q, q * g)
            by_b = np.divide(n * (1 + p**2) + 2 * c * p, p * g)
            Lambda = (A[0] * n + A[1] * b * by_c - A[2] * c * by_b) / (1 / n + by_c / b - by_b / c)
            square = np.array([(A[2] * c - Lambda / c) / (p * g), (Lambda / b - A[1] * b) / (q * g)])
        if not (square.min() > SPIN_ROUNDING * square.max() and Lambda > 0):
            continue
        w, l = np.zeros(3), np.zeros(3)  # noqa: E741
        w[[i, j]] = np.sqrt(square)
        l[[i, j]] = w[[i, j]] * [p, q]
        kind = "III" if order == "shortest" else "I" if 2 * n >= b + c else "II"
        yield TiltedEllipsoid(axes, kind, normal, w, l, float(Lambda) / 2)
