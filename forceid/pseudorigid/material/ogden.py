"""Ogden materials and other functions of principal stretches: forces and stiffness from any SVD.

dW/dF = L diag(g) R with g = dW/da holds with any singular value decomposition, also at repeated values; the
stiffness needs (g_i - g_j)/(a_i - a_j), here as an exact divided difference of the powers, without a switch
that loses digits. Source: pseudo-rigid bodies, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.errors import DataError
from forceid.pseudorigid.factors.cofactors import EYE, determinant
from forceid.pseudorigid.material.material_law import (
    Lame,
    check_above,
    check_volumetric,
    validated_constant,
    validated_determinant,
)
from forceid.pseudorigid.validation import tensors
from forceid.records import Array

PAIRS = np.array([[1, 2], [0, 2], [0, 1]])  # the other two of every axis


@dataclass(frozen=True)
class Ogden:
    """W = sum_i alpha_i sum_k a_k^gamma_i + sum_i beta_i sum_{j<k} (a_j a_k)^delta_i + c J^2 - d log J.

    Every product alpha gamma, beta delta >= 0, one of them > 0; c >= 0, d > 0 unless `incompressible`, which
    drops Gamma for a multiplier. Stress free at F = I where d = sum alpha gamma + 2 sum beta delta + 2c.
    Source: pseudo-rigid bodies, section 3.

    >>> W = Ogden.natural((1.2, 0.3), (2.0, 4.0), (0.5,), (-1.0,), 0.4)
    Traceback (most recent call last):
    ...
    forceid.errors.DataError: Ogden: beta delta = -0.5, expected >= 0; choose beta delta >= 0
    >>> W = Ogden.natural((0.6,), (2.0,), (0.25,), (2.0,), 0.4)  # Mooney-Rivlin
    >>> W.d, W.lame()
    (3.0, Lame(lam=2.6, mu=1.7))
    """

    alpha: tuple[float, ...]
    gamma: tuple[float, ...]
    beta: tuple[float, ...] = ()
    delta: tuple[float, ...] = ()
    c: float = 0.0
    d: float = 0.0
    incompressible: bool = False

    def __post_init__(self) -> None:
        for name in ("alpha", "gamma", "beta", "delta"):
            given = getattr(self, name)
            if not isinstance(given, tuple | list):
                what = f"{name} is {type(given).__name__}, expected numbers in a tuple"
                raise DataError(what, "Ogden:", f"write {name}=(1.2,) for one number")
            object.__setattr__(self, name, tuple(validated_constant("Ogden", name, x) for x in given))
        if len(self.alpha) != len(self.gamma) or len(self.beta) != len(self.delta):
            what = f"{len(self.alpha)} alpha, {len(self.gamma)} gamma, {len(self.beta)} beta, "
            what += f"{len(self.delta)} delta"
            raise DataError(what, "Ogden:", "give an exponent for every coefficient")
        strong = 0.0
        for name, pairs in (("alpha gamma", self._powers), ("beta delta", self._products)):
            for factor, exponent in pairs:
                check_above("Ogden", name, factor * exponent, itself=True)
                strong += factor * exponent
        check_above("Ogden", "sum of alpha gamma and beta delta", strong)
        check_volumetric("Ogden", self.c, self.d, self.incompressible)

    @property
    def _powers(self) -> list[tuple[float, float]]:
        return list(zip(self.alpha, self.gamma, strict=True))

    @property
    def _products(self) -> list[tuple[float, float]]:
        return list(zip(self.beta, self.delta, strict=True))

    @classmethod
    def natural(
        cls,
        alpha: tuple[float, ...],
        gamma: tuple[float, ...],
        beta: tuple[float, ...] = (),
        delta: tuple[float, ...] = (),
        c: float = 0.0,
    ) -> Ogden:
        """The constant d that leaves F = I without stress."""
        d = sum(map(np.multiply, alpha, gamma)) + 2 * sum(map(np.multiply, beta, delta)) + 2 * c
        return cls(alpha, gamma, beta, delta, c, float(d))

    def lame(self) -> Lame:
        """Lame constants of the natural material."""
        lam = sum(f * e**2 for f, e in self._products) + 4 * self.c
        _, (first, *_), second = self._derivatives(np.ones(3))
        return Lame(float(lam), float(first - second[0, 1]) / 2)

    def energy(self, F: Array) -> Array:
        """W (...,)."""
        F = tensors(F)
        J = validated_determinant("Ogden", determinant(F))
        a = np.linalg.svd(F, compute_uv=False)
        area = a[..., PAIRS[:, 0]] * a[..., PAIRS[:, 1]]
        W = np.zeros(a.shape[:-1])
        for factor, exponent in self._powers:
            W = W + factor * (a**exponent).sum(-1)
        for factor, exponent in self._products:
            W = W + factor * (area**exponent).sum(-1)
        if not self.incompressible:
            W = W + self.c * J**2 - self.d * np.log(J)
        return np.asarray(W)

    def gradient(self, F: Array) -> Array:
        """dW/dF (..., 3, 3): L diag(g) R."""
        F = tensors(F)
        validated_determinant("Ogden", determinant(F))
        L, a, R = np.linalg.svd(F)
        g, _, _ = self._derivatives(a)
        return np.asarray((L * g[..., None, :]) @ R)

    def hessian(self, F: Array, H: Array) -> Array:
        """d2W[H] (..., 3, 3), in the frame h = L^T H R^T."""
        F, H = tensors(F), tensors(H, "H")
        validated_determinant("Ogden", determinant(F))
        L, a, R = np.linalg.svd(F)
        g, diagonal, mixed = self._derivatives(a)
        h = L.mT @ H @ R.mT
        W2 = mixed + diagonal[..., None] * EYE
        # split into symmetric and skew parts: divided differences of g, and of g continued to -a
        even = 0.5 * (h + h.mT) * self._difference(a)
        odd = 0.5 * (h - h.mT) * (g[..., :, None] + g[..., None, :])
        odd = odd / (a[..., :, None] + a[..., None, :])
        out = (even + odd) * (1 - EYE)
        own = np.einsum("...ij,...jj->...i", W2, h)
        return np.asarray(L @ (out + own[..., :, None] * EYE) @ R)

    def _derivatives(self, a: Array) -> tuple[Array, Array, Array]:
        """W_i, W_ii (..., 3) and W_ij (..., 3, 3), zero on its diagonal, of stretches a (..., 3)."""
        g, own, mixed = np.zeros_like(a), np.zeros_like(a), np.zeros((*a.shape, 3))
        for f, e in self._powers:
            g, own = g + f * e * a ** (e - 1), own + f * e * (e - 1) * a ** (e - 2)
        outer = a[..., :, None] * a[..., None, :] + EYE  # ones would do on the diagonal; it is not used
        for f, e in self._products:
            rest = (a[..., PAIRS] ** e).sum(-1)
            g, own = g + f * e * a ** (e - 1) * rest, own + f * e * (e - 1) * a ** (e - 2) * rest
            mixed = mixed + f * e**2 * outer ** (e - 1) * (1 - EYE)
        if not self.incompressible:
            J = a.prod(-1)[..., None]
            g, own = g + (2 * self.c * J**2 - self.d) / a, own + (2 * self.c * J**2 + self.d) / a**2
            mixed = mixed + 4 * self.c * J[..., None] ** 2 / outer * (1 - EYE)
        return g, own, mixed

    def _difference(self, a: Array) -> Array:
        """(g_i - g_j)/(a_i - a_j) (..., 3, 3), with its limit at equal stretches."""
        x, y = a[..., :, None], a[..., None, :]
        out = np.zeros((*a.shape, 3))
        third = (a.prod(-1)[..., None, None] / (x * y)) * np.ones((3, 3))
        for f, e in self._powers:
            out = out + f * e * divided(x, y, e - 1)
        for f, e in self._products:
            # g_i = f e a_i^(e-1) (a_k^e + a_j^e): its second part leaves (a_i a_j)^(e-1) (a_j - a_i)
            out = out + f * e * (divided(x, y, e - 1) * third**e - (x * y) ** (e - 1))
        if not self.incompressible:
            J = a.prod(-1)[..., None, None]
            out = out - (2 * self.c * J**2 - self.d) / (x * y)
        return np.asarray(out)


def divided(x: Array, y: Array, power: float) -> Array:
    """(x^p - y^p)/(x - y), accurate where x and y are near or equal."""
    low, ratio = np.minimum(x, y), np.abs(x - y) / np.minimum(x, y)
    grown = np.log1p(ratio)
    # expm1(p log(1 + r))/r, by its limit p where x = y
    slope = np.divide(np.expm1(power * grown), ratio, out=np.full_like(ratio, power), where=ratio > 0)
    return np.asarray(low ** (power - 1) * slope)
