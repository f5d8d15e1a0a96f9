"""The affine body with its rotation taken out, F = L U: any E, any frame-indifferent W.

State: rotation L, stretch U = sqrt(F^T F), body angular momentum m, stretch momentum p_U. With X = L^T F' =
[omega]x U + U', m is the axial vector of X E U (half the angular momentum in body axes) and p_U the
symmetric part of X E. Regular while J > 0. Source: pseudo-rigid bodies, section 5.1, which corrects
corollary 3.2.
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
from forceid.principal import axial, cross, cross_matrix
from forceid.pseudorigid.factors.decomposition import polar
from forceid.pseudorigid.material.material_law import Material
from forceid.records import Array

LEFT_SIMULATE = "left_reduced.simulate"
SKEW = cross_matrix(np.eye(3))
_PAIRS = np.array([[0, 0], [1, 1], [2, 2], [1, 2], [2, 0], [0, 1]])
SYMMETRIC_BASIS = np.array([(np.outer(*np.eye(3)[p]) + np.outer(*np.eye(3)[p[::-1]])) / 2 for p in _PAIRS])


class LeftState(NamedTuple):
    """q (..., 4) quaternion of L, scalar last; U (..., 3, 3); m (..., 3); p_U (..., 3, 3), kg m^2/s."""

    q: Array
    U: Array
    m: Array
    p_U: Array


@dataclass(frozen=True)
class LeftMotion:
    """F, dF, L, U, p_U (time, 3, 3) and m (time, 3), at time (time,) s.

    The angular momentum, world axes, is 2 L m.
    """

    time: Array
    F: Array
    dF: Array
    L: Array
    U: Array
    m: Array
    p_U: Array


def left_state(F: Array, dF: Array, second_moment: Array) -> LeftState:
    """State of F, dF (..., 3, 3), J > 0. second_moment (3, 3) kg m^2."""
    L, U = polar(F)
    P = np.swapaxes(L, -1, -2) @ dF @ second_moment
    return LeftState(quaternion(L), U, 0.5 * axial((P @ U).mT), symmetric_part(P))


def left_velocity(U: Array, m: Array, p_U: Array, second_moment: Array) -> tuple[Array, Array]:
    """Body rates omega (..., 3) rad/s and U' (..., 3, 3) 1/s of the momenta: one 9 x 9 solve.

    The matrix is the kinetic energy over omega and U', and regular, as any matrix is one [omega]x U + U'.
    """
    basis = np.concatenate(
        [SKEW @ U[..., None, :, :], np.broadcast_to(SYMMETRIC_BASIS, (*U.shape[:-2], 6, 3, 3))], -3
    )
    kinetic = np.einsum("...aij,jk,...bik->...ab", basis, second_moment, basis)
    momentum = np.concatenate([2 * m, np.einsum("aij,...ij->...a", SYMMETRIC_BASIS, p_U)], -1)
    rates = np.linalg.solve(kinetic, momentum[..., None])[..., 0]
    return rates[..., :3], np.einsum("...a,aij->...ij", rates[..., 3:], SYMMETRIC_BASIS)


def left_rates(state: LeftState, second_moment: Array, material: Material) -> LeftState:
    """Time derivative of the state, each like its own; dW/dU is the symmetric part of dW/dF at U.

    m' = m x omega, p_U' = sy([omega]x^T [omega]x U E + E U' [omega]x) - sy(dW/dU), p_U = sy(U' E +
    [omega]x U E). second_moment (3, 3) kg m^2. Source: pseudo-rigid bodies, section 5.1.
    """
    q, U, m, p_U = state
    E = second_moment
    omega, dU = left_velocity(U, m, p_U, E)
    xi = cross_matrix(omega)
    force = E @ dU @ xi - xi @ xi @ U @ E - material.gradient(U)
    return LeftState(quaternion_rates(q, omega), dU, cross(m, omega), symmetric_part(force))


def simulate(second_moment: Array, material: Material, F0: Array, dF0: Array, time: Array) -> LeftMotion:
    """Motion of one body from F0, dF0 (3, 3) at time[0], by DOP853 on the left-reduced equations.

    second_moment (3, 3) kg m^2, positive definite; time (time,) s, rising. A second way to the motion, to
    check the master system by, and slower. DataError for a start, body or material that does not fit (W must
    keep under rotations of space; no constraint det F = 1); EstimationError where J falls to 0.

    >>> from forceid.pseudorigid.material.materials import NeoHookean
    >>> spin = 0.3 * cross_matrix(np.array([0.0, 0, 1]))
    >>> motion = simulate(np.eye(3), NeoHookean(1.0, 0.5, 3.0), np.eye(3), spin, np.array([0.0, 1.0]))
    >>> (2 * motion.L @ motion.m[..., None])[:, 2, 0].round(12)
    array([0.6, 0.6])
    """
    E, F0, dF0, time = checked_body(second_moment, F0, dF0, time, LEFT_SIMULATE)
    check_unconstrained(material, LEFT_SIMULATE)
    start = left_state(F0, dF0, E)
    turned = rotation(start.q) @ material.gradient(start.U)
    check_symmetry(material.gradient(F0), turned, "keeps its energy under rotations of space", LEFT_SIMULATE)
    ends = [
        (
            lambda y: float(np.linalg.det(y[4:13].reshape(3, 3))),
            "J falls to 0: F has no polar rotation beyond",
        )
    ]
    q, U, m, p_U = integrate_form(lambda s: left_rates(s, E, material), start, time, ends, LEFT_SIMULATE)
    L, (omega, dU) = rotation(q), left_velocity(U, m, p_U, E)
    return LeftMotion(time, L @ U, L @ (cross_matrix(omega) @ U + dU), L, U, m, p_U)


def symmetric_part(A: Array) -> Array:
    """Symmetric part of A (..., 3, 3)."""
    return 0.5 * (A + np.swapaxes(A, -1, -2))
