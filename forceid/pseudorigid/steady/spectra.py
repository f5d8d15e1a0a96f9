"""Linear spectra of bodies in steady motion F = exp(W t) Phi exp(Lambda t), any material, free or det F = 1.

About the equilibrium Phi, Phi + delta obeys M delta'' + G delta' + K delta = 0 in the rotating frames, 18
dimensions with delta'; 16 if det F = 1. Source: pseudo-rigid bodies, sections 1 and 8, 12.2, 12.4, 12.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import null_space

from forceid.errors import DataError
from forceid.principal import cross_matrix
from forceid.pseudorigid.factors.cofactors import cofactor, tensor_cross
from forceid.pseudorigid.steady.ellipsoids import Ellipsoid
from forceid.pseudorigid.steady.gravity import SelfGravity
from forceid.pseudorigid.validation import deformation, real_vector, validated_second_moment
from forceid.records import Array

EQUILIBRIUM_SUM = 1e-8  # of the forces, that their sum at an equilibrium may be
AT_REST = (
    1e-5  # of the fastest frequency: modes below it are zero, which come in pairs and carry sqrt(rounding)
)
SAME_FREQUENCY = 1e-6  # likewise: nearer frequencies are one, which rounding splits where it is defective


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues (18,), or (16,) with det F = 1, complex, 1/s: delta as exp(s t) in the rotating frames.

    multiplier: Lambda of the pressure, Lambda cof F = force; 0 without the constraint, below 0 in tension.
    Modes that only turn the body, or the labels inside it, have the frequencies 0, |omega| and |lambda|.
    """

    eigenvalues: Any
    multiplier: float

    @property
    def frequencies(self) -> Array:
        """Frequencies Im s above zero (mode,), ascending, each as often as it occurs."""
        s = self.eigenvalues
        return np.sort(s.imag[s.imag > AT_REST * np.abs(s).max()])

    @property
    def distinct(self) -> Array:
        """Frequencies Im s above zero, ascending, each once: those that rounding split are averaged."""
        f = self.frequencies
        if not len(f):
            return f
        parts = np.split(f, np.flatnonzero(np.diff(f) > SAME_FREQUENCY * f[-1]) + 1)
        return np.array([part.mean() for part in parts])

    @property
    def growth(self) -> float:
        """The largest growth rate Re s, 1/s; 0 where all modes oscillate or stand still."""
        s = self.eigenvalues
        rate = float(s.real.max())
        return rate if rate > AT_REST * np.abs(s).max() else 0.0


def rotating_spectrum(
    material: Any,
    second_moment: Array,
    equilibrium: Array,
    omega: Array,
    lam: Array,
    incompressible: bool = False,
) -> Spectrum:
    """Spectrum of an affine body about F = exp(W t) Phi exp(Lambda t), W = [omega]x, Lambda = [lam]x.

    material: with `gradient(F)` and `hessian(F, H)`, F (3, 3); second_moment E and equilibrium Phi (3, 3);
    omega, lam (3,) 1/s. lam other than zero asks for an isotropic material and an E that it leaves alone.
    DataError where E is not positive definite or not left alone, or Phi is no equilibrium.
    Source: pseudo-rigid bodies, sections 1 and 8.

    >>> from forceid.pseudorigid.steady.ellipsoids import maclaurin
    >>> m, none = maclaurin(0.6), np.zeros(3)
    >>> found = rotating_spectrum(
    ...     SelfGravity(), np.eye(3), np.diag(m.unit_axes), np.array([0, 0, m.w]), none, incompressible=True
    ... )
    >>> print(f"{found.growth} {found.multiplier:.6f}")
    0.0 1.171731
    """
    (M, G, K), _, multiplier = linearized(material, second_moment, equilibrium, omega, lam, incompressible)
    n = len(M)
    first = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, np.hstack([K, G]))]])
    return Spectrum(np.linalg.eigvals(first), multiplier)


