"""What a material claims about itself, checked: derivatives, frame indifference, isotropy, natural state.

Frame indifference: dW(Q F) = Q dW(F), equivalently dW F^T symmetric (no torque). Isotropy: dW(F Q) = dW(F) Q,
equivalently F^T dW symmetric. Source: pseudo-rigid bodies, section 3, last paragraph.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.errors import DataError
from forceid.pseudorigid.factors.cofactors import EYE, determinant, inner, product
from forceid.pseudorigid.material.material_law import Material
from forceid.records import Array

IDENTITY_ROUNDING = 1e-9  # of what rounding leaves of an identity, relative to the forces
CLOSE = 1e-5  # of central differences
DIFFERENCE_STEP = 1e-4  # of central differences, refined once (Richardson)


@dataclass(frozen=True)
class MaterialCheck:
    """Largest relative violations over random F: zero up to rounding where the claim holds.

    gradient: dW/dF against differences of W; hessian: d2W[H] against differences of dW/dF; symmetry: of d2W
    between two directions; frame: dW(QF) - Q dW(F) and W(QF) - W(F); torque: skew part of dW F^T; isotropy:
    dW(FQ) - dW(F) Q and W(FQ) - W(F); stress: |dW(I)| by the stiffness there, zero in a natural state.
    """

    gradient: float
    hessian: float
    symmetry: float
    frame: float
    torque: float
    isotropy: float
    stress: float

    @property
    def consistent(self) -> bool:
        """Energy, force and stiffness are derivatives of each other."""
        return max(self.gradient, self.hessian) < CLOSE and self.symmetry < IDENTITY_ROUNDING

    @property
    def frame_indifferent(self) -> bool:
        """Rotating the body in space changes nothing: angular momentum is kept."""
        return max(self.frame, self.torque) < IDENTITY_ROUNDING

    @property
    def isotropic(self) -> bool:
        """Rotating the reference body changes nothing: with E = mu I circulation is kept."""
        return self.isotropy < IDENTITY_ROUNDING

    @property
    def natural(self) -> bool:
        """F = I is free of stress."""
        return self.stress < IDENTITY_ROUNDING


def check_material(material: Material, rng: np.random.Generator, samples: int = 32) -> MaterialCheck:
    """Check a material of one's own on random F with stretches 0.6 to 1.6, det F > 0.

    Only `energy`, `gradient` and `hessian` are asked for, over leading axes. Raises DataError where their
    shapes or values are not those of the protocol `Material`. Source: pseudo-rigid bodies, section 3.

    >>> from forceid.pseudorigid.material.materials import StVenantKirchhoff
    >>> found = check_material(StVenantKirchhoff(1.3, 0.7), np.random.default_rng(1))
    >>> found.consistent, found.frame_indifferent, found.isotropic, found.natural
    (True, True, True, True)
    """
    L, R, Q = (Rotation.random(samples, rng=rng).as_matrix() for _ in range(3))
    F = product(L * rng.uniform(0.6, 1.6, (samples, 1, 3)), R)
    H, K = rng.standard_normal((2, samples, 3, 3))
    W, P = validated_value(material, "energy", F), validated_value(material, "gradient", F)
    S, SK = validated_value(material, "hessian", F, H), validated_value(material, "hessian", F, K)
    # an energy has an arbitrary zero, and its force may vanish: both are measured by what W varies
    stiff = max(float(np.abs(S).max()), 1e-300)
    force = max(float(np.abs(P).max()), 1e-300) + stiff * 1e-3
    dW = differenced(material, "energy", F, H)
    dP = differenced(material, "gradient", F, H)
    turned, rolled = product(Q, F), product(F, Q)
    left = np.abs(material.gradient(turned) - product(Q, P)).max() / force
    right = np.abs(material.gradient(rolled) - product(P, Q)).max() / force
    spread = np.abs(W).max() + force
    left = max(left, np.abs(material.energy(turned) - W).max() / spread)
    right = max(right, np.abs(material.energy(rolled) - W).max() / spread)
    stress = material.gradient(EYE)
    stiffness = np.abs(material.hessian(EYE, H[0])).max()
    return MaterialCheck(
        gradient=float(np.abs(inner(P, H) - dW).max() / force),
        hessian=float(np.abs(S - dP).max() / stiff),
        symmetry=float(np.abs(inner(S, K) - inner(SK, H)).max() / stiff),
        frame=float(left),
        torque=float(asymmetry(product(P, F.mT)) / force),
        isotropy=float(max(right, asymmetry(product(F.mT, P)) / force)),
        stress=float(np.abs(stress).max() / max(stiffness, 1e-300)),
    )


def validated_value(material: Material, name: str, F: Array, *direction: Array) -> Array:
    """One function of the material at F, its shape and values looked at."""
    shape = F.shape[:-2] if name == "energy" else F.shape
    value = np.asarray(getattr(material, name)(F, *direction))
    where = f"{type(material).__name__}.{name}:"
    if value.shape != shape:
        raise DataError(f"gives shape {value.shape}, expected {shape}", where, "keep the leading axes of F")
    if not np.isfinite(value).all():
        at = float(determinant(F[~np.isfinite(value.reshape(len(F), -1)).all(1)][0]))
        what = f"is not finite at det F = {at:.3g}, expected finite values at every det F > 0"
        raise DataError(what, where, "mind signs of powers and logarithms")
    return value


def differenced(material: Material, name: str, F: Array, H: Array) -> Array:
    """Derivative along H by central differences, refined once."""

    def slope(step: float) -> Array:
        ahead, behind = (
            validated_value(material, name, F + step * H),
            validated_value(material, name, F - step * H),
        )
        return np.asarray((ahead - behind) / (2 * step))

    return np.asarray((4 * slope(DIFFERENCE_STEP) - slope(2 * DIFFERENCE_STEP)) / 3)


def asymmetry(A: Array) -> float:
    """Largest entry of A - A^T."""
    return float(np.abs(A - A.mT).max())
