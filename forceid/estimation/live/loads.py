"""The two loads of a flight from frame to frame: force on the mass center, moment on the rotation.

The states are those of `forceid.flight.model`, each load along the axes of its prior: of one that turns with
the body, its own states stand in axes of the body, its integrals in those of the world. The rotation is
linearized about where the filter expects the next frame, which is as near as a frame behind allows.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from forceid.estimation.live.model import LiveModel
from forceid.estimation.live.sight import Seen, Swing
from forceid.estimation.live.turning import along_with_body, led_rows, turning
from forceid.flight.attitude import between, turned
from forceid.flight.priors.protocol import MOMENTUM, LoadPrior
from forceid.kalman.recursions.fixed_lag import NO_FRAME, OBSERVED, Course, begun, followed
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


def spin_of(J: Array, H: Array) -> Array:
    """J^-1 H (3,) of an inertia (3, 3) by its cofactors, eight times as fast as `solve`."""
    a, b, c, _, d, e, _, _, f = J.ravel().tolist()
    x, y, z = H.tolist()
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
    size = a * A + b * B + c * C
    return np.array([A * x + B * y + C * z, B * x + D * y + E * z, C * x + E * y + F * z]) / size


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
    return np.asarray(step * (R @ spin_of(swing.J, R.T @ H - swing.h)))


def next_moment(
    model: LiveModel, course: Course, R: Array, step: tuple[float, int], by: Array, seen: Seen | None,
    swings: tuple[Swing, Swing], wild: bool,
) -> tuple[Course, Array, float]:  # fmt: skip
    """The moment and the rotation R (3, 3) behind a frame, and how far off that is.

    step: since the one before, in s and in ticks; by (3,): what turns the body over it, of `turn_over_step`;
    swings: before the step and after it.
    """
    x, (F, Q, _) = course.x, transition(model, "moment", step[1])
    rows, read = still_rows(model, "moment")
    if step[1]:
        x, R, F, Q, rows = turning(model, x, R, step[0], by, swings, F, Q, rows, read)
    else:
        rows = led_rows(rows, read, R, x)
    z, cov = NO_FRAME, course.R
    if seen is not None:
        z, cov = (
            between(seen.rotation[None], R[None])[0],
            seen.rotation @ seen.sight.cov[3:, 3:] @ seen.rotation.T,
        )
    after, off = followed(course, x, F, Q, rows, z, cov, WILD**2 if wild else np.inf)
    if not len(after.gain):
        return after, R, off
    theta = after.x[OBSERVED].copy()
    after.x[OBSERVED] = 0.0  # the reference takes the error
    return after, turned(theta[None], R[None])[0], off
