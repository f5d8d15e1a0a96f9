"""What an affine body keeps: energy, angular momentum, circulation, and which holds when.

A body x = F(t) X has the second moment E = int rho X X^T, without a factor 1/2. All vectors are axial:
w stands for the skew matrix of w x. Source: pseudo-rigid bodies, sections 0 and 1.
"""

from __future__ import annotations

import numpy as np

from forceid.principal import axial
from forceid.pseudorigid.material.material_law import Material
from forceid.pseudorigid.validation import tensors
from forceid.records import Array


def kinetic_energy(dF: Array, second_moment: Array) -> Array:
    """Energy of motion (...,) in J: tr(F' E F'^T) / 2. dF (..., 3, 3) 1/s; second_moment (3, 3) kg m^2.

    Source: pseudo-rigid bodies, section 1.

    >>> float(kinetic_energy(np.eye(3), 2 * np.eye(3)))
    3.0
    """
    dF, E = tensors(dF, "dF"), tensors(second_moment, "second_moment")
    return np.asarray(0.5 * np.einsum("...ij,...jk,...ik->...", dF, E, dF))


def energy(F: Array, dF: Array, second_moment: Array, material: Material) -> Array:
    """Total energy (...,) in J: of motion, and stored in the material. Kept always.

    F, dF (..., 3, 3); second_moment (3, 3) kg m^2. Source: pseudo-rigid bodies, section 1.
    """
    return kinetic_energy(dF, second_moment) + material.energy(F)


def angular_momentum(F: Array, dF: Array, second_moment: Array) -> Array:
    """Angular momentum (..., 3), world axes, kg m^2/s: the axial vector of F' E F^T - F E F'^T.

    Kept where W(Q F) = W(F). F, dF (..., 3, 3); second_moment (3, 3) kg m^2. Source: pseudo-rigid bodies,
    section 1.

    >>> spin = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]])
    >>> angular_momentum(np.eye(3), spin, np.diag([1.0, 2, 3]))
    array([0., 0., 3.])
    """
    F, dF, E = tensors(F), tensors(dF, "dF"), tensors(second_moment, "second_moment")
    return axial(F @ E @ np.swapaxes(dF, -1, -2))


def circulation(F: Array, dF: Array, second_moment: Array) -> Array:
    """Circulation (..., 3), body axes, kg m^2/s: the axial vector of F^T F' E - E F'^T F.

    Kept where E = mu I and W(F Q) = W(F). With second_moment I these are Cauchy's invariants, 1/s: kept,
    whatever E, where W knows only det F, or F E F^T, or both, as of gas, fluid and self-gravity; also with
    det F held constant. F, dF (..., 3, 3); second_moment (3, 3) kg m^2.
    Source: pseudo-rigid bodies, section 1.

    >>> spin = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]])
    >>> circulation(np.eye(3), spin, 2 * np.eye(3))
    array([0., 0., 4.])
    """
    F, dF, E = tensors(F), tensors(dF, "dF"), tensors(second_moment, "second_moment")
    return axial(E @ np.swapaxes(dF, -1, -2) @ F)