def linearized(
    material: Any, second_moment: Array, equilibrium: Array, omega: Array, lam: Array, incompressible: bool
) -> tuple[tuple[Array, ...], Array, float]:
    """M, G, K about an equilibrium, as of `rotating_spectrum`, of what moves, and the multiplier.

    What moves: delta of F as rows (9,) is a column of coordinates by a basis (9, mode), the second result.
    """
    E, phi = validated_second_moment(second_moment), deformation(equilibrium, "equilibrium")
    omega, lam = real_vector(omega, "omega"), real_vector(lam, "lam")
    W, Q = cross_matrix(omega), cross_matrix(lam)
    if np.abs(Q @ E - E @ Q).max() > 1e-12 * max(np.abs(E).max() * np.abs(Q).max(), 1e-300):
        raise DataError(
            "turns the second moment", "lam", "give E = mu I, or lam along an axis of symmetry of E"
        )

    C = cofactor(phi)
    carried = (W @ W @ phi + 2 * W @ phi @ Q + phi @ Q @ Q) @ E
    pull = np.asarray(material.gradient(phi))
    multiplier = float(((carried + pull) * C).sum() / (C**2).sum()) if incompressible else 0.0
    left = carried + pull - multiplier * C
    size = max(np.abs(carried).max(), np.abs(pull).max(), 1e-300)
    # of a material that is free of stress at phi what is left may be rounding
    still = np.abs(stiffness_matrix(material, phi)).max() * np.abs(phi).max()
    if np.abs(left).max() > EQUILIBRIUM_SUM * max(size, still):
        raise DataError(
            f"leaves {np.abs(left).max() / size:.1e} of its forces unbalanced, so it is no equilibrium",
            "equilibrium",
            "give F of a steady motion, with its omega and lam",
        )

    eye = np.eye(3)
    M = np.kron(eye, E)  # of delta as rows (9,), E symmetric
    G = 2 * (np.kron(W, E) + np.kron(eye, (Q @ E).T))
    K = np.kron(W @ W, E) + 2 * np.kron(W, (Q @ E).T) + np.kron(eye, (Q @ Q @ E).T)
    K = K + stiffness_matrix(material, phi, multiplier)
    free = null_space(C.reshape(1, 9)) if incompressible else np.eye(9)
    return tuple(free.T @ matrix @ free for matrix in (M, G, K)), free, multiplier


def stiffness_matrix(material: Any, F: Array, multiplier: float = 0.0) -> Array:
    """Derivative (9, 9) of dW/dF - multiplier cof F at F (3, 3), by rows."""
    unit = np.eye(9).reshape(9, 3, 3)
    bent = [np.asarray(material.hessian(F, H)) - multiplier * tensor_cross(F, H) for H in unit]
    return np.stack([column.ravel() for column in bent], -1)


def ellipsoid_spectrum(ellipsoid: Ellipsoid) -> Spectrum:
    """Second harmonics of one Riemann ellipsoid, pi G rho = 1, in the frame of its axes.

    Its frequencies hold |w| and |l|, which turn the whole, among five or more. DataError of a batch.
    Source: pseudo-rigid bodies, 12.4.

    >>> from forceid.pseudorigid.steady.ellipsoids import jacobi
    >>> print(ellipsoid_spectrum(jacobi(0.8)).frequencies.round(6))
    [0.605671 0.795213 1.164333 1.285776 1.413038]
    """
    if ellipsoid.axes.ndim != 1:
        raise DataError(
            f"holds {ellipsoid.axes.shape[:-1]} ellipsoids, expected one", "ellipsoid", "loop over them"
        )
    axis = np.array([0.0, 0.0, 1.0])
    return rotating_spectrum(
        SelfGravity(),
        np.eye(3),
        np.diag(ellipsoid.unit_axes),
        ellipsoid.w * axis,
        ellipsoid.l * axis,
        incompressible=True,
    )
