"""The affine ball with both rotations taken out, F = L D R: E = mu I, isotropic W, D = diag(a).

State: axes a, rates a', and the momenta pi = M omega + K lambda and kappa = K omega + M lambda of the body
rates of L and of lambda = vee(R' R^T). In pi + kappa and pi - kappa the blocks come apart: 1/(a_i + a_j)^2
and 1/(a_i - a_j)^2. So the chart breaks where two axes coalesce, and the motion is refused there, though F
itself shows nothing. Source: pseudo-rigid bodies, section 5.2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from evidence.subjects.affine.reduced.quaternions import quaternion, quaternion_rates, rotation
from evidence.subjects.affine.reduced.reduced_form import check_symmetry, checked_body, integrate_form
from forceid.errors import DataError, EstimationError
from forceid.principal import axial, cross, cross_matrix
from forceid.pseudorigid.factors.decomposition import bipolar
from forceid.pseudorigid.material.material_law import Material
from forceid.records import Array

ROUND_BODY = 1e-13  # of E: what rounding leaves between the principal second moments of a ball
TWO_SIDED_SIMULATE = "two_sided.simulate"
GAP = 1e-4  # of the longest axis; there rounding of a_i - a_j costs 3e-12 of F, at 1e-6 the step is lost


class TwoSidedState(NamedTuple):
    """a, da, pi, kappa (..., 3); q_L and q_R (..., 4), quaternions of L and of R^T, scalar last.

    Angular momentum, world axes: 2 mu L pi; circulation: 2 mu R^T kappa. |pi| and |kappa| are Casimirs.
    """

    a: Array
    da: Array
    pi: Array
    kappa: Array
    q_L: Array
    q_R: Array


@dataclass(frozen=True)
class TwoSidedMotion:
    """F, dF, L, R (time, 3, 3) and a, da, pi, kappa (time, 3), at time (time,) s: F = L diag(a) R."""

    time: Array
    F: Array
    dF: Array
    L: Array
    R: Array
    a: Array
    da: Array
    pi: Array
    kappa: Array


def two_sided_state(F: Array, dF: Array) -> TwoSidedState:
    """State of F, dF (..., 3, 3), J > 0; at equal axes the rotations are only some of many."""
    L, a, R = bipolar(F)
    A = np.swapaxes(L, -1, -2) @ dF @ np.swapaxes(R, -1, -2)
    da = np.einsum("...ii->...i", A)
    pi, kappa = 0.5 * axial((A * a[..., None, :]).mT), 0.5 * axial((a[..., :, None] * A).mT)
    return TwoSidedState(a, da.copy(), pi, kappa, quaternion(L), quaternion(np.swapaxes(R, -1, -2)))


def rates_of_rotation(a: Array, pi: Array, kappa: Array) -> tuple[Array, Array]:
    """Rates omega + lambda and omega - lambda (..., 3) rad/s of the momenta; the latter 0 where pi = kappa.

    Source: pseudo-rigid bodies, section 5.2.

    >>> s, d = rates_of_rotation(np.array([3.0, 2, 1]), np.array([0.0, 0, 2]), np.array([0.0, 0, 1]))
    >>> s[2], d[2]
    (np.float64(0.24), np.float64(2.0))
    """
    ai, aj = cyclic_pairs(a)
    return quotient(2 * (pi + kappa), (ai + aj) ** 2), quotient(2 * (pi - kappa), (ai - aj) ** 2)


def two_sided_rates(
    state: TwoSidedState, mu: float, material: Material, incompressible: bool = False
) -> TwoSidedState:
    """Time derivative of the state, each like its own.

    pi' = pi x omega, kappa' = -kappa x lambda, a_i'' = -d(T/mu)/da_i at fixed momenta - (dW/da_i)/mu; mu
    kg m^2. incompressible: with the multiplier of a_1 a_2 a_3 = const. Source: pseudo-rigid bodies, sections
    5.2, 8.
    """
    a, da, pi, kappa, q_L, q_R = state
    s, d = rates_of_rotation(a, pi, kappa)
    omega, lam = (s + d) / 2, (s - d) / 2
    ai, aj = cyclic_pairs(a)
    outward, apart = s * s * (ai + aj) / 2, d * d * (ai - aj) / 2
    dda = (outward + apart)[..., [2, 0, 1]] + (outward - apart)[..., [1, 2, 0]]
    dda = dda - axis_forces(a, material) / mu
    if incompressible:
        pressure = (((da / a) ** 2 - dda / a).sum(-1) / (1 / a**2).sum(-1))[..., None]  # Lambda J
        dda = dda + pressure / a
    return TwoSidedState(
        da,
        dda,
        cross(pi, omega),
        -cross(kappa, lam),
        quaternion_rates(q_L, omega),
        quaternion_rates(q_R, -lam),
    )


def axis_forces(a: Array, material: Material) -> Array:
    """dW/da_i (..., 3) of an isotropic material at axes a (..., 3)."""
    return np.asarray(np.einsum("...ii->...i", material.gradient(a[..., None] * np.eye(3))))


def simulate(
    second_moment: Array, material: Material, F0: Array, dF0: Array, time: Array, incompressible: bool = False
) -> TwoSidedMotion:
    """Motion of one body from F0, dF0 (3, 3) at time[0], by DOP853 on the two-sided equations.

    second_moment mu I (3, 3) kg m^2; time (time,) s, rising; incompressible: det F is held (also where the
    material asks for it). DataError for a body that is no ball, a material that is not isotropic, a start
    that does not fit; EstimationError, naming time and axes, where axes coalesce or J falls to 0.

    >>> from forceid.pseudorigid.material.materials import NeoHookean
    >>> F0, dF0 = np.diag([1.2, 1.0, 0.9]), 0.3 * cross_matrix(np.array([0.0, 0, 1]))
    >>> motion = simulate(np.eye(3), NeoHookean(1.0, 0.5, 3.0), F0, dF0, np.array([0.0, 0.5]))
    >>> np.ptp(np.linalg.norm(motion.kappa, axis=1)) < 1e-12
    np.True_
    """
    E, F0, dF0, time = checked_body(second_moment, F0, dF0, time, TWO_SIDED_SIMULATE)
    mu = float(np.trace(E) / 3)
    if np.abs(E - mu * np.eye(3)).max() > ROUND_BODY * mu:
        raise DataError(
            "second_moment is not mu I",
            TWO_SIDED_SIMULATE,
            "use general_reduced.simulate, or integrate F itself",
        )
    held = incompressible or bool(getattr(material, "incompressible", False))
    start = two_sided_state(F0, dF0)
    check_held_volume(F0, dF0, held)
    frame = rotation(start.q_L), np.swapaxes(rotation(start.q_R), -1, -2)
    expected = (frame[0] * axis_forces(start.a, material)) @ frame[1]
    check_symmetry(material.gradient(F0), expected, "is isotropic", TWO_SIDED_SIMULATE)
    quiet = quiet_pairs(start.pi, start.kappa)
    ends = chart_ends(start.a, quiet, TWO_SIDED_SIMULATE, float(time[0]), frame[0].T @ dF0 @ frame[1].T)
    a, da, pi, kappa, q_L, q_R = integrate_form(
        lambda y: two_sided_rates(y, mu, material, held), start, time, ends, TWO_SIDED_SIMULATE
    )
    L, R = rotation(q_L), np.swapaxes(rotation(q_R), -1, -2)
    s, d = rates_of_rotation(a, pi, kappa)
    A = reduced_velocity(a, da, s, d)
    return TwoSidedMotion(time, (L * a[..., None, :]) @ R, L @ A @ R, L, R, a, da, pi, kappa)


def reduced_velocity(a: Array, da: Array, s: Array, d: Array) -> Array:
    """A = L^T F' R^T = xi D + D' + D eta (..., 3, 3), of s = omega + lambda, d = omega - lambda."""
    xi, eta = cross_matrix((s + d) / 2), cross_matrix((s - d) / 2)
    return xi * a[..., None, :] + da[..., None] * np.eye(3) + a[..., :, None] * eta


def check_held_volume(F0: Array, dF0: Array, held: bool) -> None:
    """DataError where a start does not keep the volume that is to be held."""
    rate, J = np.trace(np.linalg.solve(F0, dF0)), np.linalg.det(F0)
    if held and (abs(J - 1) > 1e-9 or abs(rate) > 1e-9 * max(1.0, np.abs(dF0).max())):
        raise DataError(
            f"has det F0 = {J:.9g} and trace(F0^-1 dF0) = {rate:.3g}, expected 1 and 0",
            TWO_SIDED_SIMULATE,
            "divide F0 by the cube root of its determinant, take the trace out of F0^-1 dF0",
        )


def quiet_pairs(pi: Array, kappa: Array) -> tuple[bool, bool, bool]:
    """Which components of pi - kappa stay exactly 0: those two axes may pass through each other."""
    others = (pi != 0) | (kappa != 0)
    still = [bool(pi[k] == kappa[k] and not others[[k - 2, k - 1]].any()) for k in range(3)]
    return still[0], still[1], still[2]


def chart_ends(
    a: Array, quiet: tuple[bool, bool, bool], where: str, start: float, A: Array
) -> list[tuple[Callable[[Array], float], str]]:
    """Functions of a state that begins with the axes, positive while its chart holds, each with the reason.

    a (3,): axes at the start, s; A (3, 3) = L^T F' R^T there. EstimationError where the chart fails at once.
    """
    ends: list[tuple[Callable[[Array], float], str]] = [
        (lambda y: float(y[:3].min()), "an axis shrinks to 0, and J with it")
    ]
    for k in range(3):
        i, j = sorted(((k + 1) % 3, (k + 2) % 3))
        why = (
            f"axes {i + 1} and {j + 1} coalesce, to {GAP:.0e} of the longest: the rotations L and R turn "
            f"without bound, as 1/(a_{i + 1} - a_{j + 1})^2"
        )
        near = abs(a[i] - a[j]) <= GAP * a.max()
        if near and (not quiet[k] or A[i, j] + A[j, i] != 0):
            raise EstimationError(f"at t = {start:.6g} s {why}", where, "integrate F itself: Body.simulate")
        if not quiet[k]:
            ends.append((gap(i, j, float(np.sign(a[i] - a[j]))), why))
    return ends


def gap(i: int, j: int, sign: float) -> Callable[[Array], float]:
    """Distance of axes i and j beyond the least that the chart bears, in units of the longest."""
    return lambda y: float(sign * (y[i] - y[j]) / y[:3].max() - GAP)


def cyclic_pairs(a: Array) -> tuple[Array, Array]:
    """a_i and a_j (..., 3) at component k, (i, j, k) cyclic."""
    return a[..., [1, 2, 0]], a[..., [2, 0, 1]]


def quotient(over: Array, under: Array) -> Array:
    """Quotient, 0 where over is 0: a turn that nothing drives, of axes that may be equal."""
    return np.divide(over, under, out=np.zeros(np.broadcast_shapes(over.shape, under.shape)), where=over != 0)
