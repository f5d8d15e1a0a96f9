"""Materials with one direction of their own, as of fibers: transversely isotropic.

Source: pseudo-rigid bodies, sections 3 and 5.1; A. J. M. Spencer, Continuum theory of the mechanics of
fibre-reinforced composites, CISM 282, Springer 1984.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.errors import DataError
from forceid.pseudorigid.factors.cofactors import EYE, inner, product, scaled, trace
from forceid.pseudorigid.material.material_law import Material, check_finite, check_material_of
from forceid.pseudorigid.material.materials import green
from forceid.pseudorigid.validation import real_vector, tensors
from forceid.records import Array

TWO_WAYS = 0.5**0.5
STRAINS = np.array(  # an orthonormal basis of symmetric matrices
    [np.diag(e) for e in np.eye(3)]
    + [
        TWO_WAYS * (np.outer(a, b) + np.outer(b, a))
        for a, b in zip(np.eye(3), np.eye(3)[[1, 2, 0]], strict=True)
    ]
)


@dataclass(frozen=True)
class TransverselyIsotropic:
    """W = base + alpha (a.G a) tr G + 2 shear |G a|^2 + beta/2 (a.G a)^2, G = (F^T F - I)/2.

    base: an isotropic material; direction a (3,), body axes, of any length but zero. alpha, shear and beta
    are energies: on a base of the Lame constants lam and mu the small-strain constants are those of Spencer,
    with the shear modulus mu across a and mu + shear along it. On StVenantKirchhoff this is the general
    quadratic law; on a base with a barrier det F stays above 0. W(Q F) = W(F) for every rotation Q, W(F Q) =
    W(F) for rotations about a; where E is round about a too, the circulation about a is kept. DataError where
    a small strain of a compressible base would gain energy.
    Source: pseudo-rigid bodies, sections 3 and 5.1; Spencer.

    >>> from forceid.pseudorigid.material.materials import StVenantKirchhoff
    >>> W = TransverselyIsotropic(StVenantKirchhoff(1.0, 1.0), (0, 0, 2), alpha=0.5, shear=0.25, beta=8.0)
    >>> strain = np.diag([0.0, 0, 1])
    >>> float(W.hessian(np.eye(3), strain)[2, 2])  # lam + 2 mu + 2 alpha + 4 shear + beta
    13.0
    """

    base: Material
    direction: tuple[float, float, float]
    alpha: float = 0.0
    shear: float = 0.0
    beta: float = 0.0

    def __post_init__(self) -> None:
        where = "TransverselyIsotropic"
        check_material_of(where, self.base)
        check_finite(where, alpha=self.alpha, shear=self.shear, beta=self.beta)
        a = real_vector(self.direction, f"{where}: direction")
        if not a.any():
            raise DataError("is zero", f"{where}: direction", "give the direction of the fibers")
        object.__setattr__(self, "direction", tuple((a / np.linalg.norm(a)).tolist()))
        if not self.incompressible:
            stiffness = np.einsum("aij,bij->ab", STRAINS, self.hessian(EYE, STRAINS))
            least = float(np.linalg.eigvalsh(stiffness)[0])
            if not least > 0:
                what = f"has the stiffness {least:.3g} in some small strain, expected > 0"
                raise DataError(what, f"{where}:", "take a smaller alpha, or a larger shear or beta")

    @property
    def incompressible(self) -> bool:
        """Whether the base is, and its bodies keep det F = 1 by a multiplier."""
        return bool(getattr(self.base, "incompressible", False))

    def energy(self, F: Array) -> Array:
        """W (...,)."""
        G = green(tensors(F))
        return np.asarray(self.base.energy(F) + 0.5 * inner(G, self._pull(G)))

    def gradient(self, F: Array) -> Array:
        """dW/dF (..., 3, 3): of the base, and F S(G), S linear in the strain G."""
        F = tensors(F)
        return np.asarray(self.base.gradient(F) + product(F, self._pull(green(F))))

    def hessian(self, F: Array, H: Array) -> Array:
        """d2W[H] (..., 3, 3): of the base, and H S(G) + F S(dG)."""
        F, H = tensors(F), tensors(H, "H")
        half = 0.5 * product(F.mT, H)
        bent = product(H, self._pull(green(F))) + product(F, self._pull(half + half.mT))
        return np.asarray(self.base.hessian(F, H) + bent)

    def _pull(self, G: Array) -> Array:
        """Second Piola stress S (..., 3, 3) of the fibers at the strain G, linear and symmetric."""
        a = np.array(self.direction)
        A, Ga = np.outer(a, a), G @ a
        along, turned = Ga @ a, Ga[..., :, None] * a
        out = scaled(self.alpha * trace(G) + self.beta * along, A) + scaled(self.alpha * along, EYE)
        return np.asarray(out + 2 * self.shear * (turned + turned.mT))
