"""Spinning clouds of a perfect gas: free, in a harmonic trap, or held by their own gravity.

W = K J^(1 - gamma) / (gamma - 1) + mu omega_0^2 tr(F^T F) / 2 - 4 mu pi G rho R_F, for E = mu I: uniform
temperature, adiabatic flow. Source: pseudo-rigid bodies, section 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from forceid.pseudorigid.material.formless import PerfectGas
from forceid.pseudorigid.material.material_law import Material, check_above
from forceid.pseudorigid.steady.gravity import SelfGravity
from forceid.pseudorigid.validation import tensors
from forceid.records import Array

MONATOMIC = 5 / 3


@dataclass(frozen=True)
class GasCloud:
    """Stored energy of a gas cloud: K and gamma of the gas, and what holds it together.

    K: pressure times volume at J = 1, an energy; gamma > 1; trap: omega_0 of the harmonic trap, 1/s;
    pi_G_rho: of its own gravity at J = 1, 1/s^2, as in `SelfGravity`; mu of E = mu I. Without trap and
    pi_G_rho, a free cloud. DataError where a constant is out of range, and of an energy where det F <= 0.
    Source: pseudo-rigid bodies, section 7.

    >>> print(f"{GasCloud(1.0, 1.5, trap=2.0).energy(np.eye(3)):.1f}")
    8.0
    """

    K: float
    gamma: float = MONATOMIC
    trap: float = 0.0
    pi_G_rho: float = 0.0
    mu: float = 1.0

    def __post_init__(self) -> None:
        for name, least in (("K", 0.0), ("gamma", 1.0), ("mu", 0.0)):
            check_above("GasCloud", name, getattr(self, name), least)
        for name in ("trap", "pi_G_rho"):
            check_above("GasCloud", name, getattr(self, name), itself=True)

    @cached_property
    def parts(self) -> tuple[Material, ...]:
        """The gas, and its own gravity where it has one."""
        gas = PerfectGas(self.K, self.gamma)
        return (gas, SelfGravity(self.pi_G_rho, self.mu)) if self.pi_G_rho else (gas,)

    def energy(self, F: Array) -> Array:
        """W(F) (...,) of F (..., 3, 3)."""
        F = tensors(F)
        held = 0.5 * self.mu * self.trap**2 * (F * F).sum((-2, -1))
        return np.asarray(held + sum(part.energy(F) for part in self.parts))

    def gradient(self, F: Array) -> Array:
        """dW/dF (..., 3, 3): of gas and gravity, and mu omega_0^2 F."""
        F = tensors(F)
        return np.asarray(self.mu * self.trap**2 * F + sum(part.gradient(F) for part in self.parts))

    def hessian(self, F: Array, H: Array) -> Array:
        """d2W[H] (..., 3, 3) along H (..., 3, 3)."""
        F, H = tensors(F), tensors(H, "H")
        return np.asarray(self.mu * self.trap**2 * H + sum(part.hessian(F, H) for part in self.parts))
