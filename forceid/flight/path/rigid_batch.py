"""The linear smoother of a long flight: stretches of one record side by side, a stretch in each vector lane.

About a reference the model of a flight changes with every sample, but only in the rows of the rotation error,
so that no covariance comes to rest and most of every matrix is the same or nothing. The compiled engine goes
through such a record in several lanes at once: each begins some time before its part, and where two meet they
must agree to 1e-8 of a standard deviation. Else, and where a load has a constant, which is never forgotten,
the record is gone through from end to end. The start, which may be as good as unknown, goes through the array
form as everywhere (`conditioning`). Source: principal equations 4f.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from forceid.compiled import engine as compiled
from forceid.errors import EstimationError
from forceid.kalman.covariance import square_root
from forceid.kalman.model import Filtered, StateSpace
from forceid.kalman.recursions import linear, passes
from forceid.kalman.recursions.square_root import eliminate, step_back, white_share
from forceid.records import Array, Indices
from forceid.rounding import SINGLE

WARM = (512, 2048, 4096)  # samples that a lane begins before its part, and goes on behind it: till lanes meet
numpy_passes: Any = passes  # few samples


@dataclass(frozen=True)
class TurningModel:
    """A linear model of kinds of steps, of which the rows of theta change with every step.

    F, Q (kind, state, state), u (kind, state); which (step,): kind of each; top, noise (step, 3, states from
    theta on): rows of theta in F and Q; push (step, 3): its known input; theta: its first state, or their
    number where there is none; H (channel, state), R (time, channel, channel), x0, P0 as in StateSpace; read
    (12, state): rows of wrench and pose; guess (time, state): where a lane may begin.
    """

    F: Array
    Q: Array
    u: Array
    which: Indices
    top: Array
    noise: Array
    push: Array
    theta: int
    H: Array
    R: Array
    x0: Array
    P0: Array
    read: Array

    def first(self, samples: int) -> StateSpace:
        """The model of the first samples, step by step."""
        which, t = self.which[: samples - 1], self.theta
        F, Q, u = self.F[which], self.Q[which], self.u[which]
        if t < len(self.x0):
            F[:, t : t + 3, t:], u[:, t : t + 3] = self.top[: samples - 1], self.push[: samples - 1]
            Q[:, t : t + 3, t:] = self.noise[: samples - 1]
            Q[:, t:, t : t + 3] = self.noise[: samples - 1].swapaxes(1, 2)
        return StateSpace(F, Q, self.H, self.R[:samples], self.x0, self.P0, u)

    @property
    def remembers(self) -> bool:
        """Whether a state stays for ever as it was at the start: no stretch of a record forgets that."""
        still = (np.eye(len(self.x0)) == self.F).all((0, 2)) & ~self.Q.any((0, 2))
        still[self.theta : self.theta + 3] = False
        return bool(still.any())


class Mode(IntEnum):
    """What a run returns, as flight.hpp counts it: states, or with covariances given all or what is past."""

    STATES, SMOOTHED, FILTERED = range(3)


@dataclass(frozen=True)
class Path:
    """States x (time, state) given all samples, or those so far; covariances (time, 6, 6) read out of them.

    innovation (time, channel): whitened. Covariances are empty where states alone were asked for.
    """

    x: Array
    wrench_cov: Array
    pose_cov: Array
    innovation: Array
    log_likelihood: float


def smooth_turning(model: TurningModel, z: Array, guess: Array, mode: Mode = Mode.SMOOTHED) -> Path | None:
    """States and covariances of a flight given z (time, channel); None where only the plain passes will do.

    guess (time, state): where a lane may begin. mode: STATES alone, SMOOTHED, or FILTERED with covariances.
    """
    n, T, lanes = len(model.x0), len(z), getattr(compiled, "lanes", 8)
    seen = np.isfinite(z).any(1)
    head = int(seen.argmax()) + 4 + -(-n // z.shape[1])
    if compiled is None or head > 64 or 2 * head > T:
        return None
    try:
        start = linear.filter(numpy_passes, model.first(head), z[:head])
    except EstimationError:
        return None
    for warm in (*(w for w in WARM if T - head >= 4 * w and not model.remembers), 0):
        cut = warm > 0
        begin = head + (T - head - 2 * warm) // lanes * np.arange(lanes) - 1
        x0 = np.array([start.x[-1], *guess[begin[1:]]]) if cut else np.tile(start.x[-1], (lanes, 1))
        found = compiled.smooth(
            model.F, model.Q, model.u, model.which, model.top, model.noise, model.push, model.H, model.R, z,
            model.read, model.theta, start.gains.P[-1], x0, head, warm, cut, mode,
        )  # fmt: skip
        if found[0] == "ill":
            return None
        if not found[0]:
            break
    _, x, wrench_cov, pose_cov, white, log_likelihood, r, later, _ = found
    f_P = start.P
    if mode == Mode.FILTERED:
        x[:head], P = start.x, f_P
    else:
        x[:head], P = smoothed_start(start, r, later if mode == Mode.SMOOTHED else None)
    if mode != Mode.STATES:
        out, before = (model.read @ a @ model.read.T for a in (P, f_P[-1]))
        if (np.diagonal(out[-1]) < SINGLE * np.diagonal(before)).any():
            return None
        wrench_cov[:head], pose_cov[:head] = out[:, :6, :6], out[:, 6:, 6:]
    white[:head] = start.innovation
    return Path(x, wrench_cov, pose_cov, white, log_likelihood + float(start.log_likelihood))


def smoothed_start(start: Filtered, r: Array, later: Array | None) -> tuple[Array, Array]:
    """States and covariances of the first samples, given the adjoint of all later ones at the last of them.

    Step by step back with factors, of which neither a start as good as unknown nor a difference takes digits.
    """
    x, P = start.x.copy(), start.P
    roots = square_root(P)
    if (C := start.factors) is not None:
        roots = np.where(np.isfinite(C[:, :1, :1]), C, roots)
    model, u = start.model, start.model.u
    assert u is not None
    Q_root = square_root(model.Q)
    x[-1] += P[-1] @ r
    if later is not None:
        P[-1] -= P[-1] @ later @ P[-1]
    for k in range(len(x) - 2, -1, -1):
        F = model.F[k]
        L, K = step_back(roots[k], F, Q_root[k])
        x[k] += K @ white_share(L, x[k + 1] - F @ start.x[k] - u[k])
        if later is not None:
            rest = eliminate(F @ roots[k], roots[k], Q_root[k])[2]
            moved = K @ white_share(L, square_root(P[k + 1]))
            P[k] = rest @ rest.T + moved @ moved.T
    return x, P
