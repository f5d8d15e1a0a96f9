"""The affine body with its rotation taken out, F = L U: any E, any frame-indifferent W.

State: rotation L, stretch U = sqrt(F^T F), body angular momentum m, stretch momentum p_U. With X = L^T F' =
hat(omega) U + U', m is the axial vector of X E U (half the angular momentum in body axes) and p_U the
symmetric part of X E. Regular while J > 0. Source: pseudo-rigid bodies, section 5.1, which corrects
corollary 3.2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from forceid.errors import DataError, EstimationError
from forceid.pseudorigid.decomposition import polar
from forceid.pseudorigid.invariants import Elastic, axial, cross, hat
from forceid.pseudorigid.rigid_body import quaternion, quaternion_rates, rotation
from forceid.pseudorigid.validation import deformation, instants, matrix
from forceid.records import Array

LEFT_SIMULATE = "left_reduced.simulate"
REDUCED_RTOL, REDUCED_ATOL = 3e-14, 1e-15  # DOP853: the tightest that its estimate tells from rounding
SYMMETRY = 1e-10  # of the force: what tells a material that lacks a symmetry from rounding
SKEW = hat(np.eye(3))
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
    return LeftState(quaternion(L), U, axial(P @ U), symmetric(P))


def left_velocity(U: Array, m: Array, p_U: Array, second_moment: Array) -> tuple[Array, Array]:
    """Body rates omega (..., 3) rad/s and U' (..., 3, 3) 1/s of the momenta: one 9 x 9 solve.

    The matrix is the kinetic energy over omega and U', and regular, as any matrix is one hat(omega) U + U'.
    """
    basis = np.concatenate(
        [SKEW @ U[..., None, :, :], np.broadcast_to(SYMMETRIC_BASIS, (*U.shape[:-2], 6, 3, 3))], -3
    )
    kinetic = np.einsum("...aij,jk,...bik->...ab", basis, second_moment, basis)
    momentum = np.concatenate([2 * m, np.einsum("aij,...ij->...a", SYMMETRIC_BASIS, p_U)], -1)
    rates = np.linalg.solve(kinetic, momentum[..., None])[..., 0]
    return rates[..., :3], np.einsum("...a,aij->...ij", rates[..., 3:], SYMMETRIC_BASIS)


def left_rates(state: LeftState, second_moment: Array, material: Elastic) -> LeftState:
    """Time derivative of the state, each like its own; dW/dU is the symmetric part of dW/dF at U.

    m' = m x omega, p_U' = sy(hat(omega)^T hat(omega) U E + E U' hat(omega)) - sy(dW/dU), p_U = sy(U' E +
    hat(omega) U E). second_moment (3, 3) kg m^2. Source: pseudo-rigid bodies, section 5.1.
    """
    q, U, m, p_U = state
    E = second_moment
    omega, dU = left_velocity(U, m, p_U, E)
    xi = hat(omega)
    force = E @ dU @ xi - xi @ xi @ U @ E - material.gradient(U)
    return LeftState(quaternion_rates(q, omega), dU, cross(m, omega), symmetric(force))


def simulate(second_moment: Array, material: Elastic, F0: Array, dF0: Array, time: Array) -> LeftMotion:
    """Motion of one body from F0, dF0 (3, 3) at time[0], by DOP853 on the left-reduced equations.

    second_moment (3, 3) kg m^2, positive definite; time (time,) s, rising. A second way to the motion, to
    check the master system by, and slower. DataError for a start, body or material that does not fit (W must
    keep under rotations of space; no constraint det F = 1); EstimationError where J falls to 0.

    >>> from forceid.pseudorigid.materials import NeoHookean
    >>> spin = 0.3 * hat(np.array([0.0, 0, 1]))
    >>> motion = simulate(np.eye(3), NeoHookean(1.0, 0.5, 3.0), np.eye(3), spin, np.array([0.0, 1.0]))
    >>> (2 * motion.L @ motion.m[..., None])[:, 2, 0].round(12)
    array([0.6, 0.6])
    """
    E, F0, dF0, time = checked_body(second_moment, F0, dF0, time, LEFT_SIMULATE)
    check_unconstrained(material, LEFT_SIMULATE)
    start = left_state(F0, dF0, E)
    turned = rotation(start.q) @ material.gradient(start.U)
    check_symmetry(material.gradient(F0), turned, "keeps its energy under rotations of space", LEFT_SIMULATE)
    shapes = [part.shape for part in start]

    def rates(y: Array) -> Array:
        return flat(left_rates(LeftState(*split_state(y, shapes)), E, material))

    def volume(y: Array) -> float:
        return float(np.linalg.det(split_state(y, shapes)[1]))

    ends = [(volume, "J falls to 0: F has no polar rotation beyond")]
    q, U, m, p_U = LeftState(
        *split_state(integrate_form(rates, flat(start), time, ends, LEFT_SIMULATE), shapes)
    )
    L, (omega, dU) = rotation(q), left_velocity(U, m, p_U, E)
    return LeftMotion(time, L @ U, L @ (hat(omega) @ U + dU), L, U, m, p_U)


def integrate_form(
    rates: Callable[[Array], Array],
    start: Array,
    time: Array,
    ends: Sequence[tuple[Callable[[Array], float], str]],
    where: str,
) -> Array:
    """States (time, size) of y' = rates(y) from start (size,); EstimationError where one of `ends` is 0.

    ends: functions of the state, positive inside the chart, each with the reason to stop. The error names
    the time.
    """

    def event(inside: Callable[[Array], float]) -> Callable[[float, Array], float]:
        def value(_: float, y: Array) -> float:
            return inside(y)

        value.terminal = True  # type: ignore[attr-defined]
        return value

    run = solve_ivp(
        lambda _, y: rates(y),
        (time[0], time[-1]),
        start,
        "DOP853",
        time,
        events=[event(inside) for inside, _ in ends],
        rtol=REDUCED_RTOL,
        atol=REDUCED_ATOL,
    )
    if run.status == 0:
        return np.asarray(run.y.T)
    hit = [
        (float(times[0]), why)
        for times, (_, why) in zip(run.t_events or [], ends, strict=False)
        if len(times)
    ]
    stop, why = min(hit, default=(float(run.t[-1]) if len(run.t) else float(time[0]), "the step falls to 0"))
    raise EstimationError(
        f"at t = {stop:.6g} s {why}", where, "end earlier, or integrate F itself: Body.simulate"
    )


def checked_body(
    second_moment: Array, F0: Array, dF0: Array, time: Array, where: str
) -> tuple[Array, Array, Array, Array]:
    """Second moment, F0, dF0 (3, 3) and time, once all are sound; DataError says what is not."""
    E = matrix(second_moment, f"{where}: second_moment")
    if not np.allclose(E, E.T, rtol=1e-12) or not np.linalg.eigvalsh(E)[0] > 1e-12 * E.max():
        raise DataError(
            "second_moment is not symmetric positive definite (3, 3)", where, "give a body with volume"
        )
    F, V = deformation(F0, f"{where}: F0"), matrix(dF0, f"{where}: dF0")
    return E, F, V, instants(time, f"{where}: time", least=2)


def check_unconstrained(material: Elastic, where: str) -> None:
    """DataError for a material that needs det F = 1, which these equations do not hold."""
    if getattr(material, "incompressible", False):
        raise DataError("holds no constraint det F = 1", where, "integrate F: Body(..., incompressible=True)")


def check_symmetry(force: Array, expected: Array, claim: str, where: str) -> None:
    """DataError where the force (3, 3) is not the one expected of a material that ... (the claim)."""
    if not np.abs(force - expected).max() <= SYMMETRY * max(np.abs(force).max(), 1.0):
        raise DataError(
            f"holds for a material that {claim}; dW/dF at F0 does not",
            where,
            "integrate F itself: Body.simulate",
        )


def symmetric(A: Array) -> Array:
    """Symmetric part of A (..., 3, 3)."""
    return 0.5 * (A + np.swapaxes(A, -1, -2))


def flat(state: Sequence[Array]) -> Array:
    """The parts of one state in a row (size,)."""
    return np.concatenate([part.ravel() for part in state])


def split_state(y: Array, shapes: Sequence[tuple[int, ...]]) -> list[Array]:
    """Parts of a state (..., size), each (..., *shape): the inverse of `flat`."""
    sizes = np.cumsum([int(np.prod(shape)) for shape in shapes])
    return [
        part.reshape(*y.shape[:-1], *shape)
        for part, shape in zip(np.split(y, sizes[:-1], axis=-1), shapes, strict=True)
    ]
