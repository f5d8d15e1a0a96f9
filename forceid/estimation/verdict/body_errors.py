"""What a wrong body does to force and moment, to first order along the estimated motion.

The claimed body differs from the true one, the motion is the same. To first order the claimed mass center
sits at d in body axes, and the claimed inertia is wrong by dJ:
force     m R (omega' x d + omega x (omega x d))
moment    R (dJ omega' + omega x dJ omega), about the mass center
A wrong mass scales; a wrong marker is a wrong d and a turn of the axes, hence of the inertia, by the fit that
lays them; a wrong shape of deformation moves the nodes by what the fit makes of it. All from the estimated
motion. Claims count how uncertain the body is that was stated. Source: principal equations 2.4, 2.6, 4d.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from forceid.config import BodyStdSetting
from forceid.estimation.body.deformation import Deformation
from forceid.estimation.body.kinematics import Kinematics
from forceid.estimation.verdict.leakage import gauge, marker_cov
from forceid.flight.smoother import FlightState
from forceid.motion import pose_gain
from forceid.principal import cross_matrix, summation_operator
from forceid.records import Array
from forceid.rounding import SOLVED

SYMMETRIC = [(k, k) for k in range(3)] + [*combinations(range(3), 2)][::-1]  # entries of dJ, in order


@dataclass(frozen=True)
class Turning:
    """What biases are computed from: omega and its rate (time, 3) in body axes, loads in world axes."""

    kin: Kinematics
    rotation: Array
    omega: Array
    rate: Array
    force: Array
    moment: Array
    arm: Array | None


def turning_of(
    kin: Kinematics, deformation: Deformation, state: FlightState, arm: Array | None = None
) -> Turning:
    """The motion of an estimate; its angular acceleration from the moment, not from a noisy spin.

    arm (time, 3): from the point that moments are wanted about to the mass center, None: about the center.
    """
    J, h, R = deformation.inertia, deformation.h, state.rotation
    still = not len(kin.shapes)
    dJ = np.zeros_like(J) if still else np.gradient(J, kin.time, axis=0)
    dh = np.zeros_like(h) if still else np.gradient(h, kin.time, axis=0)
    omega = np.einsum("tba,tb->ta", R, state.omega)
    H = np.einsum("tab,tb->ta", J, omega) + h
    moment = np.einsum("tba,tb->ta", R, state.moment)
    left = moment - np.einsum("tab,tb->ta", dJ, omega) - dh - np.cross(omega, H)
    seen = np.isfinite(left).all(1) & np.isfinite(J).all((1, 2))
    rate = np.full_like(omega, np.nan)
    rate[seen] = np.linalg.solve(J[seen], left[seen][..., None])[..., 0]
    return Turning(kin, R, omega, rate, state.force, state.moment, arm)


def wrong_mass(motion: Turning, part: float) -> tuple[Array, Array]:
    """Force (time, 3) N and moment (time, 3) N m too large where the mass is claimed so by a part of itself.

    Its distribution is right: where nodes carry the mass the inertia goes with it; where the inertia is given
    by itself, it does not.
    """
    force = part * motion.force
    moment = 0 * force if motion.kin.inertia.nodal is None else part * motion.moment
    return force, moment if motion.arm is None else moment + np.cross(motion.arm, force)


def columns(motion: Turning) -> tuple[Array, Array]:
    """Force (time, 3, 3) per d, and moment (time, 3, 9) per d and dJ."""
    w, a, R = cross_matrix(motion.omega), cross_matrix(motion.rate), motion.rotation
    force = motion.kin.inertia.mass * R @ (a + w @ w)
    moment = np.zeros((len(R), 3, 9))
    for k, (i, j) in enumerate(SYMMETRIC):
        dJ = np.zeros((3, 3))
        dJ[i, j] = dJ[j, i] = 1.0
        # R (dJ omega' + omega x dJ omega)
        moment[:, :, 3 + k] = np.einsum(
            "tab,tb->ta", R, motion.rate @ dJ + np.cross(motion.omega, motion.omega @ dJ)
        )
    if motion.arm is not None:
        moment[:, :, :3] = cross_matrix(motion.arm) @ force - cross_matrix(motion.force) @ R
    return force, moment


def center_inertia(kin: Kinematics) -> Array:
    """Inertia (6, 3) that comes with a center wrong by d: of the nodal masses that move it there, if any."""
    if kin.inertia.nodal is None or not kin.inertia.weight.any():
        return np.zeros((6, 3))
    m, X = kin.inertia.weight, kin.shape
    dm = m[:, None] * X @ np.linalg.pinv(X.T @ (m[:, None] * X), rcond=SOLVED) * m.sum()
    each = (X**2).sum(1)[:, None, None] * np.eye(3) - X[:, :, None] * X[:, None, :]
    return np.stack([np.einsum("nd,n->d", dm, each[:, i, j]) for i, j in SYMMETRIC])


def marker_maps(kin: Kinematics) -> tuple[Array, Array]:
    """Center (marker, 3, 3) and inertia (marker, 6, 3) per claimed place of each marker, of those seen.

    The mean shape is laid into the reference shape by the weighted fit, so a wrong reference turns and
    shifts the axes of the whole record. Nodes that no marker shows stay where the reference has them.
    """
    w = np.repeat(gauge(kin), 3)
    S = summation_operator(kin.shape)
    each = np.linalg.solve(S.T @ (w[:, None] * S), S.T * w).reshape(6, -1, 3)
    gain: Array = np.asarray(each.swapaxes(0, 1)[kin.seen], float)
    m, X, J = kin.inertia.weight, kin.shape, kin.inertia.tensor
    if kin.inertia.nodal is None:
        d, turn = -gain[:, :3], cross_matrix(-gain[:, 3:].swapaxes(1, 2))
        by_turn = turn @ J - J @ turn
        return d, np.stack([by_turn[..., i, j] for i, j in SYMMETRIC], 1)
    # the mass center of the claimed shape goes along by the part of the mass that moves
    part = m[kin.seen, None, None] / m.sum()
    laid: Array = np.asarray(part * gain.sum(0) - gain)
    d, turn = laid[:, :3], laid[:, 3:]
    # relative to the markers, which are where they are, the nodes without marker move along
    shown, hidden = (m[own] @ X[own] for own in (kin.seen, ~kin.seen))
    square = X[~kin.seen].T * m[~kin.seen] @ X[~kin.seen]
    turned = (cross_matrix(turn.swapaxes(1, 2)) @ square).transpose(0, 3, 2, 1)
    grown = turned - shown[:, None, None] * d[:, None] - part[..., None] * hidden[:, None, None] * np.eye(3)
    change = 2 * np.einsum("kaae,bc->kbce", grown, np.eye(3)) - grown - grown.swapaxes(1, 2)
    return d, np.stack([change[:, i, j] for i, j in SYMMETRIC], 1)


def shape_columns(motion: Turning, q: Array) -> tuple[Array, Array]:
    """Force (time, 3, 3) per center, moment (time, 3, 9) per spread of `after_fit`, at amplitude q (time,).

    With G = sum m X u^T the momentum is R ((2 tr G - G - G^T) omega q + x q'), x the axial part of G.
    """
    kin, R, time = motion.kin, motion.rotation, motion.kin.time
    force = np.gradient(np.gradient(R * q[:, None, None], time, axis=0), time, axis=0)
    moment = np.zeros((len(q), 3, 9))
    rate = np.gradient(q, time)
    for k, (a, b) in enumerate(np.ndindex(3, 3)):
        G = np.zeros((3, 3))
        G[a, b] = 1.0
        dJ, x = 2 * np.trace(G) * np.eye(3) - G - G.T, np.cross(np.eye(3)[a], np.eye(3)[b])
        H = np.einsum("tab,tb->ta", R, motion.omega @ dJ * q[:, None] + x * rate[:, None])
        moment[:, :, k] = np.gradient(H, time, axis=0)
    return kin.inertia.mass * force, moment


def after_fit(kin: Kinematics, change: Array) -> tuple[Array, Array]:
    """What the fit makes of shapes claimed wrong by change (dof, shape), per amplitude.

    Shift (3, shape) of the center, and (9, shape) the entries of G = sum m X u^T of the error u of the nodes.
    """
    S, flat = summation_operator(kin.shape), kin.shapes.reshape(len(kin.shapes), -1).T
    rows = np.repeat(kin.seen, 3)
    gain = pose_gain(S, kin.seen, marker_cov(kin))
    if gain is None:
        return np.full((3, change.shape[1]), np.nan), np.full((9, change.shape[1]), np.nan)
    pose = -gain[0] @ change[rows]
    taken = np.linalg.pinv(np.concatenate([S, flat], 1)[rows])[6:] @ change[rows]
    left = (change + S @ pose - flat @ taken).reshape(len(kin.shape), 3, -1)
    weight = kin.inertia.weight if kin.inertia.weight.any() else gauge(kin)
    m = weight / weight.sum() * kin.inertia.mass
    return pose[:3], np.einsum("n,na,nbk->abk", m, kin.shape, left).reshape(9, -1)


def with_uncertain_body(
    state: FlightState,
    kin: Kinematics,
    deformation: Deformation,
    std: BodyStdSetting,
    shown: Set[str] = frozenset(),
) -> FlightState:
    """A state whose wrench claims what errors of the body would make of it, to first order along the motion.

    The moment is about the mass center as stated: an error of its place is a lever of the force. Each error
    is independent of all others, and the same at all times in the axes of the body. shown: loads of what the
    motion showed, all but the size of an inertia. Source: principal equations 2.4, 2.6.
    """
    if not (std.mass or std.mass_center or std.inertia):
        return state
    motion = turning_of(kin, deformation, state, np.zeros_like(state.force))
    force, moment = columns(motion)
    errors: list[tuple[Array, Array]] = [wrong_mass(motion, std.mass)]
    center = 0.0 if "force" in shown else std.mass_center
    errors += [(center * force[:, :, k], center * moment[:, :, k]) for k in range(3)]
    values, axes = np.linalg.eigh(kin.inertia.tensor)
    each = [value * np.outer(axis, axis) for value, axis in zip(values, axes.T, strict=True)]
    for wrong in [kin.inertia.tensor] if "moment" in shown else each:
        entries = np.array([wrong[at] for at in SYMMETRIC])
        errors.append((np.zeros_like(state.force), std.inertia * moment[:, :, 3:] @ entries))
    wrench = np.stack([np.concatenate(pair, 1) for pair in errors], 2)
    # where no rotation is known, the mass alone counts, and the weight of its force
    known = np.where(np.isfinite(wrench), wrench, 0.0)
    return replace(state, wrench_cov=state.wrench_cov + known @ known.mT)
