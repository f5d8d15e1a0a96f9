"""How a body flies under a load: Newton and Euler, or an affine motion, by Dormand and Prince of order 8.

Nothing of forceid is used. The path begins anew at every instant at which the load breaks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from evidence.calibration import distributions as of
from evidence.calibration.bodies import Moved
from evidence.calibration.loads import Load, State, given
from evidence.vectors import hat
from forceid.records import Array

EXACT = 1e-9  # relative; the absolute one is this of what is typical of each coordinate
JUST = 1e-12  # s: so much before or behind a jump


@dataclass(frozen=True)
class Flown:
    """A flight: center (time, 3) m, F (time, 3, 3) reference to world, a rotation if rigid; force, moment."""

    center: Array
    F: Array
    force: Array
    moment: Array


def rotation(q: Array) -> Array:
    """The matrix of a quaternion, scalar last, of any length."""
    x, y, z, w = q / np.sqrt(q @ q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


@dataclass(frozen=True)
class Rigid:
    """A rigid body: center, velocity, angular momentum, quaternion (13,)."""

    body: Moved
    inverse: Array

    def start(self, state: State, q: Array, strain: Array) -> Array:
        """The coordinates at the start."""
        H = state.R @ self.body.inertia @ state.R.T @ state.w
        return np.concatenate([state.center, state.velocity, H, q])

    def state(self, y: Array) -> State:
        """Where the body is."""
        R = rotation(y[9:])
        return State(y[:3], y[3:6], R, R @ (self.inverse @ (R.T @ y[6:9])))

    def rates(self, y: Array, s: State, wrench: Array, gravity: Array) -> Array:
        """How the coordinates change."""
        v, w, turn = y[9:12], s.w, y[12]
        spun = 0.5 * np.array([
            turn * w[0] + w[1] * v[2] - w[2] * v[1], turn * w[1] + w[2] * v[0] - w[0] * v[2],
            turn * w[2] + w[0] * v[1] - w[1] * v[0], -w @ v,
        ])  # fmt: skip
        return np.concatenate([y[3:6], wrench[:3] / self.body.mass + gravity, wrench[3:], spun])

    def places(self, y: Array) -> Array:
        """F (time, 3, 3) of coordinates (time, 13)."""
        return np.array([rotation(q) for q in y[:, 9:]])

    def typical(self, y: Array) -> Array:
        """Sizes of the coordinates."""
        H = max(float(np.linalg.norm(y[6:9])), 0.1 * float(np.trace(self.body.inertia)))
        return np.repeat([self.body.size, 1.0, H, 1.0], [3, 3, 3, 4])


@dataclass(frozen=True)
class Soft:
    """A body that deforms affinely, of the material of St. Venant and Kirchhoff with some damping.

    Coordinates: center, velocity, F and its rate (24,). The elastic energy is lam/2 tr(E)^2 + mu E:E of
    E = (F^T F - 1) / 2 with lam = mu, in J. A moment acts as forces that turn without stretching.
    """

    body: Moved
    inverse: Array  # of second
    mu: float
    damping: float

    def start(self, state: State, q: Array, strain: Array) -> Array:
        """The coordinates at the start."""
        F = state.R @ (np.eye(3) + strain)
        return np.concatenate([state.center, state.velocity, F.ravel(), (hat(state.w) @ F).ravel()])

    def state(self, y: Array) -> State:
        """Where the body is; w is that of a rigid body of its angular momentum and present inertia."""
        F, rate = y[6:15].reshape(3, 3), y[15:].reshape(3, 3)
        U, _, V = np.linalg.svd(F)
        second, spun = F @ self.body.second @ F.T, rate @ self.body.second @ F.T
        H = np.array([spun[2, 1] - spun[1, 2], spun[0, 2] - spun[2, 0], spun[1, 0] - spun[0, 1]])
        w = np.linalg.solve(np.trace(second) * np.eye(3) - second, H)
        return State(y[:3], y[3:6], U @ V, w)

    def rates(self, y: Array, s: State, wrench: Array, gravity: Array) -> Array:
        """How the coordinates change."""
        F, rate = y[6:15].reshape(3, 3), y[15:].reshape(3, 3)
        E, strained = 0.5 * (F.T @ F - np.eye(3)), 0.5 * (F.T @ rate + rate.T @ F)
        stress = self.mu * (np.trace(E) * np.eye(3) + 2 * E) + 2 * self.damping * strained
        acts = 0.5 * hat(wrench[3:]) @ np.linalg.inv(F).T - F @ stress
        return np.concatenate([
            y[3:6], wrench[:3] / self.body.mass + gravity, y[15:], (acts @ self.inverse).ravel()
        ])  # fmt: skip

    def places(self, y: Array) -> Array:
        """F (time, 3, 3) of coordinates (time, 24)."""
        return y[:, 6:15].reshape(-1, 3, 3)

    def typical(self, y: Array) -> Array:
        """Sizes of the coordinates."""
        return np.repeat([self.body.size, 1.0, 1.0, max(1.0, float(np.abs(y[15:]).max()))], [3, 3, 9, 9])


def mechanics(body: Moved) -> Rigid | Soft:
    """The equations of a body."""
    if body.swing is None:
        return Rigid(body, np.linalg.inv(body.inertia))
    # of stretches along axes, 3 mu is the stiffness; the middle second moment swings at the drawn frequency
    w = 2 * np.pi * body.swing
    mu = w**2 * float(np.linalg.eigvalsh(body.second)[1]) / 3
    return Soft(body, np.linalg.inv(body.second), mu, 2 * body.loss * mu / w)


def flown(
    body: Moved, time: Array, start: State, q: Array, strain: Array, load: Load, gravity: Array
) -> Flown | None:
    """The flight at times, or None where it turns or goes beyond what a camera follows."""
    moves = mechanics(body)
    y = moves.start(start, q, strain)

    def rates(t: float, y: Array) -> Array:
        s = moves.state(y)
        return moves.rates(y, s, load(t, s), gravity)

    step, path = time[1] - time[0], np.empty((len(time), len(y)))
    edges = np.array([time[0], *[b for b in load.breaks if time[0] < b < time[-1]], time[-1]])
    path[0] = y

    def beyond(t: float, y: Array) -> float:
        s = moves.state(y)
        return min(of.TURNED / step - float(np.linalg.norm(s.w)), of.FLOWN - float(np.linalg.norm(s.center)))

    beyond.terminal = True  # type: ignore[attr-defined]
    for begin, end in pairwise(edges):
        inside = np.flatnonzero((time > begin) & (time <= end))
        at = np.union1d(time[inside], [end])
        # a break belongs to the piece behind it: the load is asked inside of each piece alone
        within: Callable[[float, Array], Array] = lambda t, y, b=begin, e=end: rates(  # noqa: E731
            min(max(t, b + JUST), e - JUST), y
        )
        found = solve_ivp(
            within, (begin, end), y, "DOP853", at, events=beyond, rtol=EXACT, atol=EXACT * moves.typical(y),
            max_step=4 * step,
        )  # fmt: skip
        if found.status != 0:
            return None
        path[inside], y = found.y.T[: len(inside)], found.y[:, -1]
    wrench = np.array([load.steady(t, moves.state(y)) for t, y in zip(time, path, strict=True)])
    for when in load.breaks:  # of a jump too, the mean over the sample that it falls into
        k = int(np.argmin(np.abs(time - when)))
        if (behind := (time[k] - when) / step + 0.5) < 0 or behind > 1:
            continue
        s = moves.state(path[k])
        jump = load.steady(when + JUST, s) - load.steady(when - JUST, s)
        wrench[k] += (behind - (time[k] >= when)) * jump
    for pulse in load.pulses:
        wrench += (given(time + step / 2, *pulse) - given(time - step / 2, *pulse)) / step
    return Flown(path[:, :3], moves.places(path), wrench[:, :3], wrench[:, 3:])
