"""The turn of a free body over a step, and the angular momentum that takes it from one rotation to the next.

    R' = [omega]x R,  omega = J_w^-1 (H - h_w),  J_w = R J R^T      theta' = J_w^-1 ([H]x theta + delta H)

with H constant in world axes, however far the body turns in a step and whatever the axis does on the way.
Source: principal equations 4b, 4f.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from forceid.motion.pose import exp, log
from forceid.principal import cross_matrix as skew
from forceid.records import Array
from forceid.significance import THOUSANDTH

SUBSTEP = 0.1  # rad that one integration step may turn
NEWTON_NEAR = 1e-4  # rad: one Newton step from there squares it, to far below what any frame shows
NEWTON_STEPS = 12  # Newton steps at most, each of which doubles the digits
TURN_MOVES = 0.5  # of a turn, or of a radian if that is more: the most that a Newton step may change it by
MOST_TURN = 600.0  # rad that a step is followed through: of a hundred turns in a gap nothing is known
SHOWN_TURN = 60.0  # rad: a momentum that turns by more from one frame to the next is no motion that they show
MOST_TURN_SUBSTEPS = 256  # of a step: a tenth of a second for a thousand steps
WIDE_STEP = 1.5  # times the usual step: where neighbors know better than the angle how often the body turned


def free_turn(step: Array, R: Array, H: Array, J: Array, h: Array) -> tuple[Array, Array, Array]:
    """Rotations (n, 3, 3) after steps (n,) s from R (n, 3, 3), and their left errors by those of R and by H.

    H (n, 3) world axes; J (n, 3, 3) and h (n, 3) body axes. Runge-Kutta-Munthe-Kaas of order 4. A step that
    would turn by more than MOST_TURN is cut to that turn.
    """

    def omega(R: Array) -> Array:
        return apply(R, apply(inverse, apply(R.swapaxes(1, 2), H) - h))

    inverse = np.asarray(np.linalg.inv(J), float)
    turned = angle(step, R, H, J, h)
    step = step * np.minimum(1.0, MOST_TURN / np.maximum(turned, 1e-300))
    n = substeps(step, apply(R.swapaxes(1, 2), H) - h, J)
    s, a_step = step[:, None] / n, step[:, None, None] / n
    by_R, by_H = np.tile(np.eye(3), (len(R), 1, 1)), np.zeros((len(R), 3, 3))
    for _ in range(n):
        k1 = omega(R)
        k2 = rotation_vector_rate(0.5 * s * k1, omega(exp(0.5 * s * k1) @ R))
        middle = exp(0.5 * s * k2) @ R
        k3 = rotation_vector_rate(0.5 * s * k2, omega(middle))
        k4 = rotation_vector_rate(s * k3, omega(exp(s * k3) @ R))
        R = exp(s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)) @ R
        J_inv = middle @ inverse @ middle.swapaxes(1, 2)
        a = J_inv @ skew(H) * a_step
        mean = np.eye(3) + a / 2 + a @ a / 6
        grown = np.eye(3) + a @ mean
        by_R, by_H = grown @ by_R, grown @ by_H + mean @ J_inv * a_step
    return R, by_R, by_H


def substeps(step: Array, H: Array, J: Array) -> int:
    """Substeps of steps (n,) s of bodies of momenta H (n, 3) and inertias J (n, 3, 3), body axes.

    As many as follow the turn, and an error of it to a thousandth. That swings by the eigenvalues of
    J^-1 [H]x, of a slender body that tumbles far faster than it turns. The middle of a substep stands for it,
    which misses swing^4 / (12 turn) of it over the square of their number (Magnus 1954).

    >>> rod = np.diag([1e-4, 1e-2, 1e-2])[None]
    >>> substeps(np.array([0.01]), np.array([[0.0, 0.1, 0.0]]), rod)  # ten radians a second
    29
    """
    turn = np.linalg.norm(np.linalg.solve(J, H[..., None])[..., 0], axis=1) * np.abs(step)
    swing = np.einsum("ni,nij,nj->n", H, J, H) / np.linalg.det(J) * step**2  # squared
    missed = swing**2 / np.maximum(12 * THOUSANDTH * turn, np.finfo(float).tiny)
    within = min(float(np.sqrt(missed.max(initial=0.0))), MOST_TURN_SUBSTEPS)
    return max(1, int(np.ceil(max(turn.max(initial=0.0) / SUBSTEP, within))))


def angle(step: Array, R: Array, H: Array, J: Array, h: Array) -> Array:
    """Angles (n,) rad by which bodies turn in a step at the rate that they begin it with; as `free_turn`."""
    body = apply(R.swapaxes(1, 2), H) - h
    rate = np.linalg.solve(J, body[..., None])[..., 0]
    return np.asarray(np.linalg.norm(rate, axis=1) * np.abs(step))


def momentum_between(time: Array, R: Array, J: Array, h: Array) -> tuple[Array, Array, Array]:
    """Angular momentum (time - 1, 3), world axes, that takes a free body from each rotation to the next.

    R, J (time, 3, 3), h (time, 3), no gaps; also the derivatives of the rotation reached, as in `free_turn`.
    Between two frames the body is taken to turn by less than half a turn; across a wider step by as much as
    its momentum on both sides says. By Newton's rule, from the momentum about the mean axis; that one stays
    where no other is found.
    """
    step, J, h = np.diff(time), 0.5 * (J[1:] + J[:-1]), 0.5 * (h[1:] + h[:-1])
    turn = log(R[1:] @ R[:-1].swapaxes(1, 2))
    middle = exp(0.5 * turn) @ R[:-1]
    H = apply(middle @ J @ middle.swapaxes(1, 2), turn / step[:, None]) + apply(middle, h)
    wide = step > WIDE_STEP * np.median(step) if len(step) else np.zeros(0, bool)
    by_R, by_H = np.empty(R[1:].shape), np.empty(R[1:].shape)
    for part in (~wide, wide):
        if not part.any():
            continue
        if part is wide:
            near, far = np.flatnonzero(~wide), np.flatnonzero(wide)
            H[far] = np.stack([np.interp(far, near, axis) for axis in H[near].T], 1)
        H[part], by_R[part], by_H[part] = shot(
            step[part], R[:-1][part], R[1:][part], H[part], J[part], h[part]
        )
    return H, by_R, by_H


def shot(step: Array, start: Array, to: Array, H: Array, J: Array, h: Array) -> tuple[Array, Array, Array]:
    """The momentum (n, 3) near H that takes rotations `start` (n, 3, 3) to `to`; H itself where none does.

    With the derivatives of the rotation reached, as in `free_turn`.
    """
    found, H, open_ended = H.copy(), H.copy(), np.ones(len(H), bool)
    by = np.empty((2, len(H), 3, 3))
    left = np.flatnonzero(angle(step, start, H, J, h) < SHOWN_TURN)
    for _ in range(NEWTON_STEPS + 1):
        if not len(left):
            break
        reached, by_R, by_H = free_turn(step[left], start[left], H[left], J[left], h[left])
        miss = log(to[left] @ reached.swapaxes(1, 2))
        there = np.linalg.norm(miss, axis=1) < NEWTON_NEAR
        change = np.linalg.solve(by_H, miss[..., None])[..., 0]
        found[left[there]] = H[left[there]] + change[there]
        by[:, left[there]], open_ended[left[there]] = (by_R[there], by_H[there]), False
        left, change = left[~there], change[~there]
        turned = angle(step[left], start[left], H[left], J[left], h[left])
        more = angle(step[left], start[left], change, J[left], 0.0 * h[left])
        reach = TURN_MOVES * np.maximum(turned, 1.0)  # below a radian Newton's rule needs no bound
        H[left] += np.minimum(1.0, reach / np.maximum(more, 1e-300))[:, None] * change
        left = left[angle(step[left], start[left], H[left], J[left], h[left]) < SHOWN_TURN]
    if open_ended.any():
        step, *rest = (a[open_ended] for a in (step, start, found, J, h))
        shown = np.minimum(1.0, SHOWN_TURN / np.maximum(angle(step, *rest), 1e-300))
        by[:, open_ended] = free_turn(shown * step, *rest)[1:]
    return found, by[0], by[1]


def largest_turn(time: Array, R: Array) -> float:
    """Largest rotation (rad) of R (time, 3, 3) between frames a usual step apart; zero where there is none.

    Frames that are NaN are not there: the usual step is that of the frames which show a rotation. One pose
    that is off turns two steps in a row: of five steps the median counts.
    """
    seen = np.isfinite(R).all((1, 2))
    step = np.diff(time[seen])
    if not len(step):
        return 0.0
    near = step < WIDE_STEP * np.median(step)
    turned = log((R[seen][1:] @ R[seen][:-1].swapaxes(1, 2))[near])
    return float(median_filter(np.linalg.norm(turned, axis=1), 5).max(initial=0.0))


def rotation_vector_rate(phi: Array, omega: Array) -> Array:
    """Rate of the rotation vector phi of a body that turns at omega, both world axes, small phi."""
    turned = np.cross(phi, omega)
    return omega - 0.5 * turned + np.cross(phi, turned) / 12


def apply(A: Array, v: Array) -> Array:
    """Matrices (n, 3, 3) times vectors (n, 3)."""
    return np.asarray((A @ v[..., None])[..., 0])
