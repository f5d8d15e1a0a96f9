"""Hyperelastic materials W(F): energy, force dW/dF and stiffness along a direction.

With I1 = |F|^2, I2 = |cof F|^2, J = det F and Gamma(J) = c J^2 - d log J. Energies are those of the whole
body in units of the second moment E: E F'' = -dW/dF. Functions take F (..., 3, 3) in any frame pair: rows
are space, columns the body. Source: pseudo-rigid bodies, sections 3 and 7.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.pseudorigid.factors.cofactors import (
    EYE,
    cofactor,
    determinant,
    inner,
    product,
    scaled,
    tensor_cross,
    trace,
)
from forceid.pseudorigid.material.material_law import (
    Lame,
    check_above,
    check_finite,
    check_volumetric,
    validated_determinant,
)
from forceid.pseudorigid.material.material_law import Material as Material
from forceid.pseudorigid.validation import tensors
from forceid.records import Array


@dataclass(frozen=True)
class MooneyRivlin:
    """W = a I1 + b I2 + c J^2 - d log J; stress free at F = I where d = 2a + 4b + 2c.

    a, b, c >= 0, a + b > 0, d > 0. `incompressible` drops Gamma; bodies of it keep det F = 1 by a multiplier
    (dropping Gamma alone would leave a body that collapses). Raises DataError for constants out of range.
    Source: pseudo-rigid bodies, section 3.

    >>> W = MooneyRivlin.natural(a=0.6, b=0.25, c=0.4)
    >>> W.d, W.lame()
    (3.0, Lame(lam=2.6, mu=1.7))
    >>> float(np.abs(W.gradient(np.eye(3))).max())
    0.0
    """

    a: float
    b: float
    c: float = 0.0
    d: float = 0.0
    incompressible: bool = False

    def __post_init__(self) -> None:
        name = type(self).__name__
        check_above(name, "a", self.a, itself=True)
        check_above(name, "b", self.b, itself=True)
        check_above(name, "a + b", self.a + self.b)
        check_volumetric(name, self.c, self.d, self.incompressible)

    @classmethod
    def natural(cls, a: float, b: float, c: float) -> MooneyRivlin:
        """The constant d that leaves F = I without stress."""
        return cls(a, b, c, 2 * a + 4 * b + 2 * c)

    def lame(self) -> Lame:
        """Lame constants 4 (b + c) and 2 (a + b) of the natural material."""
        return Lame(4 * (self.b + self.c), 2 * (self.a + self.b))

    def energy(self, F: Array) -> Array:
        """W (...,)."""
        F = tensors(F)
        C = cofactor(F)
        return np.asarray(self.a * inner(F, F) + self.b * inner(C, C) + self._gamma(F))

    def gradient(self, F: Array) -> Array:
        """dW/dF (..., 3, 3): 2 (a + b I1 - b F F^T) F + Gamma'(J) cof F."""
        F = tensors(F)
        if self.b:
            B = product(F, F.mT)
            first = 2 * self.a + 2 * self.b * trace(B)
            B *= -2 * self.b
            for i in range(3):
                B[..., i, i] += first
            out = product(B, F)
        else:
            out = np.asarray((2 * self.a) * F)
        if not self.incompressible:
            C = cofactor(F)
            J = validated_determinant(type(self).__name__, inner_rows(F, C))
            C *= (2 * self.c * J - self.d / J)[..., None, None]
            out += C
        return out

    def hessian(self, F: Array, H: Array) -> Array:
        """d2W[H] (..., 3, 3)."""
        F, H = tensors(F), tensors(H, "H")
        C, dC = cofactor(F), tensor_cross(F, H)
        out = (2 * self.a) * H
        if self.b:
            out = out + (2 * self.b) * (tensor_cross(H, C) + tensor_cross(F, dC))
        if not self.incompressible:
            J = validated_determinant(type(self).__name__, inner_rows(F, C))
            out = out + scaled(2 * self.c * J - self.d / J, dC)
            out = out + scaled((2 * self.c + self.d / J**2) * inner(C, H), C)
        return np.asarray(np.broadcast_to(out, np.broadcast_shapes(F.shape, H.shape)))

    def _gamma(self, F: Array) -> Array:
        """Gamma(J) (...,)."""
        if self.incompressible:
            return np.zeros(F.shape[:-2])
        J = validated_determinant(type(self).__name__, determinant(F))
        return np.asarray(self.c * J**2 - self.d * np.log(J))


