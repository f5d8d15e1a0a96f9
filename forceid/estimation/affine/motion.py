"""The affine motion x = c + F X of a body, and its first moments of force, from the states of its flight.

The shapes of the affine level are linear in X, so F = R G with G = G_0 + sum q_k G_k. With R^T F'' of G, the
spin and their rates, the first moments of all forces on the body are

    N = F'' E F^T,

whose antisymmetric part is the moment of the flight: it makes the rate of the spin. Source: pseudo-rigid
bodies, sections 1 and 2; theory of one model, section 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.deforming.affine_maps import AffineShapes, affine_shapes_of
from forceid.estimation.body.kinematics import Kinematics
from forceid.flight.smoother import FlightState
from forceid.principal import axial, cross, cross_matrix
from forceid.pseudorigid import polar, polar_rates
from forceid.records import Array
from forceid.rounding import COMPLEX_STEP, SOLVED


@dataclass(frozen=True)
class AffineMotion:
    """An affine motion and its first moments, world axes, F from reference axes; matrices row by row.

    F, dF 1/s (time, 3, 3), F_cov (time, 9, 9): zero where no marker shows them; first_moment (time, 3, 3)
    N m: F'' E F^T about the mass center, of all forces on the body, those in it too, row: of the force,
    column: of its arm, with covariance (time, 9, 9); applied_first_moment with covariance: of what is applied
    alone, where the material is known. What cannot be told is NaN.
    """

    shapes: AffineShapes
    F: Array
    F_cov: Array
    dF: Array
    first_moment: Array
    first_moment_cov: Array
    applied_first_moment: Array | None = None
    applied_first_moment_cov: Array | None = None

    @property
    def moment(self) -> Array:
        """Moment (time, 3) N m about the mass center: what is antisymmetric in the first moments."""
        return axial(self.first_moment.mT)

    @property
    def moment_cov(self) -> Array:
        """Covariance (time, 3, 3) of the moment."""
        return np.asarray(MOMENT @ self.first_moment_cov @ MOMENT.T)

    @cached_property
    def stretch(self) -> Array:
        """Stretch U (time, 3, 3) of F = R U, reference axes; of plane markers, NaN off the axes in it."""
        span = self.shapes.span
        square, turn = np.linalg.eigh((self.F @ span).mT @ (self.F @ span))
        U = span @ (turn * np.sqrt(np.maximum(square, 0.0))[:, None]) @ turn.mT @ span.T
        known = np.linalg.norm(np.eye(3) - span @ span.T, axis=0) < SOLVED
        return np.where(known & known[:, None], U, np.nan)

    @cached_property
    def polar(self) -> tuple[Array, Array] | None:
        """Rotation R (time, 3, 3) of F = R U and its spin (time, 3) rad/s, world axes; None where open."""
        if self.shapes.plane or not (np.linalg.det(self.F) > 0).all():
            return None
        R, (spin, *_) = polar(self.F)[0], polar_rates(self.F, self.dF)
        return R, (R @ spin[..., None])[..., 0]


def affine_motion(kin: Kinematics, state: FlightState, deformation: Deformation) -> AffineMotion:
    """The affine motion of a flight solved at the affine level, with the covariance of what moves it."""
    shapes, cov = affine_shapes_of(kin), deformation.motion_cov
    assert cov is not None
    motion = deformation.amplitude, deformation.rate, deformation.acceleration
    R, modes = state.rotation, len(kin.shapes)
    G, dG, ddG = (shapes.still * (order == 0) + shapes.of(q) for order, q in enumerate(motion))
    omega = cross_matrix(np.einsum("tba,tb->ta", R, state.omega))
    F, dF = R @ G, R @ (dG + omega @ G)
    by_q = (R[:, None] @ shapes.by_amplitude).reshape(len(R), modes, 9).mT
    by_turn = turned(F)
    turn_cov = state.pose_cov[:, 3:, 3:]
    F_cov = by_q @ cov[:, ::3, ::3] @ by_q.mT + by_turn @ turn_cov @ by_turn.mT
    if not shapes.whole:
        none = np.full_like(F, np.nan)
        return AffineMotion(shapes, F, F_cov, dF, none, np.full((len(F), 9, 9), np.nan))
    given = state.H - (R @ kin.inside[..., None])[..., 0], state.moment

    def moments(G: Array, dG: Array, ddG: Array, H: Array, T: Array, R: Any = R) -> Array:
        """N (time, 9), of maps in body axes and of H and T in world axes."""
        H, T = (np.einsum("tba,tb->ta", R, v) for v in (H, T))
        found = R @ first_moments(G, dG, ddG, shapes.second_moment, H, T) @ R.mT
        return np.asarray(found.reshape(len(G), 9))

    def slope(*step: Any, **others: Any) -> Array:
        return np.asarray(moments(*step, **others).imag / COMPLEX_STEP)

    still, small = (G, dG, ddG, *given), 1j * COMPLEX_STEP
    by_motion, by_moment, by_rotation = (np.empty((len(R), 9, n)) for n in (3 * modes, 3, 3))
    for k, own in enumerate(shapes.by_amplitude):
        for order in range(3):
            moved = tuple(a + small * own if i == order else a for i, a in enumerate(still))
            by_motion[..., 3 * k + order] = slope(*moved)
    for axis, unit in enumerate(np.eye(3)):
        by_moment[..., axis] = slope(*still[:4], given[1] + small * unit)
        by_rotation[..., axis] = slope(*still, R=R + small * cross_matrix(unit) @ R)
    N_cov = by_motion @ cov @ by_motion.mT + by_moment @ state.wrench_cov[:, 3:, 3:] @ by_moment.mT
    N_cov += by_rotation @ turn_cov @ by_rotation.mT
    if deformation.moment_motion is not None:
        linked = by_moment @ deformation.moment_motion @ by_motion.mT
        N_cov += linked + linked.mT
    return AffineMotion(shapes, F, F_cov, dF, moments(*still).reshape(-1, 3, 3), N_cov)


def first_moments(G: Array, dG: Array, ddG: Array, E: Array, H: Array, T: Array) -> Array:
    """First moments R^T N R (..., 3, 3) of a body x = R G X, body axes, of moment T and momentum H (..., 3).

    H makes the spin, and T the rate of the spin: so the antisymmetric part is T.
    """
    weighed = E @ G.mT
    W = G @ weighed
    J = np.trace(W, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - W

    def rate(v: Array) -> Array:
        return np.asarray(np.linalg.solve(J, v[..., None])[..., 0])

    def turning(v: Array, M: Array) -> Array:
        return cross(v[..., None, :], M.mT).mT

    omega = rate(H - axial((dG @ weighed).mT))
    second = ddG + 2 * turning(omega, dG) + turning(omega, turning(omega, G))
    return (second + turning(rate(T - axial((second @ weighed).mT)), G)) @ weighed


def turned(M: Array) -> Array:
    """What a small turn (3,) of the world adds to M (time, 3, 3), row by row: (time, 9, 3)."""
    each = cross_matrix(np.eye(3)) @ M[:, None]
    return np.asarray(each.reshape(len(M), 3, 9).mT)


# takes first moments, row by row, to the moment: r x f, of f r^T
MOMENT = axial(np.eye(9).reshape(9, 3, 3).mT).T
