"""Materials without a shape of their own: a perfect gas, and a body without any stress.

Source: pseudo-rigid bodies, sections 1 and 7.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.pseudorigid.factors.cofactors import cofactor, determinant, inner, scaled, tensor_cross
from forceid.pseudorigid.material.material_law import check_above, validated_determinant
from forceid.pseudorigid.material.materials import inner_rows
from forceid.pseudorigid.validation import tensors
from forceid.records import Array


@dataclass(frozen=True)
class PerfectGas:
    """W = K/(gamma - 1) J^(1 - gamma): a gas of uniform temperature, adiabatic; it has no natural state.

    K > 0, gamma > 1. Source: pseudo-rigid bodies, section 7.

    >>> PerfectGas(K=1.0, gamma=1.5).gradient(np.eye(3)).diagonal()
    array([-1., -1., -1.])
    """

    K: float
    gamma: float

    incompressible = False

    def __post_init__(self) -> None:
        check_above("PerfectGas", "K", self.K)
        check_above("PerfectGas", "gamma", self.gamma, 1.0)

    def energy(self, F: Array) -> Array:
        """W (...,)."""
        F = tensors(F)
        J = validated_determinant("PerfectGas", determinant(F))
        return np.asarray(self.K / (self.gamma - 1) * J ** (1 - self.gamma))

    def gradient(self, F: Array) -> Array:
        """dW/dF (..., 3, 3): -K J^-gamma cof F."""
        F = tensors(F)
        C = cofactor(F)
        return scaled(-self.K * validated_determinant("PerfectGas", inner_rows(F, C)) ** -self.gamma, C)

    def hessian(self, F: Array, H: Array) -> Array:
        """d2W[H] (..., 3, 3)."""
        F, H = tensors(F), tensors(H, "H")
        C = cofactor(F)
        J = validated_determinant("PerfectGas", inner_rows(F, C))
        bent = scaled(self.K * self.gamma * J ** (-self.gamma - 1) * inner(C, H), C)
        return np.asarray(bent - scaled(self.K * J**-self.gamma, tensor_cross(F, H)))


@dataclass(frozen=True)
class NoStress:
    """W = 0: nothing holds the body together, and free of loads every point goes straight on, F = F0 + t F0'.

    A cloud of dust, or a fluid without pressure. No barrier: det F = 0 is reached in finite time.
    Source: pseudo-rigid bodies, section 1.

    >>> from forceid.pseudorigid.body import Body
    >>> Body(1.0, NoStress()).simulate(np.eye(3), -np.eye(3), [0.0, 0.5]).F[1].diagonal()
    array([0.5, 0.5, 0.5])
    """

    incompressible = False

    def energy(self, F: Array) -> Array:
        """W = 0 (...,)."""
        return np.zeros(tensors(F).shape[:-2])

    def gradient(self, F: Array) -> Array:
        """dW/dF = 0 (..., 3, 3)."""
        return np.zeros(tensors(F).shape)

    def hessian(self, F: Array, H: Array) -> Array:
        """d2W[H] = 0 (..., 3, 3)."""
        return np.zeros(np.broadcast_shapes(tensors(F).shape, tensors(H, "H").shape))
