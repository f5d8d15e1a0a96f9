"""The two loads of a flight from frame to frame: force on the mass center, moment on the rotation.

The states are those of `forceid.flight.model`, each load along the axes of its prior: of one that turns with
the body, its own states stand in axes of the body, its integrals in those of the world. The rotation is
linearized about where the filter expects the next frame, which is as near as a frame behind allows.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from forceid.compiled import engine as compiled
from forceid.estimation.live.model import LiveModel
from forceid.estimation.live.sight import Seen, Swing
from forceid.estimation.live.turning import NOT_OF_BODY, SMALL_TURN, along_with_body, led_rows, turning
from forceid.flight.attitude import between, turned
from forceid.flight.priors.protocol import MOMENTUM, LoadPrior
from forceid.kalman.recursions.fixed_lag import NO_FRAME, OBSERVED, Course, begun, followed
from forceid.motion import SUBSTEP
from forceid.records import Array
from forceid.significance import WILD

TICKS = 1024  # parts of a step of the clock that steps are rounded to: 10 um at 20 m/s and 1 kHz
CLOCKS = 512  # lengths of a step that are remembered, 7 kB each: a clock with more of them costs time
NO_TURN = np.zeros(3)  # rad: of a first frame, and where nothing turns with the body


@lru_cache(CLOCKS)
def transition(model: LiveModel, load: str, ticks: int) -> tuple[Array, Array, Array]:
    """F, Q (state, state) and what weight adds (state,) over a step of so many ticks, of one of the loads."""
    prior: LoadPrior = getattr(model, load)
    if not ticks:
        n = prior.states
        return np.eye(n), np.zeros((n, n)), np.zeros(n)
    step = ticks * model.step / TICKS
    (F,), (Q,), _ = prior.chain(np.array([step]))
    u = np.zeros(len(F))
    if load == "force":
        scale = np.ones(len(F))
        scale[OBSERVED] = 1 / model.mass  # the chain holds m c
        F, Q = F * scale[:, None] / scale, Q * np.outer(scale, scale)
        gravity = model.gravity @ prior.axes
        u[OBSERVED], u[MOMENTUM] = 0.5 * step**2 * gravity, model.mass * step * gravity
    return F, Q, u


@lru_cache(8)
def still_rows(model: LiveModel, load: str) -> tuple[Array, Array | None]:
    """Rows (3, state) that read a load, world axes; of one that turns with the body its lines alone, and what
    its own states read (3, state) along its axes there.
    """
    prior: LoadPrior = getattr(model, load)
    rows = np.ascontiguousarray(prior.rows)
    if prior.body_axes is None:
        return rows, None
    own = rows.copy()
    own[:, prior.vectors :], rows[:, : prior.vectors] = 0.0, 0.0
    return rows, prior.body_axes @ own


def rows_of(model: LiveModel, load: str, R: Array | None) -> Array:
    """Rows (3, state) that read a load, world axes, of a body at the rotation R (3, 3)."""
    rows, own = still_rows(model, load)
    return rows if own is None or R is None else rows + R @ own


def begun_force(model: LiveModel) -> Course:
    """The force before its first frame, from where places are counted."""
    _, _, P = model.force.chain(np.array([model.step]))
    scale = np.ones(len(P))
    scale[OBSERVED] = 1 / model.mass
    return begun(np.zeros(len(P)), P * np.outer(scale, scale))


def begun_moment(model: LiveModel, momentum: Array) -> Course:
    """The moment before its first frame, at an angular momentum (3,) in world axes that is a guess."""
    assert model.moment is not None
    _, _, P = model.moment.chain(np.array([model.step]))
    P[OBSERVED, OBSERVED] = np.eye(3)  # rad2: as good as unknown
    x = np.zeros(len(P))
    x[MOMENTUM] = momentum @ model.moment.axes
    return begun(x, P)


def next_force(
    model: LiveModel, course: Course, ticks: int, seen: Seen | None, origin: Array,
    turn: tuple[Array, Array, Array] | None, wild: bool,
) -> tuple[Course, float]:  # fmt: skip
    """The force behind a frame, so many ticks after the one before, 0 for the first; and how far it is off.

    turn: the rotation (3, 3) before the step, what turns it (3,), world axes, and that after it, where known;
    wild: whether a frame that is far off what is expected may be left out.
    """
    prior, z, R, after = model.force, NO_FRAME, course.R, None
    F, Q, u = transition(model, "force", ticks)
    if turn is not None and prior.body_axes is not None:
        before, by, after = turn
        F, Q = along_with_body(prior, F, Q, by, before)
    if seen is not None:
        z, R = (seen.center - origin) @ prior.axes, seen.sight.cov[:3, :3]
        if seen.sight.share is None:  # else it is alike along all axes
            to_prior = prior.axes.T @ seen.rotation
            R = to_prior @ R @ to_prior.T
    most = WILD**2 if wild else np.inf
    return followed(course, F @ course.x + u, F, Q, rows_of(model, "force", after), z, R, most)


def turn_over_step(model: LiveModel, course: Course, R: Array, swing: Swing, step: float) -> Array:
    """What turns a body over a step in s (3,), world axes, at the spin that it has before: none where no load
    turns with it.
    """
    if model.moment is None or not model.turns:
        return NO_TURN
    H = model.moment.axes @ course.x[MOMENTUM]
    return np.asarray(step * (R @ np.linalg.solve(swing.J, R.T @ H - swing.h)))


def next_moment(
    model: LiveModel, course: Course, R: Array, step: tuple[float, int], seen: Seen | None,
    swings: tuple[Swing, Swing], wild: bool,
) -> tuple[Course, Array, Array, float]:  # fmt: skip
    """The moment and the rotation R (3, 3) behind a frame, what turned the body (3,), and how far off it is.

    step: since the one before, in s and in ticks, both 0 for the first; swings: before the step and after it.
    Compiled where a compiler was; the two are written apart and compared.
    """
    F, Q, _ = transition(model, "moment", step[1])
    rows, read = still_rows(model, "moment")
    most = WILD**2 if wild else np.inf
    if ONWARD is None or not step[1]:
        return onward_in_numpy(model, course, R, step, seen, swings, (F, Q, rows, read, most))
    prior, (now, then) = model.moment, swings
    assert prior is not None
    own, read = (NOT_OF_BODY, NOT_OF_BODY) if read is None else (prior.body_axes, read)
    seen_R, cov = (NO_FRAME, NO_FRAME) if seen is None else (seen.rotation, seen.sight.cov[3:, 3:])
    x, P, gain, y, C, var, off, R, noise, turn = ONWARD(
        course.P, course.gain, course.R, course.y, course.C, course.var, course.x, R, F, Q, prior.axes, now.J,
        now.h, then.J, then.h, step[0], model.least, SUBSTEP, rows, own, prior.vectors, read, SMALL_TURN,
        model.turns, seen_R, cov, most,
    )  # fmt: skip
    return Course(x, P, gain, noise, y, C, var), R, turn, off


def onward_in_numpy(
    model: LiveModel, course: Course, R: Array, step: tuple[float, int], seen: Seen | None,
    swings: tuple[Swing, Swing], linear: tuple[Array, Array, Array, Array | None, float],
) -> tuple[Course, Array, Array, float]:  # fmt: skip
    """`next_moment`, step for step; linear: F, Q, rows that read the moment, those in the body, and how far
    off a frame may be.
    """
    x, prior, (now, then), (F, Q, rows, read, most) = course.x, model.moment, swings, linear
    assert prior is not None
    by = turn_over_step(model, course, R, now, step[0])
    if step[1]:
        J, h = 0.5 * (now.J + then.J), 0.5 * (now.h + then.h)
        own, of_body = (NOT_OF_BODY, NOT_OF_BODY) if read is None else (np.asarray(prior.body_axes), read)
        led = turning(
            x, R, F, Q, prior.axes, J, h, step[0], model.least, rows, by, own, prior.vectors, of_body
        )
        x, R, F, Q, rows = led
    else:
        rows = led_rows(rows, read, R, x)
    z, cov = NO_FRAME, course.R
    if seen is not None:
        z = between(seen.rotation[None], R[None])[0]
        cov = seen.rotation @ seen.sight.cov[3:, 3:] @ seen.rotation.T
    after, off = followed(course, x, F, Q, rows, z, cov, most)
    if not len(after.gain):
        return after, R, by, off
    theta = after.x[OBSERVED].copy()
    after.x[OBSERVED] = 0.0  # the reference takes the error
    return after, turned(theta[None], R[None])[0], by, off


ONWARD: Any = getattr(compiled, "onward", None)  # None where nothing was compiled, or before it was there
