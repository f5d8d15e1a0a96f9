"""Gauss-Newton on the rotations of a rigid flight, compiled: about each reference the smoother goes in lanes.

The first round moves the rotation by itself, at a fifth of the cost; the next ones all of the flight. Each
leaves an error that is its own step times the ratio of that step to the one before, or less, since the steps
shrink ever faster: they end when that is a thousandth of the standard deviation. Source: principal equations
4f.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from forceid.compiled import engine as compiled
from forceid.flight.attitude import ReferenceTrajectory, between, turned
from forceid.flight.model import LOOK_AFTER, Flight
from forceid.flight.path.reference import COARSE, UNKNOWN_TURN
from forceid.flight.path.rigid_batch import Mode, Path, TurningModel, smooth_turning
from forceid.flight.priors.protocol import MOMENTUM, LoadPrior
from forceid.kalman.model import StateSpace
from forceid.motion import apply
from forceid.records import Array, Indices
from forceid.rounding import ITERATIONS
from forceid.significance import THOUSANDTH

WORTH_LANES = 256  # samples below which it does not pay


@dataclass(frozen=True)
class StepClasses:
    """What the steps of each kind, all of one length, have in common; states that are zero for ever left out.

    which (step,): kind of each; F, Q (kind, state, state), u (kind, state), x0, P0: translation, then the
    chain of the moment, from state `theta` on; H (6, state); read (12, state): rows of wrench and pose; loads
    (5, state, 3): columns of momentum, force, angular momentum, moment and its rate, world axes; pushed (2,
    kind, state, 3): of moment and rate over each kind of step; chain (state from theta on,): which states of
    the whole chain they are, of `size`.
    """

    which: Indices
    F: Array
    Q: Array
    u: Array
    x0: Array
    P0: Array
    H: Array
    read: Array
    loads: Array
    pushed: Array
    theta: int
    chain: Indices
    size: int


def classify_steps(time: Array) -> tuple[Array, Indices]:
    """Times (kind + 1,) between which each kind of step is once, and the kind of each step."""
    classes, which = np.unique(np.round(np.diff(time), 12), return_inverse=True)
    return np.concatenate([[0.0], np.cumsum(classes)]), which


def step_classes(
    time: Array, which: Indices, free: StateSpace | None, force: LoadPrior | None, moment: LoadPrior
) -> StepClasses:
    """The kinds of steps between the times `time`, of each of which `free` is the translation, if any."""
    F, Q, P0 = moment.chain(np.diff(time))
    P0[:3, :3] = UNKNOWN_TURN**2 * np.eye(3)
    if free is None:
        none = np.zeros((len(F), 0, 0))
        u = np.zeros((len(F), 0))
        free = StateSpace(none, none, np.zeros((3, 0)), np.eye(3), np.zeros(0), none[0], u)
    n, m = len(free.x0), len(P0)
    pushed = np.zeros((2, len(F), n + m, 3))
    pushed[:, :, n:] = np.stack(load_over_step(F, np.diff(time), moment.axes)).swapaxes(2, 3)
    both = np.zeros((2, len(F), n + m, n + m))
    both[0, :, :n, :n], both[1, :, :n, :n], both[0, :, n:, n:], both[1, :, n:, n:] = free.F, free.Q, F, Q
    F, Q, P0 = *both, block_diag(free.P0, P0)
    # zero for ever: known so at the start, and moved by itself alone
    moved = P0.any(1) | Q.any((0, 2)) | (F * (1 - np.eye(n + m))).any((0, 2))
    s = np.flatnonzero(moved)
    read = np.zeros((12, n + m))
    read[3:6, n:], read[9:, n : n + 3] = moment.rows, np.eye(3)
    assert free.u is not None
    u = np.concatenate([free.u, np.zeros((len(F), m))], 1)[:, s]
    x0, H = np.concatenate([free.x0, np.zeros(m)])[s], block_diag(free.H, np.eye(3, m))[:, s]
    loads = np.zeros((15, n + m))
    if force is not None:
        read[:3, :n], read[6:9, :3] = force.rows, force.axes
        loads[:6, :n] = np.concatenate([a.T for a in force.read(np.eye(n))[:2]])
    loads[6:, n:] = np.concatenate([a.T for a in moment.read(np.eye(m))])
    # contiguous: a product this thin is slow in any other order
    columns = np.ascontiguousarray(loads[:, s].reshape(5, 3, len(s)).swapaxes(1, 2))
    return StepClasses(
        which, F[:, s][:, :, s], Q[:, s][:, :, s], u, x0, P0[s][:, s], H, read[:, s], columns,
        np.ascontiguousarray(pushed[:, :, s]), int((s < n).sum()), s[s >= n] - n, m,
    )  # fmt: skip


def load_over_step(F: Array, step: Array, axes: Array) -> tuple[Array, Array]:
    """Rows (step, 3, state), world axes, that read a load over a step, and its rate, out of the chain before
    it.

    Of the load that changes evenly over the step and does as much to Y and H as the chain's own: a load that
    oscillates between two samples is not known by its value and rate at the first. F: of the chain, along
    axes.
    """
    s = step[:, None, None]
    Y, H = F[:, :3].copy(), F[:, MOMENTUM].copy()
    Y[:, :, :6] = H[:, :, :6] = 0.0
    return axes @ (6 * Y / s**2 - 2 * H / s), axes @ (6 * H / s**2 - 12 * Y / s**3)


def pushed_by(classes: StepClasses, x: Array) -> list[Array]:
    """The moment and its rate (time, 3) over the step that each sample begins; no step begins at the last."""
    which = np.append(classes.which, 0)
    if len(classes.F) == 1:
        return [x @ columns[0] for columns in classes.pushed]
    return [np.einsum("ts,tsa->ta", x, columns[which]) for columns in classes.pushed]


def rotation_alone(classes: StepClasses, rows: tuple[Array, Array, Array], pose_cov: Array) -> TurningModel:
    """The rotation by itself, as if its errors had nothing to do with those of the mass center."""
    k, s = classes, slice(classes.theta, None)
    R = np.ascontiguousarray(pose_cov[:, 3:, 3:])
    still = k.H[3:, s], R, k.x0[s], k.P0[s, s], k.read[:, s]
    return TurningModel(k.F[:, s, s], k.Q[:, s, s], k.u[:, s], k.which, *rows, 0, *still)


def by_frames(flight: Flight, moment: LoadPrior) -> tuple[Array, Array] | None:
    """Rotations as measured, and their angular momentum (time, 3) along the axes of the prior.

    None where a frame is missing, or turns far: there is more to a first reference then.
    """
    R = flight.rotation
    turns = between(R[1:], R[:-1])
    if not (np.abs(turns).max() < COARSE):
        return None
    omega = turns / np.diff(flight.time)[:, None]
    omega = np.concatenate([omega[:1], 0.5 * (omega[1:] + omega[:-1]), omega[-1:]])
    body = apply(flight.inertia, apply(R.swapaxes(1, 2), omega)) + flight.h
    return R, (apply(R, body) - flight.whole(np.zeros_like(body))) @ moment.axes


def settled_in_batches(
    flight: Flight, classes: StepClasses, force: LoadPrior | None, moment: LoadPrior,
    trajectory_of: Callable[[Array, Array, Array, Array], ReferenceTrajectory], causal: bool,
) -> tuple[Path, Array, Array] | None:  # fmt: skip
    """The flight about a reference where it comes to rest: path, and rotations and moment chain of that.

    trajectory_of: the flight about a rotation, momentum, moment and its rate. None where only the passes of
    an engine will do.
    """
    t, time, center = classes.theta, flight.time, flight.center
    if compiled is None or len(time) < WORTH_LANES or (first := by_frames(flight, moment)) is None:
        return None
    R, last, least, since = first[0], np.inf, np.inf, 0
    guess = np.zeros((len(R), len(classes.x0)))  # where a lane may begin; from theta on the reference
    guess[:, t + 3 : t + 6] = first[1]
    if force is not None:
        guess[:, :3], apart = center @ force.axes, (time[2:] - time[:-2])[:, None]
        guess[1:-1, MOMENTUM] = flight.mass * (guess[2:, :3] - guess[:-2, :3]) / apart
    moment_block = classes.F[:, t:, t:], classes.Q[:, t:, t:]
    for alone in (True, *[False] * ITERATIONS):
        chain = guess[:, t:].copy()
        parts = trajectory_of(R, guess @ classes.loads[2], *pushed_by(classes, guess)).parts
        rows: tuple[Array, Array, Array] = compiled.rotation_rows(
            *parts, *moment_block, classes.which, moment.axes, chain
        )
        theta = between(flight.rotation, R)
        if alone or force is None:
            model, z, near = rotation_alone(classes, rows, flight.pose_cov), theta, chain
        else:
            k, z, near = classes, np.concatenate([center, theta], 1), guess
            model = TurningModel(
                k.F, k.Q, k.u, k.which, *rows, t, k.H, flight.pose_cov, k.x0, k.P0, k.read
            )  # the whole flight about the reference
        path = smooth_turning(model, z, near, Mode.STATES if alone else Mode.SMOOTHED)
        if path is None:
            return None
        x = path.x if alone else path.x[:, t:]
        step = float(np.abs(x[:, :3]).max())
        ratio, last = step / last, step
        if not alone:
            var = (np.diagonal(a, axis1=1, axis2=2)[:, 3:] for a in (path.pose_cov, path.wrench_cov))
            moves = (x[:, :3], (x - chain) @ classes.loads[3, t:])
            size = np.sqrt(max(float((d**2 / v).max()) for d, v in zip(moves, var, strict=True)))
            if size * min(ratio, 1.0) < THOUSANDTH and (ratio < 0.5 or size < THOUSANDTH**2):
                if causal and (path := smooth_turning(model, z, near, Mode.FILTERED)) is None:
                    return None
                whole = np.zeros((len(R), classes.size))
                whole[:, classes.chain] = chain
                return path, R, whole
            least, since = (size, 0) if size < 0.5 * least else (least, since + 1)
            if since == LOOK_AFTER:  # moved about by rounding, or too slowly
                return None
        R, guess[:, t + 3 :] = turned(x[:, :3], R), x[:, 3:]
    return None
