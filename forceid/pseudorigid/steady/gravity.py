"""Self-gravity of an ellipsoidal body as a stored energy of its deformation, and gas clouds that it holds.

The reference body is a ball, E = mu I, and its density falls as 1/J: W = -4 mu pi G rho R_F(a_1^2, a_2^2,
a_3^2) with rho at J = 1 and a_i the singular values of F. A cloud of a perfect gas of uniform temperature
adds K J^(1 - gamma) / (gamma - 1), and in a harmonic trap mu omega_0^2 tr(F^T F) / 2.
Source: pseudo-rigid bodies, sections 7 and 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from forceid.pseudorigid.material.formless import PerfectGas
from forceid.pseudorigid.material.material_law import Material, check_above
from forceid.pseudorigid.steady.index_symbols import index_symbols, pair_symbols, potential_integral
from forceid.pseudorigid.validation import tensors
from forceid.records import Array

MONATOMIC = 5 / 3


@dataclass(frozen=True)
class SelfGravity:
    """Stored energy of a body's own gravity: pi_G_rho = pi G rho in 1/s^2 at det F = 1, and mu of E = mu I.

    Energies have the unit of mu over s^2. Defined for every F of rank 3, smooth where axes are equal. A
    homogeneous ball of mass m and radius r has rho = 3 m / (4 pi r^3) and mu = m r^2 / 5. The law is that of
    every density that is constant on similar ellipsoids: a Gaussian cloud of standard deviation s has
    mu = m s^2 and pi G rho = G m / (8 sqrt(pi) s^3). DataError where a constant is not positive and finite.
    Source: pseudo-rigid bodies, section 8.

    >>> print(f"{SelfGravity(pi_G_rho=1.0).energy(np.eye(3)):.1f}")
    -4.0
    """

    pi_G_rho: float = 1.0
    mu: float = 1.0

    def __post_init__(self) -> None:
        check_above("SelfGravity", "pi_G_rho", self.pi_G_rho)
        check_above("SelfGravity", "mu", self.mu)

    def energy(self, F: Array) -> Array:
        """W(F) (...,) of F (..., 3, 3): -(3/5) G m^2 R_F for a homogeneous ball, mu = m r^2 / 5."""
        F = tensors(F)
        a = np.linalg.svd(F, compute_uv=False)
        return np.asarray(-4 * self.mu * self.pi_G_rho * potential_integral(*np.moveaxis(a, -1, 0)))

    def gradient(self, F: Array) -> Array:
        """dW/dF = 2 mu pi G rho (A(B)/J) F (..., 3, 3), B = F F^T and A(B) with the eigenvalues A_i."""
        F = tensors(F)
        L, a, R = np.linalg.svd(F)
        force = index_symbols(*np.moveaxis(a, -1, 0)) * a / a.prod(-1)[..., None]
        return np.asarray(2 * self.mu * self.pi_G_rho * (L * force[..., None, :]) @ R)

    def hessian(self, F: Array, H: Array) -> Array:
        """d2W[H] (..., 3, 3) along H (..., 3, 3), which broadcasts against F.

        The divided differences of A_i by a_i^2 that a derivative of A(B) holds are -A_ij, so nothing is lost
        at equal axes.
        """
        F, H = tensors(F), tensors(H, "H")
        L, a, R = np.linalg.svd(F)
        axes = np.moveaxis(a, -1, 0)
        A, A_pair = index_symbols(*axes), pair_symbols(*axes)[0]
        h = np.swapaxes(L, -1, -2) @ H @ np.swapaxes(R, -1, -2)
        ha = h * a[..., None, :]
        dB = ha + np.swapaxes(ha, -1, -2)
        stretched = np.diagonal(dB, axis1=-2, axis2=-1)
        # A_i/J by a_j^2: -A_ij / (2 J), three times that where j = i
        on_axis = 0.5 * np.einsum("...ij,...j->...i", A_pair, stretched)
        on_axis = on_axis + np.diagonal(A_pair, axis1=-2, axis2=-1) * stretched
        eye = np.eye(3)
        dA = -A_pair * dB * (1 - eye) - on_axis[..., None] * eye
        change = dA * a[..., None, :] + A[..., None] * h
        return np.asarray(2 * self.mu * self.pi_G_rho * L @ (change / a.prod(-1)[..., None, None]) @ R)


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
