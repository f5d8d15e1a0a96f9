"""A step of a load on a body that turns: where it leads, what it adds, and what reads the load behind it.

A moment turns the body, and with it the axes of a load that keeps to them. Compiled where a compiler was; the
two are written apart and compared.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from forceid.compiled import engine as compiled
from forceid.flight.attitude import ReferenceTrajectory, turn_along
from forceid.flight.priors.protocol import INTEGRAL, LOAD, MOMENTUM, LoadPrior
from forceid.kalman.recursions.fixed_lag import OBSERVED
from forceid.motion import SUBSTEP
from forceid.records import Array

BOTH = slice(0, 6)  # the two integrals of a load
SMALL_TURN = 0.01  # rad: means over a shorter turn are those of none, to 1e-5 of what it bends
WITHOUT_TURN = 1 / 2, 1 / 6, 1 / 12  # of no turn, of what multiplies its first power and its square
NOT_OF_BODY = np.zeros((0, 3))  # axes, and what is read along them, of a load that stays in the world


def along_with_body(prior: LoadPrior, F: Array, Q: Array, turn: Array, R: Array) -> tuple[Array, Array]:
    """F and Q (state, state) over a step of a load that turns with a body: by the rotation vector turn (3,),
    world axes, from R (3, 3). What its states add to the integrals goes to the axes of the world.
    """
    assert prior.body_axes is not None
    given = F, Q, turn, R, prior.body_axes, prior.vectors
    return along_in_numpy(*given) if ALONG is None else ALONG(*given, SMALL_TURN)


def along_in_numpy(F: Array, Q: Array, turn: Array, R: Array, own: Array, states: int) -> tuple[Array, Array]:
    """`along_with_body` of so many states along own axes (3, 3), step for step.

    The mean of exp(u turn) over u from 0 to 1, and, as a push early in the step counts more in the second
    integral, that with the weight 2 (1 - u): as of `forceid.flight.priors.body_fixed`, of a steady spin.
    """
    size, K = math.hypot(*turn.tolist()), skew(turn)
    a, b, c = WITHOUT_TURN
    if size > SMALL_TURN:
        a, b = (1 - math.cos(size)) / size**2, (size - math.sin(size)) / size**3
        c = (1 - 2 * a) / size**2
    at = R @ own
    once = K @ at
    twice, along = K @ once, np.zeros((6, 6))
    along[INTEGRAL, INTEGRAL] = at + 2 * b * once + c * twice
    along[MOMENTUM, MOMENTUM] = at + a * once + b * twice
    F, Q = F.copy(), Q.copy()
    F[BOTH, LOAD.start : states] = along @ F[BOTH, LOAD.start : states]
    Q[BOTH, :states] = along @ Q[BOTH, :states]
    Q[:states, BOTH] = Q[:states, BOTH] @ along.T
    return F, Q


def skew(a: Array) -> Array:
    """[a]x (3, 3) of one vector, eight times as fast as `cross_matrix`: each frame needs some."""
    x, y, z = a.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def turning(
    x: Array, R: Array, F: Array, Q: Array, axes: Array, J: Array, h: Array, step: float, least: float,
    rows: Array, by: Array, own: Array, states: int, read: Array,
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    """Where a step leads from the states x and R: states and rotation, F and Q with the rotation error, and
    the rows (3, state) that read the moment behind it, of `rows` in the world and `read` in the body.

    axes (3, 3): of the states; J (3, 3) and h (3,): half way, least: the smallest moment of inertia; by (3,):
    what turns the body over the step, own (3, 3): axes of a load that turns with it, empty else, and how many
    states are its own.
    """
    if len(own):
        F, Q = along_in_numpy(F, Q, by, R, own, states)
        F[MOMENTUM, OBSERVED] = -skew(F[MOMENTUM, LOAD] @ x[LOAD])  # states that stand in the body
    away, H = F @ x, x[MOMENTUM]
    three = np.array([H, away[INTEGRAL] - step * H, away[MOMENTUM] - H]) @ axes.T
    # the moment and its rate over the step that do as much to the two integrals
    over = np.array([[1, 0, 0], [0, 6 / step**2, -2 / step], [0, -12 / step**3, 6 / step**2]]) @ three
    size = math.hypot(*over[0].tolist()) + math.hypot(*h.tolist())
    J, h = (np.stack([0 * a, 0 * a, 0 * a, a])[:, None] for a in (J, h))
    H0, T, dT = np.repeat(over[:, None], 2, 1)
    substeps = 1 + int(size / least * step / SUBSTEP)
    path = ReferenceTrajectory(np.array([step]), np.array([R, R]), H0, T, dT, J, h, substeps)
    (R_next,), (by_theta,), by_H = turn_along(path)
    start, first, second = by_H[:, 0] @ axes
    by_both = np.concatenate(
        [6 * (first - second / step) / step**2, (3 * second / step - 2 * first) / step], 1
    )
    top, noise = by_both @ F[BOTH], by_both @ Q[BOTH]
    top[:, OBSERVED], top[:, MOMENTUM] = by_theta, start
    noise[:, OBSERVED] = noise[:, BOTH] @ by_both.T
    away[OBSERVED] = 0.0
    F, Q = F.copy(), Q.copy()
    F[OBSERVED] = top
    Q[OBSERVED], Q[:, OBSERVED] = noise, noise.T
    return away, R_next, F, Q, led_rows(rows, read if len(own) else None, R_next, away)


def led_rows(rows: Array, read: Array | None, R: Array, x: Array) -> Array:
    """Rows (3, state) that read the moment of the states x about the rotation R, whose error turns what turns
    with the body.
    """
    if read is None:
        return rows
    rows = rows + R @ read
    rows[:, OBSERVED] = -skew(rows @ x)
    return rows


ALONG: Any = getattr(compiled, "along", None)  # None where nothing was compiled, or before it was there
