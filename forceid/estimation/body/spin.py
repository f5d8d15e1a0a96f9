"""The motion of a slender body: its line, followed without spin, and its turn about that.

Beside J n x n' of a line the momentum of such a body is L = R dJ R^T omega + J s n, s its rate of turn about
the line and dJ its tensor less that of a sphere of inertia J. L is known well enough from the measured
rotations alone: it is to the rest as the width of the body to its length, squared.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from forceid.estimation.body.inertia import Inertia
from forceid.estimation.body.tracks.bridging import straight
from forceid.flight.channels import driven, load_chain, start_of
from forceid.flight.priors.matern import Matern
from forceid.flight.smoother import FlightState
from forceid.flight.tuning import tune_loads
from forceid.kalman.engines import engine
from forceid.motion import Pose, exp, seen_together
from forceid.principal import axial, cross_matrix
from forceid.records import Array, Flags

BETWEEN = 4  # steps from frame to frame in which a line is followed: what it sweeps aside turns the rest
SIGNAL_FRAMES = 8  # frames that tell how a signal changes: fewer have a straight line
LOOSE = 0.3  # rad: a direction known less well than this is none


@dataclass(frozen=True)
class Spin:
    """The turn about a line: angle rad and rate rad/s (time,), from rotations that do not spin.

    momentum (time, 3) kg m2/s: L in the axes that follow the line without spin; moment (time,) N m along the
    line, and its variance moment_var (time,).
    """

    angle: Array
    rate: Array
    momentum: Array
    moment: Array
    moment_var: Array


def spin_about(time: Array, pose: Pose, free: Array, n: Array, inertia: Inertia) -> Spin:
    """The spin of the rotations of a pose beside spin-free ones, free (time, 3, 3), of lines n (time, 3)."""
    assert inertia.line is not None
    seen: Flags = np.asarray(np.isfinite(pose.rotation).all((1, 2)) & np.isfinite(free).all((1, 2)))
    angle = turn_about(pose.rotation[seen], free[seen], inertia.line)
    along = n[seen]
    noise = np.full(len(time), np.nan)
    noise[seen] = np.einsum("ta,tab,tb->t", along, pose.cov[seen, 3:, 3:], along)
    measured = np.full((len(time), 1), np.nan)
    measured[seen, 0] = np.unwrap(angle)
    turn = smoothed_signals(time, measured, noise[:, None])
    (smooth, rate), none = (turn.value[:, 0], turn.rate[:, 0]), np.zeros(len(time))
    if inertia.beside is None:
        return Spin(smooth, rate, np.zeros((len(time), 3)), none, none)
    var = 0.5 * (np.trace(pose.cov[:, 3:, 3:], axis1=1, axis2=2) - noise)
    n = np.where(seen[:, None], n, np.nan)
    dn = smoothed_signals(time, n, np.repeat(var[:, None], 3, 1)).rate
    n = interpolated(time, n)
    n = n / np.linalg.norm(n, axis=1, keepdims=True)
    dn = dn - np.einsum("ta,ta->t", dn, n)[:, None] * n
    free = np.where(seen[:, None, None], free, np.nan)
    free = interpolated(time, free.reshape(len(time), 9)).reshape(-1, 3, 3)
    R = free @ exp(smooth[:, None] * inertia.line)
    omega = np.cross(n, dn) + rate[:, None] * n
    J, own = inertia.tensor[0, 0], float(inertia.line @ (inertia.tensor + inertia.beside) @ inertia.line)
    L = np.einsum("tab,bc,tdc,td->ta", R, inertia.beside, R, omega) + J * rate[:, None] * n
    moment = own * turn.second[:, 0] - np.einsum("ta,ta->t", L, dn)
    return Spin(smooth, rate, np.einsum("tba,tb->ta", free, L), moment, own**2 * turn.second_var[:, 0])


def turn_about(R: Array, free: Array, axis: Array) -> Array:
    """Angle (time,) rad about `axis` (3,), body axes, by which R (time, 3, 3) is ahead of `free`.

    >>> turn_about(exp(np.array([[0.0, 0.0, 0.3]])), np.eye(3)[None], np.array([0.0, 0, 1])).round(9).tolist()
    [0.3]
    """
    M = free.swapaxes(1, 2) @ R
    cos = 0.5 * (np.trace(M, axis1=1, axis2=2) - np.einsum("a,tab,b->t", axis, M, axis))
    return np.asarray(np.arctan2(-0.5 * axial(M) @ axis, cos))


class Smooth(NamedTuple):
    """Signals, their rates and the rates of these, and variances of the last: (time, signal)."""

    value: Array
    rate: Array
    second: Array
    second_var: Array


def smoothed_signals(time: Array, z: Array, var: Array) -> Smooth:
    """Signals z (time, signal), NaN where unseen, with variances var (time, signal), by the smoother of what
    drives each, under a prior tuned on them; straight lines where a record is too short.
    """
    seen: Flags = np.asarray(np.isfinite(z).all(1))
    first, still = (z[seen][0] if seen.any() else np.zeros(z.shape[1])), np.zeros_like(z)
    if seen.sum() < SIGNAL_FRAMES:
        rate, value = np.polyfit(time[seen], z[seen], 1) if seen.sum() > 1 else (0.0 * first, first)
        return Smooth(value + np.outer(time, rate), still + rate, still, still)
    y, var, none = z - first, np.where(seen[:, None], var, 1.0), np.zeros(z.shape[1])
    tuned = tune_loads(time, y, 1.0, var, none)
    assert isinstance(tuned.kernel, Matern)
    chain = load_chain(tuned.kernel.process, start_of(time, y, 1.0))
    models = driven(chain, 1.0, var * tuned.noise**2, none, np.diff(time))
    found = [engine().smooth(models.one(j), y[:, j : j + 1]) for j in range(z.shape[1])]
    x, P = np.stack([f.x for f in found], 1), np.stack([f.P for f in found], 1)
    drive = chain.A[..., 1, :]
    return Smooth(
        x[..., 0] + first,
        x[..., 1],
        np.einsum("tki,ki->tk", x, drive),
        np.einsum("ki,tkij,kj->tk", drive, P, drive),
    )


def interpolated(time: Array, values: Array) -> Array:
    """Values (time, channel) with straight lines where they are NaN."""
    seen = np.isfinite(values).all(1)
    return values if seen.all() else straight(time, time[seen], values[seen])


def with_spin_rate(state: FlightState, spin: Spin | None, axis: Array | None) -> FlightState:
    """The state of a flight that follows the line `axis` (3,), body axes, with the rate of its spin."""
    if spin is None or axis is None:
        return state
    return replace(state, omega=state.omega + spin.rate[:, None] * (state.rotation @ axis))


def with_own_tensor(state: FlightState, inertia: Inertia, rate_std: float) -> FlightState:
    """The state of a slender body whose turn gyros read, to rate_std rad/s, with the moment of its tensor.

    The flight was that of a sphere of inertia J: from its moment, omega' = T / J; T = J omega' + omega x J
    omega with the body's own J in its place.
    """
    assert inertia.line is not None
    J, n = float(inertia.tensor[0, 0]), inertia.line
    own = inertia.tensor + (-J * np.outer(n, n) if inertia.beside is None else inertia.beside)
    own = state.rotation @ own @ state.rotation.swapaxes(1, 2)
    H = np.einsum("tab,tb->ta", own, state.omega)
    both = np.zeros((len(H), 6, 6))
    both[:, :3, :3], both[:, 3:, 3:] = np.eye(3), own / J
    by_rate = cross_matrix(state.omega) @ own - cross_matrix(H)
    cov = both @ state.wrench_cov @ both.swapaxes(1, 2)
    cov[:, 3:, 3:] += rate_std**2 * by_rate @ by_rate.swapaxes(1, 2)
    moment = np.einsum("tab,tb->ta", own, state.moment) / J + np.cross(state.omega, H)
    return replace(state, moment=moment, H=H, wrench_cov=cov)


def spun(state: FlightState, spin: Spin, n: Array, axis: Array) -> FlightState:
    """The state of a flight that follows a line n (time, 3) without spin, turned about it as the spin says.

    axis (3,): the line in body axes. What of moment and momentum lies along the line is that of the spin.
    """
    along = np.einsum("tba,ta->tb", state.rotation, spin.momentum) * n
    cov = state.wrench_cov.copy()
    cov[:, 3:, 3:] += spin.moment_var[:, None, None] * n[:, :, None] * n[:, None]
    return replace(
        state, rotation=state.rotation @ exp(spin.angle[:, None] * axis),
        omega=state.omega + spin.rate[:, None] * n, H=state.H + along.sum(1, keepdims=True) * n,
        moment=state.moment + spin.moment[:, None] * n, wrench_cov=cov,
    )  # fmt: skip


def directions(
    position: Array, along: Array, usable: Flags, weight: Array | None, noise_std: float
) -> tuple[Array, Array]:
    """Unit directions (time, 3) of a line from points on it, NaN where unseen; variance (time,) rad2 of each.

    position (time, node, 3), NaN = not seen; along (node,) m: place of each on the line; usable (node,):
    those that lie on it. weight (node,), of zero sum: that of the angular momentum of masses on the line, M
    along; it is taken where all that it weighs is seen, for such a direction is right however the line
    bends. Else least squares. The variance is about either axis across.
    """
    n, var = np.full((len(position), 3), np.nan), np.full(len(position), np.nan)
    patterns, which = seen_together(position)
    for i, pattern in enumerate(patterns):
        at, kept = which == i, pattern & usable
        if weight is not None and not (weight != 0)[~pattern].any():
            a = weight
        elif kept.any():
            a = np.where(kept, along - along[kept].mean(), 0.0)
        else:
            continue
        size, spread = float(a @ along), noise_std * float(np.linalg.norm(a))
        if not size > 0 or spread > LOOSE * size:
            continue
        used = a != 0
        v = np.einsum("n,tna->ta", a[used], position[at][:, used])
        n[at] = v / np.linalg.norm(v, axis=1, keepdims=True)
        var[at] = (spread / size) ** 2
    return n, var


def without_spin(time: Array, direction: Array, axis: Array) -> Array:
    """Rotations (time, 3, 3) that take `axis` (3,) to each direction (time, 3) and never spin about it.

    Parallel transport along the directions, a spline between them; NaN where the direction is.
    """
    R = np.full((len(time), 3, 3), np.nan)
    seen = np.isfinite(direction).all(1)
    t, n = time[seen], direction[seen]
    if not len(t):
        return R
    steps = np.zeros((0, 3, 3))
    if len(t) > 1:
        parts = np.linspace(0.0, 1.0, BETWEEN + 1)
        path = CubicSpline(t, n)(t[:-1, None] + np.diff(t)[:, None] * parts)
        path[:, -1], path[:, 0] = n[1:], n[:-1]
        path /= np.maximum(np.linalg.norm(path, axis=2, keepdims=True), 1e-300)
        steps = shortest(path[:, 0], path[:, 1])
        for k in range(1, BETWEEN):
            steps = shortest(path[:, k], path[:, k + 1]) @ steps
    found = [shortest(axis[None], n[:1])[0]]
    for step in steps:
        found.append(step @ found[-1])
    R[seen] = found
    return R


def shortest(a: Array, b: Array) -> Array:
    """The rotations (n, 3, 3) by the least angle that take unit vectors a (n, 3) to b; none is opposite.

    >>> shortest(np.eye(3)[:1], np.eye(3)[1:2])[0].round(12).tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    v = cross_matrix(np.cross(a, b))
    c = np.einsum("ni,ni->n", a, b)
    return np.asarray(np.eye(3) + v + v @ v / np.maximum(1 + c, 1e-12)[:, None, None])
