"""Stress of an affine body at F and F': elastic, with the damping of Kelvin and Voigt beside it.

Source: pseudo-rigid bodies, sections 1 and 3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from forceid.pseudorigid.factors.cofactors import determinant
from forceid.pseudorigid.material.material_law import Material, validated_determinant
from forceid.pseudorigid.validation import tensors
from forceid.records import Array


def piola(
    material: Material, F: ArrayLike, dF: ArrayLike | None = None, damping: float = 0.0, volume: float = 1.0
) -> Array:
    """First Piola-Kirchhoff stress P = (dW/dF + damping F d(F^T F)/dt) / volume (..., 3, 3).

    Force in world axes by area of the reference body. F (..., 3, 3); dF its rate 1/s, None: no damping;
    damping J s; volume m3 of the reference body: P is then in Pa, without it in J of the whole body, as
    F'' E = N - P takes it. P(Q F) = Q P(F). A material of det F = 1 is without its multiplier, which
    subtracts Lambda cof F. Source: pseudo-rigid bodies, section 1.

    >>> from forceid.pseudorigid.material.materials import StVenantKirchhoff
    >>> piola(StVenantKirchhoff(lam=0.0, mu=1.0), np.diag([2.0, 1, 1])).diagonal()
    array([6., 0., 0.])
    """
    F = tensors(F)
    P = material.gradient(F)
    if dF is not None and damping:
        P = P + damping * viscous(F, tensors(dF, "dF"))
    return np.asarray(P / volume)


def cauchy(
    material: Material, F: ArrayLike, dF: ArrayLike | None = None, damping: float = 0.0, volume: float = 1.0
) -> Array:
    """Cauchy stress sigma = P F^T / det F (..., 3, 3), symmetric: force by area as it is, world axes.

    Arguments and units as in `piola`. sigma(Q F) = Q sigma(F) Q^T; a multiplier of det F = 1 subtracts
    Lambda I. DataError where det F is not above 0. Source: pseudo-rigid bodies, sections 1 and 3.

    >>> from forceid.pseudorigid.material.formless import PerfectGas
    >>> float(cauchy(PerfectGas(K=1.0, gamma=1.5), 4 * np.eye(3))[0, 0])  # -K / J^gamma
    -0.001953125
    """
    F = tensors(F)
    J = validated_determinant("cauchy", determinant(F))
    return np.asarray(piola(material, F, dF, damping, volume) @ F.swapaxes(-1, -2) / J[..., None, None])


def viscous(F: Array, dF: Array, other: Array | None = None) -> Array:
    """F (G^T F' + F'^T G) (..., 3, 3), with G = F or `other`: stress of Kelvin and Voigt of unit damping.

    F, dF, other (..., 3, 3) broadcast; dF 1/s. Its power on F' is |d(F^T F)/dt|^2 / 2, never below zero, and
    zero in a turn. `other` polarizes it, for derivatives by F. Source: pseudo-rigid bodies, section 1.

    >>> viscous(np.eye(3), np.diag([1.0, 0, 0])).diagonal()
    array([2., 0., 0.])
    """
    half = dF.swapaxes(-1, -2) @ (F if other is None else other)
    return np.asarray(F @ (half + half.swapaxes(-1, -2)))
