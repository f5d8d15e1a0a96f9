"""What a material claims about itself, checked: derivatives, frame indifference, isotropy, natural state.

Frame indifference: dW(Q F) = Q dW(F), equivalently dW F^T symmetric (no torque). Isotropy: dW(F Q) = dW(F) Q,
equivalently F^T dW symmetric. Source: pseudo-rigid bodies, section 3, last paragraph.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

IDENTITY_ROUNDING = 1e-9  # of what rounding leaves of an identity, relative to the forces
CLOSE = 1e-5  # of central differences
DIFFERENCE_STEP = 1e-4  # of central differences, refined once (Richardson)


@dataclass(frozen=True)
class MaterialCheck:
    """Largest relative violations over random F: zero up to rounding where the claim holds."""

    gradient: float
    hessian: float
    symmetry: float
    frame: float
    torque: float
    isotropy: float
    stress: float

    @property
    def consistent(self):
        """Energy, force and stiffness are derivatives of each other."""
        return max(self.gradient, self.hessian) < CLOSE and self.symmetry < IDENTITY_ROUNDING

    @property
    def frame_indifferent(self):
        """Rotating the body in space changes nothing."""
        return max(self.frame, self.torque) < IDENTITY_ROUNDING

    @property
    def isotropic(self):
        """Rotating the reference body changes nothing."""
        return self.isotropy < IDENTITY_ROUNDING

    @property
    def natural(self):
        """F = I is free of stress."""
        return self.stress < IDENTITY_ROUNDING


def check_material(material, rng, samples=32):
    """The material on random F with stretches 0.6 to 1.6, det F > 0."""
    L, R, Q = (Rotation.random(samples, rng=rng).as_matrix() for _ in range(3))
    F = L * rng.uniform(0.6, 1.6, (samples, 1, 3)) @ R
    H, K = rng.standard_normal((2, samples, 3, 3))
    W, P = material.energy(F), material.gradient(F)
    S, SK = material.hessian(F, H), material.hessian(F, K)
    # an energy has an arbitrary zero, and its force may vanish: both are measured by what W varies
    stiff = max(np.abs(S).max(), 1e-300)
    force = max(np.abs(P).max(), 1e-300) + stiff * 1e-3
    left = np.abs(material.gradient(Q @ F) - Q @ P).max() / force
    right = np.abs(material.gradient(F @ Q) - P @ Q).max() / force
    spread = np.abs(W).max() + force
    left = max(left, np.abs(material.energy(Q @ F) - W).max() / spread)
    right = max(right, np.abs(material.energy(F @ Q) - W).max() / spread)
    stress, stiffness = material.gradient(np.eye(3)), np.abs(material.hessian(np.eye(3), H[0])).max()
    return MaterialCheck(
        gradient=np.abs(paired(P, H) - differenced(material.energy, F, H)).max() / force,
        hessian=np.abs(S - differenced(material.gradient, F, H)).max() / stiff,
        symmetry=np.abs(paired(S, K) - paired(SK, H)).max() / stiff,
        frame=left,
        torque=asymmetry(P @ F.mT) / force,
        isotropy=max(right, asymmetry(F.mT @ P) / force),
        stress=np.abs(stress).max() / max(stiffness, 1e-300),
    )


def differenced(function, F, H):
    """Derivative along H by central differences, refined once."""

    def slope(step):
        return (function(F + step * H) - function(F - step * H)) / (2 * step)

    return (4 * slope(DIFFERENCE_STEP) - slope(2 * DIFFERENCE_STEP)) / 3


def paired(A, B):
    """A : B of matrices (..., 3, 3)."""
    return (A * B).sum((-2, -1))


def asymmetry(A):
    """Largest entry of A - A^T."""
    return np.abs(A - A.mT).max()
