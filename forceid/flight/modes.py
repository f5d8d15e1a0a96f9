"""Modes of a body in flight: their chains beside those of the loads, and what they do to its rotation.

Each mode has the states (q, q', f ...) of its prior. They are seen by the frames, whose poses they bend and
whose further numbers they make, and they change the inertia: theta' gains

    - R J^-1 (dJ/dq_k Omega + dh/dq_k) dq_k - R J^-1 dh/dq'_k dq'_k.

Source: principal equations 4d, 4f.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from scipy.linalg import block_diag

from forceid.flight.vibration import ModeState, Vibration
from forceid.kalman.building.clock import discretize_steps
from forceid.kalman.building.process import block_diagonal
from forceid.kalman.model import StateSpace, at_all_times
from forceid.motion import Frames, Products
from forceid.records import Array, Indices


@dataclass(frozen=True)
class StrainGauges:
    """Strain gauges: reading (time, gauge) = rows q + bias + noise, NaN where not sampled.

    rows (gauge, mode) 1/m; noise_cov (gauge, gauge) of white noise; bias_std (gauge,) of the bias before
    anything is read, which stays.
    """

    reading: Array
    rows: Array
    noise_cov: Array
    bias_std: Array


@dataclass(frozen=True)
class Followers:
    """Shapes that nobody sees, as many as count, whose amplitudes are sums of those of leaders (leader,).

    Their weights are constant and not known: std, each by itself, before anything is seen.
    """

    count: int
    leaders: Indices
    std: float

    @property
    def states(self) -> int:
        """Weights, shape by shape."""
        return self.count * len(self.leaders)

    def led(self, weight: Array, motion: Array) -> Array:
        """Motion (time, shape) by weight (time, state) of what the modes do, motion (time, mode)."""
        each = weight.reshape(len(weight), self.count, len(self.leaders))
        return np.asarray(np.einsum("tjk,tk->tj", each, motion[:, self.leaders]))

    def slopes(self, motion: Array) -> Array:
        """What the weights add to it (time, shape, state)."""
        slopes = np.einsum("ij,tk->tijk", np.eye(self.count), motion[:, self.leaders])
        return np.asarray(slopes.reshape(len(motion), self.count, self.states))


@dataclass(frozen=True)
class FlyingModes:
    """The modes of a flight: what frames show of them, their prior, what they weigh, and where they begin.

    path (time, state): chains (q, q', f ...) of all modes, then weights of the followers, about which a
    flight is linearized first; followers: shapes behind the modes that move as these do, None for none;
    gauges: that read the strain of modes; mounting: displacement and tilt (sensor, mode, 3) of gyros and
    accelerometers, each for a unit of amplitude; inside ([time,] 3) kg m2/s, body axes: momentum of what
    turns inside the body.
    """

    frames: Frames
    prior: Vibration
    products: Products
    path: Array
    followers: Followers | None = None
    gauges: StrainGauges | None = None
    mounting: tuple[Array, Array] | None = None
    inside: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def amplitude(self) -> Array:
        """Amplitudes q (time, mode) along the path, of the followers too."""
        return self.with_followers(self.chains[..., ModeState.AMPLITUDE])

    @property
    def rate(self) -> Array:
        """Their rates q' (time, mode)."""
        return self.with_followers(self.chains[..., ModeState.RATE])

    @property
    def acceleration(self) -> Array:
        """Their accelerations q'' (time, mode)."""
        chains = self.chains[..., : len(ModeState)]
        return self.with_followers(np.einsum("kb,tkb->tk", self.prior.motion[:, 2], chains))

    @property
    def own(self) -> int:
        """States of the chains; behind them stand the weights of the followers."""
        return len(self.prior.std) * self.prior.states

    @property
    def chains(self) -> Array:
        """Chains (time, mode, state) along the path."""
        return self.path[:, : self.own].reshape(len(self.path), -1, self.prior.states)

    def with_followers(self, motion: Array) -> Array:
        """Motion (time, mode), and behind it that of the followers."""
        if self.followers is None:
            return motion
        return np.concatenate([motion, self.followers.led(self.path[:, self.own :], motion)], 1)

    def by_states(self, at: slice, *slopes: Array) -> Array:
        """Slopes (time, ..., state) from those (time, ..., mode) by amplitude, rate and what comes behind.

        at: of the path, where these are; what comes behind is the load, and the acceleration of followers.
        """
        each, m = self.prior.states, len(self.prior.std)
        out = np.zeros((*slopes[0].shape[:-1], self.path.shape[1]))
        for k, (slope, of) in enumerate(zip(slopes, ("amplitude", "rate", "acceleration"), strict=False)):
            out[..., k : self.own : each] = slope[..., :m]
            if self.followers is not None:
                by_weight = self.followers.slopes(getattr(self, of)[at])
                out[..., self.own :] += np.einsum("t...j,tjs->t...s", slope[..., m:], by_weight)
        return out

    def part(self, s: slice) -> FlyingModes:
        """A stretch of the flight."""
        frames = replace(self.frames, **{f.name: getattr(self.frames, f.name)[s] for f in fields(Frames)})
        gauges = self.gauges
        if gauges is not None:
            gauges = replace(gauges, reading=gauges.reading[s])
        inside = self.inside if self.inside.ndim == 1 else self.inside[s]
        return replace(self, frames=frames, path=self.path[s], gauges=gauges, inside=inside)

    def inertia(self) -> tuple[Array, Array]:
        """Inertia (time, 3, 3) and h (time, 3) about the mass center, body axes, along the path."""
        J, h = self.products.of(self.amplitude, self.rate)
        return J, h + self.inside


def chains(prior: Vibration, step: Array) -> tuple[Array, Array, Array]:
    """F, Q (time - 1, state, state) and P0 of the chains of all modes."""
    unique, which = np.unique(np.round(step, 12), return_inverse=True)
    process = prior.process
    F, Q = (block_diagonal(*a.swapaxes(0, 1)) for a in discretize_steps(process, unique))
    P0 = block_diag(*process.P0)
    if len(unique) > 1:
        F, Q = F[which], Q[which]
    return at_all_times(F, len(step)), at_all_times(Q, len(step)), P0


def bent(
    model: StateSpace, first: int, modes: FlyingModes, time: Array, rotation: Array, H: Array
) -> StateSpace:
    """The model of a rigid flight with the chains of its modes behind its states.

    first: its first state of the rotation error theta; rotation (time, 3, 3) and H (time, 3), world axes: of
    the reference.
    """
    step = np.diff(time)
    F_q, Q_q, P_q = chains(modes.prior, step)
    if modes.followers is not None:
        more = np.eye(modes.followers.states)
        F_q, Q_q = block_diagonal(F_q, more), block_diagonal(Q_q, 0 * more)
        P_q = block_diag(P_q, modes.followers.std**2 * more)
    n, k, T = len(model.x0), len(P_q), len(time)
    theta, own = slice(first, first + 3), slice(n, n + k)
    at_start, at_end = mode_impulses(modes, step, rotation, H, model.F[:, theta, theta])
    F, Q = block_diagonal(model.F, F_q), block_diagonal(model.Q, Q_q)
    F[:, theta, own], Q[:, theta, own] = at_start + at_end @ F_q, at_end @ Q_q
    Q[:, own, theta] = Q[:, theta, own].swapaxes(1, 2)
    Q[:, theta, theta] += Q[:, theta, own] @ at_end.swapaxes(1, 2)
    u = np.zeros((T - 1, n + k))
    u[:, :n] = model.u
    u[:, theta] -= np.einsum("tij,tj->ti", F[:, theta, own], modes.path[:-1])
    m = len(modes.prior.std)
    rows = np.zeros((T, 6 + m, n + k))
    rows[:, :6, :n], rows[:, :6, n:] = model.H, modes.by_states(slice(None), modes.frames.leak)
    rows[:, 6:, n : n + modes.own : modes.prior.states] = modes.frames.rows
    R = block_diagonal(np.where(np.isfinite(modes.frames.cov), modes.frames.cov, np.eye(6)), np.eye(m))
    return StateSpace(F, Q, rows, R, np.pad(model.x0, (0, k)), block_diag(model.P0, P_q), u)


def mode_impulses(
    modes: FlyingModes, step: Array, rotation: Array, H: Array, d_theta: Array
) -> tuple[Array, Array]:
    """What the chains do to theta over a step, by their values at its start and at its end.

    Both (time - 1, 3, state): the integral of a cubic through amplitudes and rates at both ends. d_theta
    (time - 1, 3, 3): of theta over a step by itself.
    """
    J, h = modes.inertia()
    J_inv = np.linalg.inv(J)
    omega = np.einsum("tij,tj->ti", J_inv, np.einsum("tji,tj->ti", rotation, H) - h)
    dJ, by_q, by_rate = modes.products.slopes(modes.amplitude, modes.rate)
    turn = -rotation @ J_inv
    B = turn @ (np.einsum("tkij,tj->tki", dJ, omega) + by_q).swapaxes(1, 2)
    C = turn @ by_rate.swapaxes(1, 2)
    s = step[:, None, None]
    along = 0.5 * (d_theta @ C[:-1] + C[1:])  # times the change of q
    B_start, B_end = d_theta @ B[:-1], B[1:]
    return (
        modes.by_states(slice(None, -1), 0.5 * s * B_start - along, s**2 / 12 * B_start),
        modes.by_states(slice(1, None), 0.5 * s * B_end + along, -(s**2) / 12 * B_end),
    )


def with_strain_channels(model: StateSpace, gauges: StrainGauges, first: int, states: int) -> StateSpace:
    """A model with the channels of gauges below its own, and their biases behind its states.

    first: state of the first amplitude; states: of each mode.
    """
    (k, m), n, c = gauges.rows.shape, len(model.x0), model.R.shape[-1]
    H = np.zeros((len(model.H), c + k, n + k))
    H[:, :c, :n], H[:, c:, n:] = model.H, np.eye(k)
    H[:, c:, first : first + states * m : states] = gauges.rows
    F, Q = block_diagonal(model.F, np.eye(k)), block_diagonal(model.Q, np.zeros((k, k)))
    R = block_diagonal(model.R, gauges.noise_cov)
    u = None if model.u is None else np.pad(model.u, ((0, 0), (0, k)))
    return StateSpace(
        F, Q, H, R, np.pad(model.x0, (0, k)), block_diag(model.P0, np.diag(gauges.bias_std**2)), u
    )