class NeoHookean(MooneyRivlin):
    """W = a I1 + c J^2 - d log J, a > 0; stress free at F = I where d = 2a + 2c.

    Source: pseudo-rigid bodies, section 3.

    >>> float(NeoHookean(a=1.0, c=0.5, d=3.0).energy(np.eye(3)))
    3.5
    """

    def __init__(self, a: float, c: float = 0.0, d: float = 0.0, incompressible: bool = False) -> None:
        super().__init__(a, 0.0, c, d, incompressible)

    @classmethod
    def natural(cls, a: float, c: float) -> NeoHookean:  # type: ignore[override]
        """The constant d that leaves F = I without stress."""
        return cls(a, c, 2 * a + 2 * c)

    def __repr__(self) -> str:
        return f"NeoHookean(a={self.a}, c={self.c}, d={self.d}, incompressible={self.incompressible})"


class HadamardGreen(MooneyRivlin):
    """W = alpha/2 I1 + beta/2 (I1^2 - tr D^4) + Gamma = alpha/2 I1 + beta I2 + Gamma, as printed.

    Mooney-Rivlin with a = alpha/2, b = beta; textbooks often write beta/4 where this has beta/2. Stress free
    at F = I where d = alpha + 4 beta + 2c. Source: pseudo-rigid bodies, section 3.

    >>> HadamardGreen.natural(alpha=1.2, beta=0.25, c=0.4).lame()
    Lame(lam=2.6, mu=1.7)
    """

    def __init__(
        self, alpha: float, beta: float, c: float = 0.0, d: float = 0.0, incompressible: bool = False
    ) -> None:
        check_above("HadamardGreen", "alpha", alpha, itself=True)
        check_above("HadamardGreen", "beta", beta, itself=True)
        super().__init__(alpha / 2, beta, c, d, incompressible)

    @property
    def alpha(self) -> float:
        """2 a."""
        return 2 * self.a

    @property
    def beta(self) -> float:
        """The constant b."""
        return self.b

    @classmethod
    def natural(cls, alpha: float, beta: float, c: float) -> HadamardGreen:
        """The constant d that leaves F = I without stress."""
        return cls(alpha, beta, c, alpha + 4 * beta + 2 * c)

    def __repr__(self) -> str:
        return f"HadamardGreen(alpha={self.alpha}, beta={self.beta}, c={self.c}, d={self.d})"


@dataclass(frozen=True)
class StVenantKirchhoff:
    """W = lam/2 (tr G)^2 + mu tr G^2, G = (F^T F - I)/2; no barrier: det F = 0 is reached in finite time.

    mu > 0, 3 lam + 2 mu > 0. Source: pseudo-rigid bodies, section 3.

    >>> float(StVenantKirchhoff(lam=1.3, mu=0.7).energy(2 * np.eye(3)))
    17.8875
    """

    lam: float
    mu: float

    incompressible = False

    def __post_init__(self) -> None:
        check_finite("StVenantKirchhoff", lam=self.lam)
        check_above("StVenantKirchhoff", "mu", self.mu)
        check_above("StVenantKirchhoff", "3 lam + 2 mu", 3 * self.lam + 2 * self.mu)

    def lame(self) -> Lame:
        """The constants themselves."""
        return Lame(self.lam, self.mu)

    def energy(self, F: Array) -> Array:
        """W (...,)."""
        F = tensors(F)
        G = green(F)
        return np.asarray(0.5 * self.lam * trace(G) ** 2 + self.mu * inner(G, G))

    def gradient(self, F: Array) -> Array:
        """dW/dF (..., 3, 3): F (lam tr G I + 2 mu G)."""
        F = tensors(F)
        G = green(F)
        return np.asarray(scaled(self.lam * trace(G), F) + 2 * self.mu * product(F, G))

    def hessian(self, F: Array, H: Array) -> Array:
        """d2W[H] (..., 3, 3)."""
        F, H = tensors(F), tensors(H, "H")
        G = green(F)
        dG = product(F.mT, H)
        dG = 0.5 * (dG + dG.mT)
        turned = scaled(self.lam * trace(G), H) + 2 * self.mu * product(H, G)
        return np.asarray(turned + scaled(self.lam * trace(dG), F) + 2 * self.mu * product(F, dG))


def inner_rows(F: Array, C: Array) -> Array:
    """Determinants (...,) from the first rows of F and of cof F."""
    a, b = F[..., 0, :], C[..., 0, :]
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


def green(F: Array) -> Array:
    """Strain G = (F^T F - I)/2 (..., 3, 3)."""
    return np.asarray(0.5 * (product(F.mT, F) - EYE))
