"""The affine body of isotropic material and any second moment, F = L D R: R does not drop out.

State: axes a, rotations L and R, and three momenta of P = L^T F' E R^T = A E_R, where A = L^T F' R^T and
E_R = R E R^T turns with the body: left, the axial vector of P D; right, that of D P; and the diagonal of P.
The right one is driven by a torque unless E = mu I. The chart breaks where axes coalesce, as in `two_sided`.
Source: pseudo-rigid bodies, section 5.3, which corrects equations (17) and (19).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evidence.subjects.affine.reduced.quaternions import quaternion, quaternion_rates, rotation
from evidence.subjects.affine.reduced.reduced_form import (
    check_symmetry,
    check_unconstrained,
    checked_body,
    integrate_form,
)
from evidence.subjects.affine.reduced.two_sided import axis_forces, chart_ends, cyclic_pairs, quotient
from forceid.principal import axial, cross, cross_matrix
from forceid.pseudorigid.factors.decomposition import bipolar
from forceid.pseudorigid.material.material_law import Material
from forceid.records import Array

GENERAL_SIMULATE = "general_reduced.simulate"


class GeneralState(NamedTuple):
    """a, p, left, right (..., 3); q_L and q_R (..., 4), quaternions of L and of R^T, scalar last.

    p, left, right in kg m^2/s: diagonal of P and axial vectors of P D and D P. The angular momentum, world
    axes, is 2 L left.
    """

    a: Array
    p: Array
    left: Array
    right: Array
    q_L: Array
    q_R: Array


@dataclass(frozen=True)
class GeneralMotion:
    """F, dF, L, R (time, 3, 3) and a, p, left, right (time, 3), at time (time,) s: F = L diag(a) R."""

    time: Array
    F: Array
    dF: Array
    L: Array
    R: Array
    a: Array
    p: Array
    left: Array
    right: Array


def general_state(F: Array, dF: Array, second_moment: Array) -> GeneralState:
    """State of F, dF (..., 3, 3), J > 0; at equal axes the rotations are only some of many."""
    L, a, R = bipolar(F)
    R_T = np.swapaxes(R, -1, -2)
    P = np.swapaxes(L, -1, -2) @ dF @ second_moment @ R_T
    p = np.einsum("...ii->...i", P).copy()
    return GeneralState(
        a,
        p,
        0.5 * axial((P * a[..., None, :]).mT),
        0.5 * axial((a[..., :, None] * P).mT),
        quaternion(L),
        quaternion(R_T),
    )


def momentum_matrix(a: Array, p: Array, left: Array, right: Array) -> Array:
    """P (..., 3, 3) of axes and momenta (..., 3): sum and difference of the axial ones come apart.

    (a_i + a_j)(P_ji - P_ij) = 2 (left + right)_k, (a_i - a_j)(P_ji + P_ij) = 2 (left - right)_k.
    """
    ai, aj = cyclic_pairs(a)
    skew = quotient(left + right, ai + aj)
    even = off_diagonal(quotient(left - right, ai - aj))
    return p[..., None] * np.eye(3) + cross_matrix(skew) + even


def body_rates(a: Array, A: Array) -> tuple[Array, Array]:
    """Body rates omega and lambda (..., 3) rad/s of A = L^T F' R^T (..., 3, 3). Source: section 2."""
    ai, aj = cyclic_pairs(a)
    even = A[..., [2, 0, 1], [1, 2, 0]] + A[..., [1, 2, 0], [2, 0, 1]]
    s, d = quotient(axial(A.mT), ai + aj), quotient(even, ai - aj)
    return (s + d) / 2, (s - d) / 2


def general_rates(state: GeneralState, second_moment: Array, material: Material) -> GeneralState:
    """Time derivative of the state, each like its own; second_moment E (3, 3) kg m^2.

    left' = left x omega; right' = lambda x right + axial([A^T A, E_R]) / 2; p' = diagonal of E_R A^T xi +
    eta E_R A^T, less dW/da. Source: pseudo-rigid bodies, section 5.3.
    """
    a, p, left, right, q_L, q_R = state
    R_T = rotation(q_R)
    E = np.swapaxes(R_T, -1, -2) @ second_moment @ R_T
    P = momentum_matrix(a, p, left, right)
    P_T = np.swapaxes(P, -1, -2)
    A = np.swapaxes(np.linalg.solve(E, P_T), -1, -2)
    omega, lam = body_rates(a, A)
    driven = np.einsum("...ii->...i", P_T @ cross_matrix(omega) + cross_matrix(lam) @ P_T)
    torque = 0.5 * axial(P.mT @ A)  # sk(A^T A E_R) = [A^T A, E_R] / 2
    return GeneralState(
        np.einsum("...ii->...i", A).copy(),
        driven - axis_forces(a, material),
        cross(left, omega),
        cross(lam, right) + torque,
        quaternion_rates(q_L, omega),
        quaternion_rates(q_R, -lam),
    )


def simulate(second_moment: Array, material: Material, F0: Array, dF0: Array, time: Array) -> GeneralMotion:
    """Motion of one body from F0, dF0 (3, 3) at time[0], by DOP853 on the general reduced equations.

    second_moment (3, 3) kg m^2, any; time (time,) s, rising. DataError for a material that is not isotropic
    or holds det F = 1, or a start that does not fit; EstimationError, naming time and axes, where axes
    coalesce or J falls to 0.

    >>> from forceid.pseudorigid.material.materials import NeoHookean
    >>> F0, dF0 = np.diag([1.2, 1.0, 0.9]), 0.3 * cross_matrix(np.array([0.0, 0, 1]))
    >>> E = np.diag([1.0, 1.5, 2.2])
    >>> motion = simulate(E, NeoHookean(1.0, 0.5, 3.0), F0, dF0, np.array([0.0, 0.5]))
    >>> np.ptp(np.linalg.norm(motion.left, axis=1)) < 1e-12
    np.True_
    """
    E, F0, dF0, time = checked_body(second_moment, F0, dF0, time, GENERAL_SIMULATE)
    check_unconstrained(material, GENERAL_SIMULATE)
    start = general_state(F0, dF0, E)
    L, R = rotation(start.q_L), rotation(start.q_R).T
    check_symmetry(
        material.gradient(F0), (L * axis_forces(start.a, material)) @ R, "is isotropic", GENERAL_SIMULATE
    )
    E_R, A = R @ E @ R.T, L.T @ dF0 @ R.T
    # what nothing turns: no axial momentum, and none that the second moment would raise
    still = not (start.left.any() or start.right.any() or (E_R - np.diag(E_R.diagonal())).any())
    ends = chart_ends(start.a, (still, still, still), GENERAL_SIMULATE, float(time[0]), A)
    a, p, left, right, q_L, q_R = integrate_form(
        lambda s: general_rates(s, E, material), start, time, ends, GENERAL_SIMULATE
    )
    L, R_T = rotation(q_L), rotation(q_R)
    P = momentum_matrix(a, p, left, right)
    R = np.swapaxes(R_T, -1, -2)
    dF = np.swapaxes(np.linalg.solve(E, np.swapaxes(L @ P @ R, -1, -2)), -1, -2)
    return GeneralMotion(time, (L * a[..., None, :]) @ R, dF, L, R, a, p, left, right)


def off_diagonal(v: Array) -> Array:
    """Symmetric matrix (..., 3, 3) with v_k (..., 3) at (i, j) and (j, i), zero on the diagonal."""
    out = np.zeros((*v.shape, 3))
    out[..., [2, 0, 1], [1, 2, 0]] = out[..., [1, 2, 0], [2, 0, 1]] = v
    return out
